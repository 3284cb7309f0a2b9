"""Mouse input in the view: orbit, pan and zoom, clicks and double clicks; what the mouse holds."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.posing.gizmo import choose_joint, use_handles
from viewer.app.posing.posing import Posing
from viewer.app.rigging.joint_editing.drags import hold_joint
from viewer.app.rigging.joint_editing.state import JointEditing
from viewer.app.rigging.rigging import Rigging
from viewer.app.rigging.tools import holds_mouse
from viewer.app.view.axis_gizmo import holds_gizmo
from viewer.app.view.hovering import Picking
from viewer.app.weights.weights_panel import Weights, wants_vertex
from viewer.rendering.camera import orbit, pan, zoom

_DEGREES_PER_POINT = 0.4
_ZOOM_PER_NOTCH = 0.88
_LEFT = imgui.MouseButton_.left
_RIGHT = imgui.MouseButton_.right
_BUTTONS = (_LEFT, _RIGHT, imgui.MouseButton_.middle)


def drop_motion_before_press() -> None:
    """Discard pointer motion that preceded a press in the same frame; called before drawing."""
    # Drags that use the motion of the frame, as in plots, would begin with a jump.
    io = imgui.get_io()
    clicked = [button for button in _BUTTONS if imgui.is_mouse_clicked(button)]
    held = [button for button in _BUTTONS if imgui.is_mouse_down(button)]
    if clicked and clicked == held:  # a drag of an earlier press continues
        io.mouse_delta = imgui.ImVec2(0.0, 0.0)


def handle_mouse(state: AppState) -> None:
    """Move the camera by the mouse input of this frame outside all panels."""
    picking = state.of(Picking)
    io = imgui.get_io()
    x, y, width, height = state.view_rect
    if use_handles(state) or hold_joint(state) or holds_mouse(state) or holds_gizmo(state):
        return
    if io.want_capture_mouse or width < 1 or height < 1:
        return
    dragging = [button for button in _BUTTONS if _drags(button)]
    delta = io.mouse_delta
    if (dragging and (delta.x or delta.y)) or io.mouse_wheel:
        state.camera.fixed = None  # continue from the position of the calibrated camera
    if dragging and (dragging != [_LEFT] or io.key_shift):
        pan(state.camera, -delta.x / height, delta.y / height)
    elif dragging:
        orbit(state.camera, -_DEGREES_PER_POINT * delta.x, _DEGREES_PER_POINT * delta.y)
    place = (io.mouse_pos.x - x, io.mouse_pos.y - y)
    if imgui.is_mouse_double_clicked(_LEFT):
        picking.wanted = (*place, True)
    elif (
        imgui.is_mouse_released(_LEFT)
        and _is_still(_LEFT)
        and io.mouse_clicked_last_count[_LEFT] < 2
        and not io.key_shift
        and (wants_vertex(state.of(Weights)) or not choose_joint(state))
    ):
        picking.wanted = (*place, False)
    if imgui.is_mouse_released(_RIGHT) and _is_still(_RIGHT):
        picking.menu_at = place
    if io.mouse_wheel and imgui.is_mouse_pos_valid():
        across = (io.mouse_pos.x - x - width / 2) / height
        upward = -(io.mouse_pos.y - y - height / 2) / height
        zoom(state.camera, _ZOOM_PER_NOTCH**io.mouse_wheel, across, upward)


def _drags(button: imgui.MouseButton_) -> bool:
    """Return whether the pointer's motion since the last frame belongs to a drag."""
    if imgui.is_mouse_clicked(button):
        return False  # the motion preceded the press
    # A motion and a release within one frame also belong to the drag.
    return imgui.is_mouse_dragging(button, 0.0) or imgui.is_mouse_released(button)


def _is_still(button: imgui.MouseButton_) -> bool:
    """Return whether the pointer has stayed in place since a button was pressed."""
    io = imgui.get_io()
    return bool(io.mouse_drag_max_distance_sqr[button] < io.mouse_drag_threshold**2)


def is_held(state: AppState) -> bool:
    """Return whether an edit is in progress: a widget or a handle is held."""
    drag = state.of(Posing).drag
    is_dragged = drag is not None and not drag.is_over
    moves_template = state.of(Rigging).holds_mouse and imgui.is_mouse_down(imgui.MouseButton_.left)
    moves_joint = state.of(JointEditing).drag is not None
    return _is_widget_held() or is_dragged or moves_template or moves_joint


def _is_widget_held() -> bool:
    """Return whether a widget is held. A text field changes nothing until it loses the focus."""
    # Tab goes from field to field without a frame in between: each number is a separate edit.
    active = imgui.internal.get_active_id()
    # This state persists after typing: the same slider may be dragged afterwards.
    is_text = imgui.internal.get_input_text_state(active) is not None
    return active != 0 and not (is_text and imgui.get_io().want_text_input)


def stops_time(state: AppState) -> bool:
    """Return whether time must stop: a handle is held but has not been dragged yet."""
    # A click must not pause playback, and a drag must start from an unchanged pose.
    drag = state.of(Posing).drag
    return drag is not None and not drag.has_moved
