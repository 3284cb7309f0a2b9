"""Fields for text and typed numbers that behave as in other desktop software.

ImGui provides selection, clipboard, undo within a field, and Tab between fields. In this module,
fields also select their content when they get the focus, Escape restores the old value, and numbers
may be calculations with a unit.
"""

from __future__ import annotations

from pathlib import PurePath

from imgui_bundle import imgui

from viewer.app.core.ink import WARNING, ink
from viewer.app.core.state import AppState
from viewer.app.core.typed_numbers import number_with_unit, read_number, unit_of
from viewer.phrases import printable

__all__ = [
    "is_typed_in_place",
    "name_field",
    "number_field",
    "search_field",
    "text_field",
    "whole_field",
]

_FLAGS = imgui.InputTextFlags_


def text_field(hidden: str, text: str, hint: str = "", flags: int = 0) -> tuple[bool, str]:
    """Draw a text field, whose text is selected when the field gets the focus.

    Parameters
    ----------
    hidden : str
        Hidden label, as from ``begin_field``.
    text, hint : str
        The text, and a placeholder shown in grey while it is empty.
    flags : int
        ImGui's ``InputTextFlags_``.

    Returns
    -------
    changed : bool
        Whether the text was edited, or with ``enter_returns_true`` whether Enter was pressed.
    text : str
        The text.
    """
    flags |= _FLAGS.auto_select_all
    return imgui.input_text_with_hint(hidden, hint, text, flags)


def search_field(hidden: str, text: str, hint: str) -> str:
    """Draw a search field, which is cleared by Escape, and return its text."""
    return imgui.input_text_with_hint(hidden, hint, text, _FLAGS.escape_clears_all)[1]


def name_field(hidden: str, name: str, hint: str) -> tuple[bool, str]:
    """Draw a field for a file name; all but the suffix is selected at first.

    Returns
    -------
    entered : bool
        Whether Enter was pressed.
    name : str
        The name.
    """
    name = text_field(hidden, name, hint)[1]
    editing = imgui.internal.get_input_text_state(imgui.get_item_id())
    if imgui.is_item_activated() and editing is not None:
        # The selection is counted in bytes.
        editing.set_selection(0, len(PurePath(name).stem.encode()))
    # The field also loses the focus when Escape is pressed or when something else is clicked.
    left = imgui.is_item_deactivated()
    enter = any(map(imgui.is_key_pressed, (imgui.Key.enter, imgui.Key.keypad_enter)))
    return left and enter, name


def number_field(
    state: AppState, hidden: str, value: float, text: str = "%.6g", is_whole: bool = False
) -> float | None:
    """Draw a field for a number, and return the number once it is entered.

    Enter, Tab or a click elsewhere enters the number; Escape restores the old one. Text that is not
    a number is marked while it is typed, and causes a message if it is entered.

    Parameters
    ----------
    state : AppState
        Receives the message.
    hidden : str
        Hidden label, as from ``begin_field``.
    value : float
        Number shown.
    text : str
        Format of the number, with its unit.
    is_whole : bool
        Whether the number must be a whole number.

    Returns
    -------
    float or None
        The number that was entered, if any.
    """
    unit = unit_of(text)
    wrong = _mistake(hidden, unit)
    if wrong:
        imgui.push_style_color(imgui.Col_.text, ink(WARNING))
    typed = imgui.input_text(hidden, number_with_unit(text, value), _FLAGS.auto_select_all)[1]
    if wrong:
        imgui.pop_style_color()
        _show_below(wrong)
    if not imgui.is_item_deactivated_after_edit() or imgui.is_key_pressed(imgui.Key.escape, False):
        return None
    if not typed.strip():
        return None
    try:
        number = read_number(typed, unit)
        if is_whole and number != round(number):
            raise ValueError("expected a whole number")
        return number
    except ValueError as problem:
        state.say_status(f'{problem}, found "{printable(typed.strip(), 40)}"')
        return None


def whole_field(state: AppState, hidden: str, value: int) -> int | None:
    """Draw a field for a whole number; see ``number_field``."""
    number = number_field(state, hidden, value, "%d", is_whole=True)
    return None if number is None else round(number)


def is_typed_in_place(hidden: str) -> bool:
    """Return whether a slider's number is being typed, or was until the previous frame.

    ``number_field`` with the slider's label then continues the input that ImGui began.
    """
    item = imgui.get_id(hidden)
    left: int = imgui.get_current_context().input_text_deactivated_state.id_
    return imgui.internal.temp_input_is_active(item) or left == item


def _mistake(hidden: str, unit: str) -> str:
    """Return the error in the number that is being typed; empty if there is none."""
    item = imgui.get_id(hidden)
    editing = imgui.internal.get_input_text_state(item)
    if editing is None or imgui.internal.get_active_id() != item or not editing.edited_before:
        return ""
    typed = editing.get_text().strip()
    try:
        read_number(typed or "0", unit)
    except ValueError as problem:
        return str(problem)
    return ""


def _show_below(text: str) -> None:
    """Show a message below the item drawn last."""
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    imgui.set_next_window_pos((low.x, high.y + imgui.get_style().item_spacing.y))
    imgui.begin_tooltip()
    imgui.text_unformatted(text)
    imgui.end_tooltip()
