"""Picking of actors, joints and vertices in the view, by clicking or hovering."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from imgui_bundle import imgui

from viewer.app.core.state import AppState, shows_errors
from viewer.app.posing.gizmo import joint_at
from viewer.app.posing.joint_tree import select_joint
from viewer.app.posing.posing import Posing
from viewer.app.posing.toolbar import no_tool
from viewer.app.view.hovering import Picking, hover_actor, joint_near
from viewer.app.weights.vertex_panel import shows_vertex_info
from viewer.app.weights.weights_panel import Hover, Weights, pin_vertex, wants_vertex
from viewer.data_classes import dataclass
from viewer.phrases import printable
from viewer.rendering.options import DisplayOptions
from viewer.rendering.picking import Pick
from viewer.rendering.renderer import Renderer
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.inspection.single_vertices import (
    deform_vertices,
    facts_text,
    nearest_corner,
    vertex_facts,
)
from viewer.rigs.scene import Actor
from viewer.rigs.skeleton import joint_label

_LONGEST = 40  # maximum length of a name in characters
_REST = 0.2  # seconds without mouse movement before a vertex is described


@shows_errors
def answer_picks(
    state: AppState, renderer: Renderer, size: tuple[int, int], scale: float, picture: object
) -> None:
    """Handle the pending click, and describe the vertex under the mouse once the mouse is still."""
    picking = state.of(Picking)
    wanted, picking.wanted = picking.wanted, None
    if wanted is not None:
        x, y, aims = wanted
        _take_click(state, renderer, size, (x * scale, y * scale), aims)
    _look_under_mouse(state, renderer, size, scale, picture)
    hover_actor(state, renderer, size, scale)


def _take_click(
    state: AppState,
    renderer: Renderer,
    size: tuple[int, int],
    pixel: tuple[float, float],
    aims: bool,
) -> None:
    """Pin the vertex at a pixel if vertices are picked; otherwise select or aim the camera."""
    if not aims and wants_vertex(state.of(Weights)):
        found = vertex_at(state, renderer, size, pixel)
        if found is not None:
            pin_vertex(state, found[0], found[1])
        return
    pick = _pick(state, renderer, size, pixel, state.options)
    if not aims and (pick is None or pick.joint < 0):
        near = _joint_beside(state, size, pixel)
        if near >= 0:  # a joint is close to the click
            select_joint(state, near)
            return
    if pick is None:
        if not aims:
            state.deselect()
        return
    take_pick(state, pick, aims)
    mover = None if aims else _mover(state, pick)
    if mover is not None:
        select_joint(state, mover.joint)
        state.say_status(f"{mover.text}: the largest weight at vertex {mover.vertex}")


@dataclass(frozen=True, slots=True, eq=False)
class Spot:
    """The item at a pixel."""

    actor: int
    """Index of an actor."""
    joint: int
    """Joint drawn at or near the pixel, or else the one with the most influence there; -1 for
    none."""
    vertex: int
    """Nearest vertex of the surface; -1 for none."""
    part: int = -1
    """Part of the mesh; -1 for none."""


def spot_at(
    state: AppState, renderer: Renderer, size: tuple[int, int], pixel: tuple[float, float]
) -> Spot | None:
    """Return the item at a pixel, None for the background; may raise ``ViewerError`` for shapes."""
    pick = _pick(state, renderer, size, pixel, state.options)
    found = vertex_at(state, renderer, size, pixel)
    near = _joint_beside(state, size, pixel)
    if pick is None or (pick.joint < 0 and near >= 0):
        return Spot(state.chosen_actor, near, -1) if near >= 0 else None
    mover = _mover(state, pick) if pick.joint < 0 else None
    joint = pick.joint if mover is None else mover.joint
    vertex = found[1] if found and found[0] == pick.actor else -1
    return Spot(pick.actor, joint, vertex, _part_of(state, pick))


def _joint_beside(state: AppState, size: tuple[int, int], pixel: tuple[float, float]) -> int:
    """Return the joint drawn near a pixel of the image, -1 for none."""
    x, y, width, _ = state.view_rect
    return joint_near(state, (x + pixel[0] * width / size[0], y + pixel[1] * width / size[0]))


def _part_of(state: AppState, pick: Pick) -> int:
    """Return the part of the picked triangle; -1 for none, and in the reduced mesh."""
    figure = state.scene.actors[pick.actor].figure
    is_reduced = state.options.reduced and figure.reduced is not None
    if pick.triangle < 0 or figure.mesh is None or is_reduced:
        return -1
    return int(figure.mesh.part_indices[pick.triangle])


class _Mover(NamedTuple):
    """The joint with the largest weight at a vertex."""

    joint: int
    vertex: int
    text: str


def _mover(state: AppState, pick: Pick) -> _Mover | None:
    """Return the joint with the largest weight where a skin was hit; None if no skin was hit."""
    if pick.joint >= 0 or pick.triangle < 0:
        return None
    actor, vertex, triangle = _vertex_of(state, pick)
    figure = state.scene.actors[actor].figure
    facts = vertex_facts(figure, None, state.options.skinning, vertex, triangle)
    if not len(facts.joints):
        return None
    name = printable(facts.names[0], _LONGEST)
    return _Mover(int(facts.joints[0]), vertex, f"{name} {facts.weights[0]:.2f}")


def _pick(
    state: AppState,
    renderer: Renderer,
    size: tuple[int, int],
    pixel: tuple[float, float],
    options: DisplayOptions,
) -> Pick | None:
    return renderer.pick(state.scene, state.camera, options, size, *pixel, state.box)


def take_pick(state: AppState, found: Pick, aims: bool) -> None:
    """Choose the actor and joint that were clicked; a double click aims the camera there."""
    if found.actor != state.chosen_actor:
        state.select_actor(found.actor)
        state.say_status(printable(state.actor.name, 60))
    state.is_actor_selected = True
    if found.joint >= 0:
        select_joint(state, found.joint)
    if aims:
        state.camera.fixed = None
        state.camera.target = found.point.copy()


def vertex_at(
    state: AppState, renderer: Renderer, size: tuple[int, int], pixel: tuple[float, float]
) -> tuple[int, int, int] | None:
    """Return the actor, vertex and triangle (-1 for a reduced mesh) visible at a pixel, or None."""
    options = state.options
    # Only surfaces are picked, even where joints or keypoints are drawn over them.
    show = "skin" if options.show == "both" else options.show
    seen = replace(
        options, show=show, keypoints=False, xray=False, joint_names=False, joint_axes=False
    )
    found = _pick(state, renderer, size, pixel, seen)
    return None if found is None or found.triangle < 0 else _vertex_of(state, found)


def _vertex_of(state: AppState, found: Pick) -> tuple[int, int, int]:
    """Return actor, vertex and triangle of a surface that was hit; -1 for a reduced triangle."""
    options = state.options
    actor = state.scene.actors[found.actor]
    figure = actor.figure
    assert figure.mesh is not None  # a triangle was hit
    corners, triangle = figure.mesh.triangles[found.triangle], found.triangle
    if options.reduced and figure.reduced is not None:
        corners = figure.reduced.vertices[figure.reduced.triangles[found.triangle]]
        triangle = -1
    positions = _drawn_positions(actor, options, corners)
    placed = apply_transform(actor.placement, positions)
    return found.actor, nearest_corner(placed, corners, found.point), triangle


def _drawn_positions(actor: Actor, options: DisplayOptions, vertices: Ints) -> Floats:
    """Return the drawn positions of vertices, before the actor's placement: (N, 3)."""
    mesh = actor.figure.mesh
    assert mesh is not None  # the figure has vertices
    if options.show == "binding":
        return mesh.positions[vertices]
    return deform_vertices(actor.figure, actor.own_pose, options.skinning, vertices)[0]


