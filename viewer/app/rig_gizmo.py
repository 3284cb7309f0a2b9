"""The template moved by hand over the target: a gizmo, and landmarks that are clicked on both.

The gizmo is ImGuizmo's, which turns and moves a matrix. It counts in float32: what it gives is
made a similarity again.
"""

from __future__ import annotations

import numpy as np
from imgui_bundle import imgui, imguizmo

from viewer.app.reasons import no_job_room
from viewer.app.rig_placing import (
    as_similarity,
    ghost_of,
    ghost_place,
    move_by_hand,
    placing_now,
    posed_template,
    set_aside,
    similarity_now,
    target_place,
)
from viewer.app.rig_sources import current_template, refresh, target_mesh
from viewer.app.rig_view import TOOLS, Landmark, Template
from viewer.app.rig_work import start_align, start_reading, take_finished
from viewer.app.state import AppState
from viewer.app.view_frame import ViewFrame, view_frame
from viewer.rendering.camera import fit
from viewer.rendering.ghost_pass import Ghost
from viewer.rig.arrays import Floats
from viewer.rig.mesh import Mesh, bounding_box
from viewer.rig.ray_hit import RayHit, first_hit, surface_point
from viewer.rig.transform import apply_transform, translation_matrix

__all__ = ["choose_rig_tool", "draw_rig_tools", "drop_rig_tool", "holds_mouse", "show_rig"]

_G = imguizmo.im_guizmo
_OPERATIONS = {
    "move": _G.OPERATION.translate,
    "rotate": _G.OPERATION.rotate,
    "scale": _G.OPERATION.scale,
}
_SIZE = 0.22  # of the gizmo, in clip space
_TEMPLATE_INK, _TARGET_INK = (0.35, 0.70, 1.0, 1.0), (1.0, 0.75, 0.30, 1.0)
_RIM = (0.0, 0.0, 0.0, 0.8)
_DOT = 5.0  # radius, window coordinates


def choose_rig_tool(state: AppState, tool: str) -> None:
    """Take a way to move the template in hand, a key of ``TOOLS``."""
    view = state.rig
    if tool and current_template(state) is None:
        start_reading(state)
        return
    state.posing.tool = "select"
    view.tool, view.pending, view.holds_mouse = tool, None, False
    if tool == "landmarks":
        _show_both(state)
    if tool:
        state.say_status(f"{TOOLS[tool][0]}: {TOOLS[tool][1]}")


def _show_both(state: AppState) -> None:
    """Show the template beside the target, and both whole."""
    view, template = state.rig, current_template(state)
    if template is None or view.target is None:
        return
    set_aside(state)
    mesh = posed_template(view, template)
    points = (
        apply_transform(ghost_place(state, template), mesh.positions),
        apply_transform(target_place(view.target), target_mesh(state).positions),
    )
    state.camera.fixed = None
    fit(state.camera, np.concatenate(points), state.aspect)


def drop_rig_tool(state: AppState) -> bool:
    """Put the tool, or the half of a pair of landmarks, away; return whether there was one."""
    view = state.rig
    if view.pending is not None:
        view.pending = None
        return True
    had_one, view.tool, view.holds_mouse = bool(view.tool), "", False
    return had_one


def holds_mouse(state: AppState) -> bool:
    """Return whether the mouse belongs to the gizmo: on a handle a drag does not orbit."""
    return state.rig.holds_mouse


def show_rig(state: AppState) -> Ghost | None:
    """Go on with what the Rig panel began; return the template if it is to be drawn.

    To be called when the scene has been posed, before it is drawn.
    """
    refresh(state)
    take_finished(state)
    view = state.rig
    if view.target is None or current_template(state) is None:
        view.tool = ""
    if not view.tool:
        view.holds_mouse = False
    elif view.tool == "landmarks":
        _take_click(state)
    _measure(state)
    view.shown = ghost_of(state)
    return view.shown


def _measure(state: AppState) -> None:
    """Measure how well the template lies once it was let go of."""
    view, placing = state.rig, placing_now(state)
    if not view.was_dragged or imgui.is_mouse_down(imgui.MouseButton_.left):
        return
    if placing is None:
        view.was_dragged = False
    elif not no_job_room(state):
        view.was_dragged = False
        start_align(state, placing.settings)


def _take_click(state: AppState) -> None:
    """Take a click for a landmark: on the template first, then on the target."""
    wanted, view, template = state.wants_pick, state.rig, current_template(state)
    if wanted is None or wanted[2] or template is None:
        return
    state.wants_pick = None
    x, y, _, _ = state.view_rect
    place = (wanted[0] + x, wanted[1] + y)
    if view.pending is None:
        mesh, matrix, what = (
            posed_template(view, template),
            ghost_place(state, template),
            "template",
        )
    else:
        assert view.target is not None  # there is a tool
        mesh, matrix, what = target_mesh(state), target_place(view.target), "target"
    hit = _hit(view_frame(state), mesh, matrix, place)
    if hit is None:
        state.say_status(f"Landmarks: click on the {what}")
    elif view.pending is None:
        view.pending = hit
        state.say_status("Landmarks: now the same point of the target")
    else:
        view.landmarks.append(Landmark(view.pending, hit))
        view.pending = None
        count = len(view.landmarks)
        state.say_status(f"{count} landmark{'s' * (count != 1)}")


