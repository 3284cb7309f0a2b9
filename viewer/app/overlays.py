"""Overlays of the view: progress, messages, the list of keys, and hints in a corner.

They do not overlap: the colour legend is at the top left, the progress bar at the top, next to it
or below it, and messages are stacked upwards from the bottom if there is room.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.core.theme import ink
from viewer.app.core.widgets import KeyNames, Rect, begin_overlay, button, key_name, overlay_rect
from viewer.app.features import KEYS, MOUSE
from viewer.app.files.files import Files
from viewer.app.keys import Keyboard, cancel
from viewer.app.posing.toolbar import draw_toolbar
from viewer.app.view.axis_gizmo import gizmo_rect
from viewer.app.weights.legend import draw_legend
from viewer.app.weights.vertex_panel import draw_hover_text
from viewer.phrases import printable
from viewer.rendering.passes.ground_pass import grid_step
from viewer.rigs.scene import scene_unit

_SHOW_PROGRESS_AFTER = 0.3  # seconds before the progress bar appears
_BAR_WIDTH = 52.0 / 3.0  # width of the progress bar, in font sizes
_GAP = 10.0  # points from the edges of the view
_BETWEEN = 6.0  # points between two overlays
_MOST_HEIGHT = 1.0 / 3.0  # maximum fraction of the view's height for several messages
_BESIDE = 0.6  # minimum fraction of the view's width for messages next to the hints
_MOST_NOTES = 8
_LONGEST_NOTE = 400  # maximum length of a message in characters
_COLOR = (1.0, 0.78, 0.45, 1.0)  # colour of the keys
_OPACITY = 0.97  # text behind the list must not show through
_KEYS_GAP, _COLUMNS_GAP = 1.5, 3.0  # from a key to its text, between columns, in font sizes


class _Progress(NamedTuple):
    """Progress of a job; a negative fraction means an indeterminate bar."""

    title: str
    fraction: float
    text: str
    label: str
    is_aside: bool = False


class _Columns(NamedTuple):
    """Number of columns, number of rows, and whether the whole list fits."""

    number: int
    rows: int
    fits: bool


def draw_overlays(state: AppState) -> None:
    """Draw all overlays except the hints, which are drawn behind the panels."""
    legend = draw_legend(state)
    tools = draw_toolbar(state, legend)
    progress = _draw_progress(state, legend, tools)
    _draw_notes(state, [rect for rect in (legend, tools, progress) if rect is not None])
    draw_hover_text(state)
    _draw_keys(state)


def draw_hints(state: AppState) -> None:
    """Draw hints about grid and keys behind the panels, over the image of the scene."""
    text, place = _hint(state)
    draw_list = imgui.get_background_draw_list()
    shadow, color = imgui.get_color_u32((0, 0, 0, 0.5)), imgui.get_color_u32((1, 1, 1, 0.85))
    draw_list.add_text((place[0] + 1, place[1] + 1), shadow, text)
    draw_list.add_text(place, color, text)


def hint_rect(state: AppState) -> Rect:
    """Return the rectangle of the hints, window coordinates."""
    text, (x, y) = _hint(state)
    size = imgui.calc_text_size(text)
    return x, y, x + size.x, y + size.y


def _hint(state: AppState) -> tuple[str, tuple[float, float]]:
    """Return the text of the hints, and its upper left corner."""
    x, y, width, height = state.view_rect
    step = grid_step(state.box)
    unit = scene_unit(state.scene) or f"unit{'s' * (step != 1.0)}"
    grid = f"grid {step:g} {unit}   " if state.options.grid else ""
    text = f"{grid}{key_name(state, 'H or ?')} keys"
    size = imgui.calc_text_size(text)
    one = imgui.get_style().font_scale_dpi
    return text, (x + width - size.x - _GAP * one, y + height - size.y - 0.8 * _GAP * one)


def _progress(state: AppState) -> _Progress | None:
    """Return the progress of the current job, if there is one."""
    loader, stream, job = state.of(Files).loader, state.of(Files).stream, state.job
    label = "Cancel"
    if loader is not None and not loader.is_done and loader.seconds >= _SHOW_PROGRESS_AFTER:
        job, label = loader, "Cancel opening"
    elif stream is not None:
        job, label = stream, "Cancel reading" if stream.progress[2] else "Cancel"
    if job is None:
        return None
    if job.is_cancelled:
        return _Progress(f"Cancelling: {job.title}", -imgui.get_time(), "", "")
    return _Progress(job.title, job.fraction, job.text, label, job is stream)


def _draw_progress(state: AppState, legend: Rect | None, tools: Rect | None) -> Rect | None:
    """Draw the progress bar; return its rectangle."""
    shown = _progress(state)
    if shown is None:
        return None
    x, y, width, _ = state.view_rect
    bar = max(min(_BAR_WIDTH * imgui.get_font_size(), width - 4 * _GAP), 60.0)
    whole = bar + 2.0 * imgui.get_style().window_padding.x
    left = x + (width - whole - _GAP if shown.is_aside else 0.5 * (width - whole))
    top = y + _GAP
    if legend is not None and left < legend[2] + _BETWEEN:
        top = legend[3] + _BETWEEN
    if tools is not None and left + whole > tools[0] - _BETWEEN:
        top = max(top, tools[3] + _BETWEEN)
    imgui.set_next_window_pos((left, top), imgui.Cond_.always)
    flags = imgui.WindowFlags_.no_decoration | imgui.WindowFlags_.always_auto_resize
    flags |= imgui.WindowFlags_.no_docking | imgui.WindowFlags_.no_saved_settings
    flags |= imgui.WindowFlags_.no_focus_on_appearing
    if imgui.begin("##progress", None, flags)[0]:
        imgui.push_text_wrap_pos(imgui.get_cursor_pos_x() + bar)
        imgui.text_unformatted(shown.title)
        imgui.pop_text_wrap_pos()
        imgui.progress_bar(shown.fraction, (bar, 0.0), shown.text)
        if shown.label and button(state, shown.label):
            cancel(state)
    rect = overlay_rect(state, "##progress")
    imgui.end()
    return rect


def _draw_notes(state: AppState, above: Sequence[Rect]) -> None:
    """Draw the newest messages that fit, and the number of hidden ones."""
    state.messages.drop_old()
    x, y, width, height = state.view_rect
    if not state.messages.notes or width <= 40:
        return
    style = imgui.get_style()
    # Messages end next to the hints, or above them.
    hint, gizmo, bottom = hint_rect(state), gizmo_rect(state), y + height - _GAP
    right = min(hint[0], hint[0] if gizmo is None else gizmo[0]) - _BETWEEN
    if right - x <= _BESIDE * width:
        right, bottom = x + width - _GAP, hint[1] - _BETWEEN
    wrap = max(right - x - _GAP - 2.0 * style.window_padding.x, 50.0)
    texts = [printable(note.text, _LONGEST_NOTE) for note in state.messages.notes]
    line = imgui.get_text_line_height_with_spacing()
    heights = [imgui.calc_text_size(text, False, wrap).y + style.item_spacing.y for text in texts]
    top = max((rect[3] + _BETWEEN for rect in above), default=y + _GAP)
    room = bottom - top - 2.0 * style.window_padding.y + style.item_spacing.y
    count = n_newest(heights, line, min(room, _MOST_HEIGHT * height))
    # A long message may cover more of the view, but only a single one.
    count = count or min(n_newest(heights, line, room), 1)
    if not count and not above:
        count = 1  # a clipped message is better than none
    if not count and room < line:
        return
    if begin_overlay("##notes", x + _GAP, bottom, (0.0, 1.0)):
        imgui.push_text_wrap_pos(imgui.get_cursor_pos_x() + wrap)
        for text in texts[len(texts) - count :]:
            imgui.text_unformatted(text)
        left = len(texts) - count
        if left:
            hidden = f"and {left:,} more" if count else f"{left:,} messages"
            imgui.text_disabled(f"{hidden} (Window > Messages)")
        imgui.pop_text_wrap_pos()
    overlay_rect(state, "##notes")
    imgui.end()


def n_newest(heights: Sequence[float], line: float, room: float) -> int:
    """Return how many of the latest messages fit, leaving room for a line about hidden ones."""
    count, used = 0, 0.0
    for height in reversed(heights):
        used += height
        is_last = count + 1 == len(heights)
        if count == _MOST_NOTES or used + (0.0 if is_last else line) > room:
            break
        count += 1
    return count


def _draw_keys(state: AppState) -> None:
    """Draw the list if it is open; the wheel scrolls it in a small window."""
    if not state.of(Keyboard).is_listed:
        return
    changed = state.of(KeyNames).changed
    lines = [*((changed.get(key.label, key.label), key.text) for key in KEYS), *MOUSE]
    style, viewport = imgui.get_style(), imgui.get_main_viewport()
    letter = imgui.get_font_size()
    first = max(imgui.calc_text_size(label).x for label, _ in lines) + _KEYS_GAP * letter
    column = first + max(imgui.calc_text_size(text).x for _, text in lines) + _COLUMNS_GAP * letter
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
    flags = imgui.WindowFlags_.no_title_bar | imgui.WindowFlags_.no_resize
    flags |= imgui.WindowFlags_.no_move | imgui.WindowFlags_.always_auto_resize
    flags |= imgui.WindowFlags_.no_docking | imgui.WindowFlags_.no_saved_settings
    flags |= imgui.WindowFlags_.no_focus_on_appearing | imgui.WindowFlags_.no_nav
    if columns.fits:
        flags |= imgui.WindowFlags_.no_inputs | imgui.WindowFlags_.no_scrollbar
    else:  # only a window that scrolls accepts input
        flags |= imgui.WindowFlags_.horizontal_scrollbar
    if imgui.begin("##keys", None, flags)[0]:
        left, top = imgui.get_cursor_pos()
        step = imgui.get_text_line_height_with_spacing()
        for index, (label, text) in enumerate(lines):
            at, row = divmod(index, columns.rows)
            place = left + at * column, top + row * step
            imgui.set_cursor_pos(place)
            imgui.text_colored(ink(_COLOR), label)
            imgui.set_cursor_pos((place[0] + first, place[1]))
            imgui.text_unformatted(text)
    overlay_rect(state, "##keys")
    imgui.end()


def column_layout(count: int, room: tuple[float, float], line: tuple[float, float]) -> _Columns:
    """Return the smallest number of columns that fit into the height, limited by the width."""
    wanted = -(-count // max(int(room[1] / line[1]), 1))
    number = max(min(wanted, int(room[0] / line[0])), 1)
    rows = -(-count // number)
    return _Columns(number, rows, number == wanted and number * line[0] <= room[0])
