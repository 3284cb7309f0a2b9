"""What is said of the vertex under the mouse, beside it."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.core.widgets import begin_overlay, overlay_rect
from viewer.app.view.picks import tells_vertices

__all__ = ["draw_hover_text"]

_AWAY = 16.0  # points between the mouse and the text


def draw_hover_text(state: AppState) -> None:
    """Draw the lines about the vertex under the mouse as long as the mouse stays there."""
    hover = state.weights.hover
    mouse = imgui.get_io().mouse_pos
    if not hover.lines or hover.place != (mouse.x, mouse.y) or not tells_vertices(state):
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
