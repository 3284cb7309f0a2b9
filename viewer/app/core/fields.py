"""Labelled fields: a label to the left of each widget, and sliders that do not cover their number.

The position of a slider is shown by a track along its lower edge, so that no handle covers the
number.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TypeVar

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.core.text_fields import is_typed_in_place, number_field, unit_of
from viewer.rigs.number_text import number_text

Number = TypeVar("Number", int, float)

_COLUMN, _WIDEST = 0.4, 8.5
"""Width of the labels: fraction of the panel's width, and maximum in font sizes."""
_TRACK, _KNOB = 0.14, (0.4, 0.3)
"""Height of the track, width and height of the knob, in font sizes."""
_CLEAR = (0.0, 0.0, 0.0, 0.0)
_CLAMP = int(imgui.SliderFlags_.always_clamp)
_LOGARITHMIC = int(imgui.SliderFlags_.logarithmic)


def begin_field(label: str, width: float = 0.0, column: float = 0.0, needs: float = 0.0) -> str:
    """Draw the label of the next widget, and return the widget's own label, which is hidden.

    ``label`` may end with an ID after ``##`` or ``###``, as in ImGui. A widget with a ``width``,
    in font sizes, directly follows its label; with 0 it is aligned with those above and below and
    fills the line. ``column``: width of the label, for rows of one line; by default, it depends on
    the panel's width, and a longer label is placed above its widget.
    """
    text = label.partition("##")[0]
    hidden = label[label.index("###") :] if "###" in label else f"##{label}"
    letter = imgui.get_font_size()
    if not text:
        imgui.set_next_item_width(width * letter or -1.0)
        return hidden
    imgui.align_text_to_frame_padding()
    if width:
        imgui.text_unformatted(text)
        imgui.same_line(0.0, imgui.get_style().item_inner_spacing.x)
        imgui.set_next_item_width(width * letter)
        return hidden
    left, room = imgui.get_cursor_pos_x(), imgui.get_content_region_avail().x
    reserved = column or min(_COLUMN * room, _WIDEST * letter)
    length, gap = imgui.calc_text_size(text).x, imgui.get_style().item_inner_spacing.x
    if not column:
        reserved = max(min(reserved, room - gap - needs), min(length, room - gap - needs))
    imgui.text_unformatted(text)
    if column or length <= reserved:
        imgui.same_line()
        imgui.set_cursor_pos_x(left + reserved + gap)
    imgui.set_next_item_width(-1.0)
    return hidden


def slider_float(
    state: AppState,
    label: str,
    value: float,
    low: float,
    high: float,
    text: str = "%.2f",
    flags: int = 0,
) -> tuple[bool, float]:
    """Draw a slider with a hidden label; return whether it was moved, and its value."""
    if is_typed_in_place(label):
        return _typed(state, label, value, (low, high), text, flags)
    with _Track(bool(flags & _LOGARITHMIC)) as track:
        changed, moved = imgui.slider_float(label, value, low, high, text, flags)
        track.draw(moved, low, high)
    return changed, moved


def slider_int(
    state: AppState, label: str, value: int, low: int, high: int, text: str = "%d", flags: int = 0
) -> tuple[bool, int]:
    """Draw a slider of whole numbers; see ``slider_float``."""
    if is_typed_in_place(label):
        changed, typed = _typed(state, label, value, (low, high), text, flags, is_whole=True)
        return changed, round(typed)
    with _Track(False) as track:
        changed, moved = imgui.slider_int(label, value, low, high, text, flags)
        track.draw(moved, low, high)
    return changed, moved


def drag_float(
    state: AppState, label: str, value: float, speed: float, text: str, low: float = -math.inf
) -> tuple[bool, float]:
    """Draw a number that is dragged, by ``speed`` per pixel, or typed; see ``slider_float``."""
    if is_typed_in_place(label):
        return _typed(state, label, value, (low, math.inf), text, _CLAMP)
    changed, moved = imgui.drag_float(label, value, speed, 0.0, 0.0, text)
    _show_that_it_drags()
    return changed, max(moved, low)


