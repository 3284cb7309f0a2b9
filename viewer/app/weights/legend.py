"""Legend of a scalar quantity, in a corner of the view."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.core.widgets import Rect, begin_overlay, overlay_rect, swatch
from viewer.phrases import printable
from viewer.rendering.overlay.legend import Legend, legend_columns

_GAP = 10.0  # points from the edges of the view
_BAR = (40.0 / 3.0, 0.8)  # width and height of the bar, in font sizes
_TALL, _WIDE = 0.8, 0.4  # fractions of the view's height and width available for names
_MANY, _SMALLER = 12, 0.8  # maximum number of names at normal font size; scale with more
_LONGEST = 40  # maximum length of a name in characters
_LINE = (0.05, 0.05, 0.06, 1.0)


def draw_legend(state: AppState) -> Rect | None:
    """Draw the legend of a shown quantity unless the image has it; return its rectangle."""
    x, y, width, height = state.view_rect
    shows_mesh = any(
        actor.visible and actor.figure.mesh is not None and state.options.show != "skeleton"
        for actor in state.scene.actors
    )
    legend, options = state.stats.legend, state.options
    if options.shading != "scalar" or options.legend or width < 200 or not shows_mesh:
        return None
    if legend is None:
        return None
    if begin_overlay("##legend", x + _GAP, y + _GAP, (0.0, 0.0)):
        imgui.text_unformatted(printable(legend.heading, 2 * _LONGEST))
        if len(legend.colors):
            _draw_bar(legend, min(_BAR[0] * imgui.get_font_size(), width - 60.0))
        smaller = _SMALLER if len(legend.entries) > _MANY else 1.0
        imgui.push_font(None, smaller * imgui.get_style().font_size_base)
        _draw_entries(legend, width, height)
        imgui.pop_font()
        if legend.note:
            imgui.text_disabled(legend.note)
    rect = overlay_rect(state, "##legend")
    imgui.end()
    return rect


def _draw_bar(legend: Legend, width: float) -> None:
    """Draw the colours, lines at the isolines, and the numbers below."""
    place, draw_list = imgui.get_cursor_screen_pos(), imgui.get_window_draw_list()
    bottom = place.y + _BAR[1] * imgui.get_font_size()
    colors = legend.colors.astype(float) / 255.0
    # Discrete colours are drawn as they are, a continuous map in steps of a few points.
    steps = min(len(colors), round(width / 3.0)) if len(colors) == 256 else len(colors)
    for step in range(steps):
        # Whole pixels: edges between them would be blended with the background.
        left = round(place.x + width * step / steps)
        right = round(place.x + width * (step + 1) / steps)
        row = colors[int((step + 0.5) / steps * len(colors))]
        color = imgui.get_color_u32((float(row[0]), float(row[1]), float(row[2]), 1.0))
        draw_list.add_rect_filled((left, place.y), (right, bottom), color)
    for at in legend.lines:
        middle = round(place.x + at * width) + 0.5
        ink = imgui.get_color_u32(_LINE)
        draw_list.add_line((middle, place.y), (middle, bottom), ink)
    imgui.dummy((width, bottom - place.y))
    base = imgui.get_cursor_pos()
    for tick in legend.ticks:
        size = imgui.calc_text_size(tick.text).x
        # Numbers stay within the bar, all on the same line.
        shift = min(max(tick.place * width - 0.5 * size, 0.0), width - size)
        imgui.set_cursor_pos((base.x + shift, base.y))
        imgui.text_unformatted(tick.text)


def _draw_entries(legend: Legend, width: float, height: float) -> None:
    """Draw colours and names of as many entries as fit, in columns."""
    if not legend.entries:
        return
    side, line = imgui.get_text_line_height(), imgui.get_text_line_height_with_spacing()
    gap = imgui.get_style().item_spacing.x
    texts = [printable(entry.text, _LONGEST) for entry in legend.entries]
    widths = [imgui.calc_text_size(text).x + side + 2.0 * gap for text in texts]
    rows = max(int(_TALL * height / line) - 3, 1)
    columns = legend_columns(widths, rows, _WIDE * width)
    first, left, top = 0, imgui.get_cursor_pos_x(), imgui.get_cursor_pos_y()
    for number, count in enumerate(columns.counts):
        imgui.set_cursor_pos((left, top))
        for row in range(first, first + count):
            imgui.set_cursor_pos_x(left)
            r, g, b = (channel / 255.0 for channel in legend.entries[row].color)
            swatch((r, g, b))
            imgui.text_unformatted(texts[row])
        if number == len(columns.counts) - 1 and columns.left_out:
            imgui.set_cursor_pos_x(left)
            imgui.text_disabled(f"and {columns.left_out} more")
        first, left = first + count, left + columns.widths[number]
    imgui.set_cursor_pos((imgui.get_style().window_padding.x, top + columns.rows * line))
    imgui.dummy((0.0, 0.0))  # ImGui requires an item after the cursor is set