def _hit(frame: ViewFrame, mesh: Mesh, matrix: Floats, place: tuple[float, float]) -> RayHit | None:
    """Return what of a mesh is seen at a place of the window."""
    origin, direction = frame.ray(place)
    back = np.asarray(np.linalg.inv(matrix), dtype=np.float64)
    return first_hit(
        mesh.positions,
        mesh.triangles,
        np.asarray(apply_transform(back, origin[None])[0]),
        back[:3, :3] @ direction,
    )


def draw_rig_tools(state: AppState) -> None:
    """Draw the gizmo or the landmarks over the picture of the scene, and drag by the gizmo."""
    view, template = state.rig, current_template(state)
    x, y, width, height = state.view_rect
    if not view.tool or template is None or view.target is None or min(width, height) < 40.0:
        return
    ink = imgui.get_background_draw_list()
    ink.push_clip_rect((x, y), (x + width, y + height), True)
    if view.tool == "landmarks":
        _draw_landmarks(state, template)
    else:
        _use_gizmo(state, template)
    ink.pop_clip_rect()


def _use_gizmo(state: AppState, template: Template) -> None:
    """Draw ImGuizmo's handles in the middle of the template, and take over what they did."""
    view, camera = state.rig, state.camera
    assert view.target is not None  # the caller looked
    place = target_place(view.target)
    middle = bounding_box(posed_template(view, template).positions).mean(axis=0)
    before = place @ similarity_now(state, template).matrix @ translation_matrix(middle)
    _G.begin_frame()
    _G.set_drawlist(imgui.get_background_draw_list())
    _G.set_rect(*view_frame(state).rect)
    _G.set_orthographic(camera.is_parallel)
    _G.set_gizmo_size_clip_space(_SIZE)
    now = _matrix(before)
    mode = _G.MODE.local if view.tool == "scale" else _G.MODE.world
    changed = _G.manipulate(
        _matrix(camera.view_matrix()),
        _matrix(camera.projection_matrix(state.aspect, state.box)),
        _OPERATIONS[view.tool],
        mode,
        now,
    )
    hovers = _G.get_hovered_handle_type() != _G.MOVETYPE.mt_none
    view.holds_mouse = _G.is_using() or (hovers and not imgui.get_io().want_capture_mouse)
    if changed:
        after = np.array(now.values, dtype=np.float64).reshape(4, 4).T
        if view.tool == "scale":
            after = _scaled_alike(before, after)
        moved = np.linalg.inv(place) @ after @ translation_matrix(-middle)
        move_by_hand(state, template, as_similarity(moved))
        view.was_dragged = True


def _matrix(values: Floats) -> imguizmo.im_guizmo.Matrix16:
    """Return a matrix as ImGuizmo has them: column by column."""
    return _G.Matrix16([float(value) for value in values.T.ravel()])


def _scaled_alike(before: Floats, after: Floats) -> Floats:
    """Return the matrix of before, all of it scaled by what one handle scaled its axis by."""
    lengths = [np.linalg.norm(matrix[:3, :3], axis=0) for matrix in (before, after)]
    factors = lengths[1] / np.maximum(lengths[0], 1e-30)
    factor = float(factors[np.abs(np.log(np.maximum(factors, 1e-6))).argmax()])
    scaled = before.copy()
    scaled[:3, :3] *= max(factor, 1e-3)
    return scaled


def _draw_landmarks(state: AppState, template: Template) -> None:
    """Draw all pairs as numbered dots, and the one that lacks its other half."""
    view = state.rig
    assert view.target is not None  # the caller looked
    posed, place = posed_template(view, template), ghost_place(state, template)
    for number, pair in enumerate(view.landmarks, start=1):
        _draw_dot(state, posed, place, pair.template, str(number), _TEMPLATE_INK)
        _draw_dot(
            state, target_mesh(state), target_place(view.target), pair.target, str(number),
            _TARGET_INK,
        )  # fmt: skip
    if view.pending is not None:
        text = f"{len(view.landmarks) + 1}?"
        _draw_dot(state, posed, place, view.pending, text, _TEMPLATE_INK)


def _draw_dot(
    state: AppState,
    mesh: Mesh,
    matrix: Floats,
    hit: RayHit,
    text: str,
    color: tuple[float, float, float, float],
) -> None:
    point = surface_point(mesh.positions, mesh.triangles, hit)
    seen = view_frame(state).place(apply_transform(matrix, point[None])[0])
    if seen is None:
        return
    ink, rim = imgui.get_background_draw_list(), imgui.get_color_u32(_RIM)
    ink.add_circle_filled(seen, _DOT + 1.5, rim)
    ink.add_circle_filled(seen, _DOT, imgui.get_color_u32(color))
    for shift, shade in ((1.0, rim), (0.0, imgui.get_color_u32(color))):
        ink.add_text((seen[0] + _DOT + 3.0 + shift, seen[1] - 16.0 + shift), shade, text)
