"""The mouse in the view: orbit, pan, zoom; a click chooses, a double click aims."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.gizmo import choose_joint, use_handles
from viewer.app.rig_tools import holds_mouse
from viewer.app.state import AppState
from viewer.app.weights_view import wants_vertex
from viewer.rendering.camera import orbit, pan, zoom

__all__ = ["handle_mouse"]

_DEGREES_PER_POINT = 0.4
_ZOOM_PER_NOTCH = 0.88
_BUTTONS = (imgui.MouseButton_.left, imgui.MouseButton_.right, imgui.MouseButton_.middle)


def handle_mouse(state: AppState) -> None:
    """Move the camera by what the mouse did in this frame outside all panels."""
    io = imgui.get_io()
    x, y, width, height = state.view_rect
    if use_handles(state) or holds_mouse(state):
        return
    if io.want_capture_mouse or width < 1 or height < 1:
        return
    delta = io.mouse_delta
    moves = bool(delta.x or delta.y) and any(map(_drags, _BUTTONS))
    if moves or io.mouse_wheel:
        state.camera.fixed = None  # go on from where the calibrated camera stands
    left = _drags(imgui.MouseButton_.left)
    pans = _drags(imgui.MouseButton_.right) or _drags(imgui.MouseButton_.middle)
    if pans or (left and io.key_shift):
        pan(state.camera, -delta.x / height, delta.y / height)
    elif left:
        orbit(state.camera, -_DEGREES_PER_POINT * delta.x, _DEGREES_PER_POINT * delta.y)
    place = (io.mouse_pos.x - x, io.mouse_pos.y - y)
    if imgui.is_mouse_double_clicked(imgui.MouseButton_.left):
        state.wants_pick = (*place, True)
    elif (
        imgui.is_mouse_released(imgui.MouseButton_.left)
        and _is_click()
        and (wants_vertex(state.weights) or not choose_joint(state))
    ):
        state.wants_pick = (*place, False)
    if io.mouse_wheel and imgui.is_mouse_pos_valid():
        across = (io.mouse_pos.x - x - width / 2) / height
        upward = -(io.mouse_pos.y - y - height / 2) / height
        zoom(state.camera, _ZOOM_PER_NOTCH**io.mouse_wheel, across, upward)


def _drags(button: imgui.MouseButton_) -> bool:
    # A quick hand moves and lets go within one frame: that way belongs to the drag as well.
    return imgui.is_mouse_dragging(button, 0.0) or imgui.is_mouse_released(button)


def _is_click() -> bool:
    """Return whether the button that went up had not been dragged, nor clicked twice."""
    io, left = imgui.get_io(), imgui.MouseButton_.left
    is_still = io.mouse_drag_max_distance_sqr[left] < io.mouse_drag_threshold**2
    return is_still and io.mouse_clicked_last_count[left] < 2 and not io.key_shift
