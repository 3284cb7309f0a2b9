"""Window of the command palette: a text box, and the entries that match it."""

from __future__ import annotations

from dataclasses import field

from imgui_bundle import imgui

from viewer.app.core.ink import ink
from viewer.app.core.state import AppState
from viewer.app.core.widgets import note_item, overlay_rect
from viewer.app.palette.entries import Entry, entries
from viewer.app.palette.matching import ranked
from viewer.data_classes import dataclass

__all__ = ["Palette", "draw_palette", "toggle_palette"]

_WIDTH, _ROWS = 34.0, 12  # in font sizes; maximum number of rows without scrolling
_TOP = 0.14  # upper edge, as a fraction of the window's height
_KEY_COLOR = (1.0, 0.78, 0.45, 1.0)
_K = imgui.Key


@dataclass(slots=True)
class Palette:
    """State of the palette.

    Attributes
    ----------
    is_open : bool
        Whether it is shown.
    has_focus : bool
        Whether its text box has had the focus since it was opened.
    query : str
        Typed text.
    row : int
        Highlighted row.
    known : list of Entry
        Entries of the scene for which it was opened.
    shown : list of int
        Indices of matching entries, best first.
    matched : str or None
        Query that these entries match.
    """

    is_open: bool = False
    has_focus: bool = False
    query: str = ""
    row: int = 0
    known: list[Entry] = field(default_factory=list)
    shown: list[int] = field(default_factory=list)
    matched: str | None = None


def toggle_palette(state: AppState) -> None:
    """Open the palette with an empty query, or close it."""
    is_open = state.of(Palette).is_open
    state.put(Palette(is_open=not is_open, known=[] if is_open else entries(state)))


def draw_palette(state: AppState) -> None:
    """Draw the palette if it is open; run the chosen entry after it has closed."""
    palette = state.of(Palette)
    if not palette.is_open:
        return
    viewport, font = imgui.get_main_viewport(), imgui.get_font_size()
    width = min(_WIDTH * font, viewport.size.x - 2.0 * font)
    place = (viewport.get_center().x, viewport.pos.y + _TOP * viewport.size.y)
    imgui.set_next_window_pos(place, imgui.Cond_.always, (0.5, 0.0))
    imgui.set_next_window_size((width, 0.0))
    flags = imgui.WindowFlags_.no_title_bar | imgui.WindowFlags_.no_resize
    flags |= imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_docking
    flags |= imgui.WindowFlags_.no_saved_settings | imgui.WindowFlags_.always_auto_resize
    if not palette.has_focus:
        imgui.set_next_window_focus()
    imgui.begin("##palette", None, flags)
    chosen = _draw_content(state, palette)
    overlay_rect(state, "##palette")
    is_left = palette.has_focus and not imgui.is_window_focused(imgui.FocusedFlags_.child_windows)
    imgui.end()
    if is_left or _is_closed():
        state.put(Palette())
    elif chosen is not None and not chosen.why:
        state.put(Palette())
        chosen.run(state)


def _is_closed() -> bool:
    """Return whether a key closes the palette; letters go to its text box."""
    is_again = imgui.get_io().key_ctrl and imgui.is_key_pressed(_K.p, False)
    return is_again or imgui.is_key_pressed(_K.escape, False)


def _draw_content(state: AppState, palette: Palette) -> Entry | None:
    """Draw the text box and the rows; return the entry to run."""
    if not palette.has_focus:
        imgui.set_keyboard_focus_here()
    imgui.set_next_item_width(-1.0)
    hint = "Find an action, panel, joint or figure"
    letters = "".join(map(chr, imgui.get_io().input_queue_characters))
    palette.query = imgui.input_text_with_hint("##query", hint, palette.query)[1]
    note_item(state, "palette query")
    if not palette.has_focus:
        _keep_early_letters(palette, letters)
    palette.has_focus |= imgui.is_item_active()
    if palette.query != palette.matched:
        palette.shown = ranked(palette.query, [entry.text for entry in palette.known])
        palette.matched, palette.row = palette.query, 0
    moved = _move(palette)
    chosen = _draw_rows(state, palette, moved)
    if imgui.is_key_pressed(_K.enter, False) or imgui.is_key_pressed(_K.keypad_enter, False):
        return palette.known[palette.shown[palette.row]] if palette.shown else None
    return chosen


def _keep_early_letters(palette: Palette, letters: str) -> None:
    """Add letters typed before the text box accepts input, as happens on a slow machine."""
    palette.query += letters
    editing = imgui.internal.get_input_text_state(imgui.get_item_id())
    if imgui.is_item_activated() and editing is not None:
        # The text box discards the letters of the frame in which it gets the focus.
        editing.reload_user_buf_and_move_to_end()


def _move(palette: Palette) -> bool:
    """Move the highlight with the arrow keys, wrapping at the ends; return whether it moved."""
    count = len(palette.shown)
    steps = {_K.down_arrow: 1, _K.up_arrow: -1, _K.page_down: _ROWS, _K.page_up: -_ROWS}
    step = sum(by for key, by in steps.items() if imgui.is_key_pressed(key))
    if not step or not count:
        return False
    row = palette.row + step
    palette.row = row % count if abs(step) == 1 else min(max(row, 0), count - 1)
    return True


def _draw_rows(state: AppState, palette: Palette, moved: bool) -> Entry | None:
    """Draw the rows in view; return the entry that was clicked."""
    chosen, count = None, len(palette.shown)
    if not count:
        imgui.text_disabled("no entry matches")
        return None
    height = imgui.get_text_line_height_with_spacing()
    if imgui.begin_child("##rows", (0.0, min(count, _ROWS) * height + 4.0)):
        if moved:
            _reveal(palette.row * height, height)
        clipper = imgui.ListClipper()
        clipper.begin(count, height)
        while clipper.step():
            for row in range(clipper.display_start, clipper.display_end):
                entry = palette.known[palette.shown[row]]
                if _draw_row(state, entry, row, row == palette.row):
                    chosen = entry
    imgui.end_child()
    return chosen


def _reveal(top: float, height: float) -> None:
    """Scroll to make a row visible."""
    first, room = imgui.get_scroll_y(), imgui.get_window_height()
    if top < first:
        imgui.set_scroll_y(top)
    elif top + height > first + room:
        imgui.set_scroll_y(top + height - room)


def _draw_row(state: AppState, entry: Entry, row: int, is_chosen: bool) -> bool:
    """Draw an entry with its kind, and its key or reason; return whether it was clicked."""
    start, room = imgui.get_cursor_pos_x(), imgui.get_content_region_avail().x
    flags = imgui.SelectableFlags_.disabled if entry.why else imgui.SelectableFlags_.none
    clicked = imgui.selectable(f"{entry.text}##row{row}", is_chosen, flags)[0]
    note_item(state, f"palette {row}")
    note = entry.why or entry.kind
    key = "" if entry.why else entry.key
    right = start + room - 0.3 * imgui.get_font_size()
    if key:
        right -= imgui.calc_text_size(key).x
        imgui.same_line(right)
        imgui.text_colored(ink(_KEY_COLOR), key)
        right -= imgui.get_font_size()
    left = right - imgui.calc_text_size(note).x
    if left > start + imgui.calc_text_size(entry.text).x + imgui.get_font_size():
        imgui.same_line(left)
        imgui.text_disabled(note)
    return bool(clicked)
