"""Display: what of the figure is drawn, and how."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.actions import show
from viewer.app.state import AppState
from viewer.app.widgets import checkbox, choice, note_item, slider
from viewer.rendering.ground_pass import grid_step, parse_color
from viewer.rendering.options import SHOWN
from viewer.rendering.program import SHADING

__all__ = ["draw"]

_BACKGROUNDS = {"gradient": "Gradient", "transparent": "Transparent", "#": "Colour"}


def draw(state: AppState) -> None:
    """Draw the panel."""
    options = state.options
    for key, text in SHOWN.items():
        if imgui.radio_button(text, options.show == key):
            show(state, key)
        note_item(state, text)
    if options.show == "both":
        options.skeleton_opacity = slider(
            state, "Skeleton opacity", options.skeleton_opacity, 0.0, 1.0, flags=_CLAMP
        )
    imgui.separator()
    options.shading = choice(state, "Shading", options.shading, SHADING)
    options.flat = checkbox(state, "Flat", options.flat)
    _beside("Wireframe")
    options.wireframe = checkbox(state, "Wireframe", options.wireframe)
    options.normals = checkbox(state, "Vertex normals", options.normals)
    _beside("Texture")
    options.texture = checkbox(state, "Texture", options.texture)
    options.cull = checkbox(state, "Cull back faces", options.cull)
    _beside("Grid (0.5)")
    options.grid = checkbox(state, f"Grid ({grid_step(state.box):g})###Grid", options.grid)
    _draw_background(state)


_CLAMP = imgui.SliderFlags_.always_clamp


def _beside(text: str) -> None:
    """Put a check box with this text into the right half of the last one's line if it fits."""
    start, room = imgui.get_cursor_screen_pos().x, imgui.get_content_region_avail().x
    gap = imgui.get_style().item_spacing.x
    begins_free = imgui.get_item_rect_max().x + gap <= start + room * 0.5
    if begins_free and imgui.get_frame_height() + gap + imgui.calc_text_size(text).x <= room * 0.5:
        imgui.same_line(room * 0.5)


def _draw_background(state: AppState) -> None:
    options = state.options
    is_color = options.background.startswith("#")
    chosen = choice(state, "Background", "#" if is_color else options.background, _BACKGROUNDS)
    if chosen != "#":
        options.background = chosen
        return
    color = parse_color(options.background) if is_color else (1.0, 1.0, 1.0)
    changed, picked = imgui.color_edit3("Colour", list(color))
    note_item(state, "Colour")
    if changed or not is_color:
        digits = "".join(f"{round(255 * min(max(c, 0.0), 1.0)):02x}" for c in picked[:3])
        options.background = f"#{digits}"