def drag_int(
    state: AppState, label: str, value: int, limits: tuple[int, int], speed: float = 0.3
) -> tuple[bool, int]:
    """Draw a whole number that is changed by dragging it; see ``drag_float``."""
    if is_typed_in_place(label):
        changed, typed = _typed(state, label, value, limits, "%d", _CLAMP, is_whole=True)
        return changed, round(typed)
    changed, moved = imgui.drag_int(label, value, speed, *limits, "%d", _CLAMP)
    _show_that_it_drags()
    return changed, moved


def in_row(hidden: str, values: Sequence[Number], draw: Callable[[str, Number], None]) -> None:
    """Draw several fields of equal widths in the space of one; they count as one item."""
    gap = imgui.get_style().item_inner_spacing.x
    room = imgui.calc_item_width() - (len(values) - 1) * gap
    imgui.begin_group()
    for number, value in enumerate(values):
        if number:
            imgui.same_line(0.0, gap)
        imgui.set_next_item_width(room / len(values))
        draw(f"{hidden} {number}", value)
    imgui.end_group()


def _typed(
    state: AppState,
    label: str,
    value: float,
    limits: tuple[float, float],
    text: str,
    flags: int,
    is_whole: bool = False,
) -> tuple[bool, float]:
    """Draw a slider's number as a text field; return whether it was changed, and the number."""
    number = number_field(state, label, value, text, is_whole)
    if number is None:
        return False, value
    low, high = limits
    if not flags & _CLAMP or low <= number <= high:
        return True, number
    limit = min(max(number, low), high)
    state.say_status(f"limited to {number_text(limit)}{unit_of(text)}")
    return True, limit


def _show_that_it_drags() -> None:
    """Show the cursor for dragging sideways over the item drawn last."""
    if imgui.is_item_hovered() or imgui.is_item_active():
        imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew)


class _Track:
    """Hides ImGui's handle, and draws a track at the lower edge of the slider."""

    def __init__(self, is_logarithmic: bool) -> None:
        self._is_logarithmic = is_logarithmic

    def __enter__(self) -> _Track:
        quiet, strong = imgui.Col_.slider_grab, imgui.Col_.slider_grab_active
        self._quiet, self._strong = imgui.get_color_u32(quiet), imgui.get_color_u32(strong)
        imgui.push_style_color(quiet, _CLEAR)
        imgui.push_style_color(strong, _CLEAR)
        return self

    def __exit__(self, *_: object) -> None:
        imgui.pop_style_color(2)

    def draw(self, value: float, low: float, high: float) -> None:
        """Draw the track of the last slider: filled from 0 if possible, or from the left end."""
        if imgui.internal.temp_input_is_active(imgui.get_item_id()) or low == high:
            return
        start, end = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        letter, grab = imgui.get_font_size(), imgui.get_style().grab_min_size
        # ImGui moves the centre of its handle between these positions.
        left, right = start.x + 2.0 + 0.5 * grab, end.x - 2.0 - 0.5 * grab
        zero, is_log = min(max(0.0, low), high), self._is_logarithmic
        at = left + _fraction(value, low, high, is_log) * (right - left)
        origin = left + _fraction(zero, low, high, is_log) * (right - left)
        is_active = imgui.is_item_active() or imgui.is_item_hovered()
        color = self._strong if is_active else self._quiet
        ink = imgui.get_window_draw_list()
        top = end.y - max(_TRACK * letter, 2.0)
        ink.add_rect_filled((min(at, origin), top), (max(at, origin), end.y), color)
        half = 0.5 * _KNOB[0] * letter
        high_end = end.y - _KNOB[1] * letter
        ink.add_rect_filled((at - half, high_end), (at + half, end.y), color, 2.0)


def _fraction(value: float, low: float, high: float, is_logarithmic: bool) -> float:
    """Return the position of a value between the ends of a slider, 0 to 1."""
    if is_logarithmic and 0.0 < low < high:
        part = math.log(max(value, low) / low) / math.log(high / low)
    else:
        part = (value - low) / (high - low)
    return min(max(part, 0.0), 1.0)
