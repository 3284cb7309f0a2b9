"""Hover text: properties of the vertex under the mouse."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.core.widgets import begin_overlay, overlay_rect
from viewer.app.files.state import Files
from viewer.app.weights.state import Weights

__all__ = ["draw_hover_text", "shows_vertex_info"]

_AWAY = 16.0  # points between the mouse and the text


def draw_hover_text(state: AppState) -> None:
    """Draw the hover text while the mouse does not move."""
    hover = state.of(Weights).hover
    mouse = imgui.get_io().mouse_pos
    if not hover.lines or hover.place != (mouse.x, mouse.y) or not shows_vertex_info(state):
        return
    x, y, width, height = state.view_rect
    is_right, is_low = mouse.x > x + 0.6 * width, mouse.y > y + 0.6 * height
    left = mouse.x - _AWAY if is_right else mouse.x + _AWAY
    top = mouse.y - _AWAY if is_low else mouse.y + _AWAY
    if begin_overlay("##hover", left, top, (float(is_right), float(is_low))):
        for line in hover.lines:
            imgui.text_unformatted(line)
    overlay_rect(state, "##hover")
    imgui.end()


def shows_vertex_info(state: AppState) -> bool:
    """Return whether hover text is currently shown."""
    view, io = state.of(Weights), imgui.get_io()
    shows_panel = view.panel_frame == imgui.get_frame_count()
    is_covered = bool(state.error) or state.of(Files).dialog is not None or io.want_capture_mouse
    is_held = any(io.mouse_down[button] for button in range(3))
    return (view.always_shows_info or shows_panel) and not is_covered and not is_held
