"""List of keys over the window, in columns, or with a scroll bar if the window is small."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from imgui_bundle import imgui

from viewer.app.core.ink import ink
from viewer.app.core.key_names import KeyNames
from viewer.app.core.state import AppState
from viewer.app.core.widgets import overlay_rect
from viewer.app.features import KEYS, MOUSE
from viewer.app.keys import Keyboard

__all__ = ["column_layout", "draw_keys"]

_COLOR = (1.0, 0.78, 0.45, 1.0)  # colour of the keys
_OPACITY = 0.97  # text behind the list must not show through
_GAP, _BETWEEN = 1.5, 3.0  # distances from a key to its text and between columns, in font sizes


class _Columns(NamedTuple):
    """Number of columns, number of rows, and whether the whole list fits."""

    number: int
    rows: int
    fits: bool


def draw_keys(state: AppState) -> None:
    """Draw the list if it is open; the wheel scrolls it in a small window."""
    if not state.of(Keyboard).is_listed:
        return
    changed = state.of(KeyNames).changed
    lines = [*((changed.get(key.label, key.label), key.text) for key in KEYS), *MOUSE]
    style, viewport = imgui.get_style(), imgui.get_main_viewport()
    letter = imgui.get_font_size()
    first = max(imgui.calc_text_size(label).x for label, _ in lines) + _GAP * letter
    column = first + max(imgui.calc_text_size(text).x for _, text in lines) + _BETWEEN * letter
    room = (
        viewport.size.x - 4.0 * style.window_padding.x,
        viewport.size.y - 4.0 * style.window_padding.y,
    )
    columns = column_layout(len(lines), room, (column, imgui.get_text_line_height_with_spacing()))
    center = viewport.get_center()
    imgui.set_next_window_pos(center, imgui.Cond_.always, (0.5, 0.5))
    edges = 2.0 * style.window_padding.x, 2.0 * style.window_padding.y
    imgui.set_next_window_size_constraints((0.0, 0.0), (room[0] + edges[0], room[1] + edges[1]))
    imgui.set_next_window_bg_alpha(_OPACITY)
    if imgui.begin("##keys", None, _flags(columns.fits))[0]:
        _draw_lines(lines, columns, first, column)
    overlay_rect(state, "##keys")
    imgui.end()


def _flags(fits: bool) -> int:
    """Return the flags of a window that accepts input only if it scrolls."""
    flags = imgui.WindowFlags_.no_title_bar | imgui.WindowFlags_.no_resize
    flags |= imgui.WindowFlags_.no_move | imgui.WindowFlags_.always_auto_resize
    flags |= imgui.WindowFlags_.no_docking | imgui.WindowFlags_.no_saved_settings
    flags |= imgui.WindowFlags_.no_focus_on_appearing | imgui.WindowFlags_.no_nav
    if fits:
        return flags | imgui.WindowFlags_.no_inputs | imgui.WindowFlags_.no_scrollbar
    return flags | imgui.WindowFlags_.horizontal_scrollbar


def column_layout(count: int, room: tuple[float, float], line: tuple[float, float]) -> _Columns:
    """Return the smallest number of columns that fit into the height, limited by the width.

    >>> column_layout(50, (1000, 600), (400, 20)), column_layout(50, (1000, 400), (400, 20))
    (_Columns(number=2, rows=25, fits=True), _Columns(number=2, rows=25, fits=False))
    """
    wanted = -(-count // max(int(room[1] / line[1]), 1))
    number = max(min(wanted, int(room[0] / line[0])), 1)
    rows = -(-count // number)
    return _Columns(number, rows, number == wanted and number * line[0] <= room[0])


def _draw_lines(
    lines: Sequence[tuple[str, str]], columns: _Columns, first: float, column: float
) -> None:
    """Draw the lines column by column; a key and its text form one line."""
    left, top = imgui.get_cursor_pos()
    step = imgui.get_text_line_height_with_spacing()
    for index, (label, text) in enumerate(lines):
        at, row = divmod(index, columns.rows)
        place = left + at * column, top + row * step
        imgui.set_cursor_pos(place)
        imgui.text_colored(ink(_COLOR), label)
        imgui.set_cursor_pos((place[0] + first, place[1]))
        imgui.text_unformatted(text)