def _look_under_mouse(
    state: AppState, renderer: Renderer, size: tuple[int, int], scale: float, picture: object
) -> None:
    """Describe the vertex under the mouse once the mouse and the image are still."""
    view, io = state.of(Weights), imgui.get_io()
    x, y, width, height = state.view_rect
    place = (io.mouse_pos.x, io.mouse_pos.y)
    is_inside = x <= place[0] < x + width and y <= place[1] < y + height
    view.is_waiting = False
    if not shows_vertex_info(state) or not is_inside:
        view.hover = Hover()
        return
    now, hover = imgui.get_time(), view.hover
    if hover.place != place or hover.picture != picture:
        view.hover = hover = Hover(now, place, picture)
    view.is_waiting = not hover.is_known and now - hover.since < _REST
    if hover.is_known or view.is_waiting:
        return
    hover.is_known = True
    pixel = (place[0] - x) * scale, (place[1] - y) * scale
    pick = _pick(state, renderer, size, pixel, state.options)
    on_skin = pick is not None and pick.joint < 0 and pick.triangle >= 0
    if pick is not None and on_skin:
        found: tuple[int, int, int] | None = _vertex_of(state, pick)
    else:  # something else is drawn over the surface
        found = vertex_at(state, renderer, size, pixel)
    if found is not None:
        index, vertex, triangle = found
        actor, options = state.scene.actors[index], state.options
        facts = vertex_facts(actor.figure, actor.own_pose, options.skinning, vertex, triangle)
        if options.show == "binding":
            mesh = actor.figure.require_mesh()
            facts = replace(facts, position=mesh.positions[vertex], normal=mesh.normals[vertex])
        hover.point = apply_transform(actor.placement, facts.position)
        title = (actor.name,) if len(state.scene.actors) > 1 else ()
        hover.lines = (*title, *facts_text(facts), *_click_text(state, pick))


def _click_text(state: AppState, pick: Pick | None) -> tuple[str, ...]:
    """Return a line with the joint that a click would select; empty if it would select none."""
    mouse = imgui.get_io().mouse_pos
    if wants_vertex(state.of(Weights)) or pick is None:
        return ()
    over = (
        joint_at(state, (mouse.x, mouse.y)) if state.of(Posing).is_on and not no_tool(state) else -1
    )
    whose = state.actor if over >= 0 else state.scene.actors[pick.actor]
    joint, skeleton = over if over >= 0 else pick.joint, whose.figure.skeleton
    if joint >= 0 and skeleton is not None:
        return (f"click: {printable(joint_label(skeleton, joint), _LONGEST)}",)
    mover = _mover(state, pick)
    return () if mover is None else (f"click: {mover.text}",)
