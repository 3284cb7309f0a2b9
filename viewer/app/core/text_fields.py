"""Fields for text and typed numbers that behave as in other desktop software.

ImGui provides selection, clipboard, undo within a field, and Tab between fields. In this module,
fields also select their content when they get the focus, Escape restores the old value, and numbers
may be calculations with a unit.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable
from pathlib import PurePath

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.core.theme import WARNING, text_color
from viewer.phrases import printable

_FLAGS = imgui.InputTextFlags_
_EXPECTED = "expected a number, such as 1.5 or 90/2"
_DEGREE = "\N{DEGREE SIGN}"
_FACTORS = {
    _DEGREE: {_DEGREE: 1.0, "deg": 1.0, "rad": math.degrees(1.0)},
    "rad": {"rad": 1.0, _DEGREE: math.radians(1.0), "deg": math.radians(1.0)},
    "s": {"s": 1.0, "ms": 1e-3, "min": 60.0},
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "cm": {"cm": 1.0, "m": 100.0, "mm": 0.1},
    "mm": {"mm": 1.0, "m": 1e3, "cm": 10.0},
}
"""Units that may be typed: maps a field's unit to the factors of other units."""
_OPERATIONS: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
_SIGNS: dict[type[ast.unaryop], float] = {ast.UAdd: 1.0, ast.USub: -1.0}
_FORMAT = re.compile(r"%[0-9.+-]*[defgi]")
_UNIT = re.compile(rf"([^\W\d_]+|{_DEGREE}|%)\s*$")
_LARGEST = 3.4e38  # largest float32 value
_LONGEST = 100  # maximum number of characters of a number typed by hand


def text_field(hidden: str, text: str, hint: str = "", flags: int = 0) -> tuple[bool, str]:
    """Draw a text field that selects its text on focus; return whether it changed, and the text.

    With ``enter_returns_true`` among the flags, a change means that Enter was pressed.
    """
    flags |= _FLAGS.auto_select_all
    return imgui.input_text_with_hint(hidden, hint, text, flags)


def search_field(hidden: str, text: str, hint: str) -> str:
    """Draw a search field, which is cleared by Escape, and return its text."""
    return imgui.input_text_with_hint(hidden, hint, text, _FLAGS.escape_clears_all)[1]


def name_field(hidden: str, name: str, hint: str) -> tuple[bool, str]:
    """Draw a field for a file name, selected up to its suffix; return whether Enter was pressed."""
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
    """
    unit = unit_of(text)
    wrong = _mistake(hidden, unit)
    shown = text % value if _FORMAT.search(text) else text  # or a word for a special value
    with text_color(WARNING if wrong else None):
        typed = imgui.input_text(hidden, shown, _FLAGS.auto_select_all)[1]
    if wrong:
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        imgui.set_next_window_pos((low.x, high.y + imgui.get_style().item_spacing.y))
        imgui.begin_tooltip()
        imgui.text_unformatted(wrong)
        imgui.end_tooltip()
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
    """Return whether a slider's number is being typed, or was until the previous frame."""
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


def unit_of(text: str) -> str:
    """Return the unit in the format of a field.

    >>> unit_of("%.1f s"), unit_of("%.1f %%"), unit_of("no limit")
    ('s', '%', '')
    """
    _, *after = _FORMAT.split(text)
    return after[-1].replace("%%", "%").strip() if after else ""


def read_number(text: str, unit: str = "") -> float:
    """Return a typed number in the unit of its field; ``ValueError`` if it is none.

    ``text``: a number or a calculation with ``+ - * / ( )`` and ``pi``, and optionally a unit that
    fits the field's. A comma may be used as the decimal point.

    >>> read_number("90/2"), read_number("-(1 + 2) * .5"), read_number("1,5 s", "s")
    (45.0, -1.5, 1.5)
    >>> read_number("pi rad", "°")
    180.0
    >>> read_number("2 m", "s")
    Traceback (most recent call last):
    ValueError: unknown unit m: expected s
    """
    text, factor = _without_unit(text.strip(), unit)
    if text.count(",") == 1 and "." not in text:
        text = text.replace(",", ".")
    if len(text) > _LONGEST:
        raise ValueError(_EXPECTED)
    try:
        value = factor * _value(ast.parse(text, mode="eval").body)
    except ZeroDivisionError:
        raise ValueError("the result of a division by 0 is undefined") from None
    except (SyntaxError, OverflowError, RecursionError, MemoryError):
        raise ValueError(_EXPECTED) from None
    if not abs(value) < _LARGEST:
        raise ValueError("this number is too large")
    return value


def _without_unit(text: str, unit: str) -> tuple[str, float]:
    """Return the text without its unit, and the factor from that unit to the field's unit."""
    found = _UNIT.search(text)
    if found is None or found.group(1) == "pi":
        return text, 1.0
    name = found.group(1)
    known = _FACTORS.get(unit, {unit: 1.0} if unit else {})
    if name not in known:
        if not text[: found.start()].strip():
            raise ValueError(_EXPECTED)
        expected = f"expected {unit}" if unit else "this field has no unit"
        raise ValueError(f"unknown unit {name}: {expected}")
    return text[: found.start()], known[name]


def _value(node: ast.expr) -> float:
    """Return the value of a calculation."""
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return float(node.value)
    if isinstance(node, ast.Name) and node.id == "pi":
        return math.pi
    if isinstance(node, ast.UnaryOp) and type(node.op) in _SIGNS:
        return _SIGNS[type(node.op)] * _value(node.operand)
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATIONS:
        return _OPERATIONS[type(node.op)](_value(node.left), _value(node.right))
    raise ValueError(_EXPECTED)
