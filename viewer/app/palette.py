"""Window of the command palette: a text box, and the entries that match it.

The palette of imgui-bundle matches the letters of a query in order, so it does not find "Front
view" for "view front", or left_knee for "knee left"; it shows neither kinds, keys nor reasons.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.core.theme import ink
from viewer.app.core.widgets import note_item, overlay_rect, pressed_step, visible_rows
from viewer.data_classes import dataclass

_WIDTH, _ROWS = 34.0, 12  # in font sizes; maximum number of rows without scrolling
_TOP = 0.14  # upper edge, as a fraction of the window's height
_KEY_COLOR = (1.0, 0.78, 0.45, 1.0)
_K = imgui.Key
_START, _INSIDE, _SCATTERED = 100.0, 60.0, 20.0
_BOUNDARIES = " _-.:/#("


@dataclass(slots=True)
class Palette:
    """State of the palette."""

    is_open: bool = False
    """Whether it is shown."""
    has_focus: bool = False
    """Whether its text box has had the focus since it was opened."""
    query: str = ""
    """Typed text."""
    row: int = 0
    """Highlighted row."""
    known: list[Entry] = field(default_factory=list)
    """Entries of the scene for which it was opened."""
    shown: list[int] = field(default_factory=list)
    """Indices of matching entries, best first."""
    matched: str | None = None
    """Query that these entries match."""


@dataclass(frozen=True, slots=True)
class Entry:
    """An entry that can be found and run."""

    text: str
    """Name of the entry."""
    kind: str
    """Category in one word."""
    run: Callable[[AppState], object]
    """Called with the state."""
    key: str = ""
    """Keyboard shortcut; empty for none."""
    why: str = ""
    """Reason why the entry cannot be run now; empty if it can."""


def toggle_palette(state: AppState) -> None:
    """Open the palette with an empty query, or close it."""
    is_open = state.of(Palette).is_open
    state.put(Palette(is_open=not is_open))


def draw_palette(state: AppState, entries: Callable[[AppState], list[Entry]]) -> None:
    """Draw the palette if it is open; run the chosen one of its entries after it has closed."""
    palette = state.of(Palette)
    if not palette.is_open:
        return
    palette.known = palette.known or entries(state)
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
    # Letters go to the text box, but not the keys that close the palette.
    is_closed = imgui.get_io().key_ctrl and imgui.is_key_pressed(_K.p, False)
    if is_left or is_closed or imgui.is_key_pressed(_K.escape, False):
        state.put(Palette())
    elif chosen is not None and not chosen.why:
        state.put(Palette())
        chosen.run(state)


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
        # Letters may be typed before the text box accepts input, as on a slow machine.
        palette.query += letters
        editing = imgui.internal.get_input_text_state(imgui.get_item_id())
        if imgui.is_item_activated() and editing is not None:
            # The text box discards the letters of the frame in which it gets the focus.
            editing.reload_user_buf_and_move_to_end()
    palette.has_focus |= imgui.is_item_active()
    if palette.query != palette.matched:
        palette.shown = ranked(palette.query, [entry.text for entry in palette.known])
        palette.matched, palette.row = palette.query, 0
    moved = _move(palette)
    chosen = _draw_rows(state, palette, moved)
    if imgui.is_key_pressed(_K.enter, False) or imgui.is_key_pressed(_K.keypad_enter, False):
        return palette.known[palette.shown[palette.row]] if palette.shown else None
    return chosen


def _move(palette: Palette) -> bool:
    """Move the highlight with the arrow keys, wrapping at the ends; return whether it moved."""
    count = len(palette.shown)
    step = pressed_step(_ROWS)
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
            top = palette.row * height
            first, room = imgui.get_scroll_y(), imgui.get_window_height()
            if top < first:
                imgui.set_scroll_y(top)
            elif top + height > first + room:
                imgui.set_scroll_y(top + height - room)
        for row in visible_rows(count, height):
            entry = palette.known[palette.shown[row]]
            if _draw_row(state, entry, row, row == palette.row):
                chosen = entry
    imgui.end_child()
    return chosen


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


def score(query: str, name: str) -> float:
    """Return how well a name matches a query: higher is better, negative for no match.

    Every word of the query must match: best at the start of a word in the name, next best inside a
    word, otherwise as a sequence of letters. For ties, the shorter name comes first.
    """
    lower, total = name.lower(), 0.0
    for word in query.lower().split():
        found = _score_word(word, lower)
        if found < 0.0:
            return -1.0
        total += found
    return total + 10.0 / (10.0 + len(name))


def _score_word(word: str, name: str) -> float:
    """Return the score of one word; negative if the name lacks its letters in this order."""
    place = name.find(word)
    while place > 0 and name[place - 1] not in _BOUNDARIES:
        following = name.find(word, place + 1)
        if following < 0:
            return _INSIDE - min(place, 20)
        place = following
    if place >= 0:
        return _START - min(place, 20)
    # Scattered letters: starts of words and runs count more.
    points = _walk(word, name, True)
    points = _walk(word, name, False) if points < 0 else points
    return -1.0 if points < 0 else _SCATTERED * points / (2.0 * len(word))


def _walk(word: str, name: str, prefers_starts: bool) -> int:
    """Return the score of letters found in order, from left to right; -1 if one is missing."""
    points, last = 0, -1
    for letter in word:
        places = [place for place in range(last + 1, len(name)) if name[place] == letter]
        if not places:
            return -1
        starts = [place for place in places if place == 0 or name[place - 1] in _BOUNDARIES]
        if places[0] != last + 1 and prefers_starts and starts:
            last, points = starts[0], points + 2
        else:
            points += int(places[0] == last + 1)
            last = places[0]
    return points


def ranked(query: str, names: Sequence[str]) -> list[int]:
    """Return the indices of matching names, best first; ties keep their order."""
    scores = [score(query, name) for name in names]
    return sorted(
        (index for index, value in enumerate(scores) if value >= 0.0),
        key=lambda index: (-scores[index], index),
    )
