"""The joint or actor under the pointer, which a click would select, and the click in progress."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.posing.gizmo import joint_at
from viewer.app.posing.posing import Posing
from viewer.app.posing.toolbar import no_tool
from viewer.app.view.axis_gizmo import is_over_gizmo
from viewer.app.weights.weights_panel import Weights, wants_vertex
from viewer.data_classes import dataclass
from viewer.rendering.lineup import has_joint_marks, shows_skeleton
from viewer.rendering.renderer import Renderer
from viewer.rigs.skeleton import joint_label

_REST = 0.06  # seconds for which the mouse must rest before actors are picked
_MOST = 16  # maximum number of actors for picking, which is slow on software drivers
_AWAY = 14.0  # points between the pointer and the name


@dataclass(slots=True)
class Hovered:
    """The item under the pointer."""

    joint: int = -1
    """Joint of the chosen actor; -1 for none."""
    actor: int = -1
    """Another actor; -1 for none."""
    place: tuple[float, float] = (-1.0, -1.0)
    """Position of the pointer, window coordinates."""
    since: float = 0.0
    """Time at which the pointer came to rest, seconds of ImGui's clock."""
    is_waiting: bool = False
    """Whether the pointer is at rest, but not yet for long enough."""


@dataclass(slots=True)
class Picking:
    """State of picking in the view."""

    wanted: tuple[float, float, bool] | None = None
    """Position of a click, relative to the upper left corner of the view, and whether the camera is
    aimed there: (x, y, aims)."""
    menu_at: tuple[float, float] | None = None
    """Position of a right click without a drag: (x, y)."""


def hover_joint(state: AppState) -> None:
    """Find the joint under the pointer; called in each frame before the scene is drawn."""
    hovered, mouse = state.of(Hovered), imgui.get_io().mouse_pos
    is_free = _is_free(state)
    hovered.joint = joint_near(state, (mouse.x, mouse.y)) if is_free else -1
    if not is_free:
        hovered.actor, hovered.is_waiting = -1, False


def hover_actor(state: AppState, renderer: Renderer, size: tuple[int, int], scale: float) -> None:
    """Find the actor under a resting pointer if there are several actors, but not too many."""
    hovered, mouse, now = state.of(Hovered), imgui.get_io().mouse_pos, imgui.get_time()
    place = (mouse.x, mouse.y)
    is_told = 2 <= len(state.scene.actors) <= _MOST and not state.of(Posing).is_on
    if not is_told or state.clock.playing or not _is_free(state):
        hovered.actor, hovered.is_waiting = -1, False
        return
    if place != hovered.place:
        hovered.place, hovered.since, hovered.is_waiting = place, now, True
    if not hovered.is_waiting or now - hovered.since < _REST:
        return
    hovered.is_waiting = False
    x, y = (scale * (place[axis] - state.view_rect[axis]) for axis in range(2))
    pick = renderer.pick(state.scene, state.camera, state.options, size, x, y, state.box)
    hovered.actor = -1 if pick is None else pick.actor


def joint_near(state: AppState, place: tuple[float, float]) -> int:
    """Return the chosen actor's visible joint near a window position, or -1."""
    posing, actor = state.of(Posing), state.actor
    if actor.figure.skeleton is None or actor.own_pose is None or not actor.is_drawn:
        return -1
    is_posed = posing.is_on and not no_tool(state)
    if not (is_posed or shows_skeleton(actor, state.options) or has_joint_marks(state.options)):
        return -1
    return joint_at(state, place)


def draw_hovered_name(state: AppState) -> None:
    """Draw the name of the joint or actor under the pointer; tools draw their own names."""
    hovered, skeleton = state.of(Hovered), state.actor.figure.skeleton
    if state.of(Posing).is_on or state.of(Weights).hover.lines:
        return
    text = ""
    if hovered.joint >= 0 and skeleton is not None and hovered.joint < skeleton.n_joints:
        text = joint_label(skeleton, hovered.joint)
    elif 0 <= hovered.actor < len(state.scene.actors):
        text = state.scene.actors[hovered.actor].name
    if not text:
        return
    mouse, pen = imgui.get_io().mouse_pos, imgui.get_background_draw_list()
    extent, pad = imgui.calc_text_size(text), 4.0
    x = min(mouse.x + _AWAY, state.view_rect[0] + state.view_rect[2] - extent.x - 2.0 * pad)
    y = mouse.y - 0.5 * extent.y
    corner = (x + extent.x + pad, y + extent.y + pad)
    pen.add_rect_filled((x - pad, y - pad), corner, imgui.get_color_u32((0.1, 0.11, 0.13, 0.85)), 3)
    pen.add_text((x, y), imgui.get_color_u32((1.0, 1.0, 1.0, 1.0)), text)


def _is_free(state: AppState) -> bool:
    """Return whether the pointer is over the view and not dragging anything."""
    io, (x, y, width, height) = imgui.get_io(), state.view_rect
    is_held = any(io.mouse_down[button] for button in range(3))
    is_inside = x <= io.mouse_pos.x < x + width and y <= io.mouse_pos.y < y + height
    is_free = is_inside and not is_held and not io.want_capture_mouse and not state.error
    return is_free and not wants_vertex(state.of(Weights)) and not is_over_gizmo(state)
