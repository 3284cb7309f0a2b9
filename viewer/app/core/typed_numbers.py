"""Numbers typed into fields: plain numbers, simple arithmetic, and the unit that a field shows."""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable

__all__ = ["number_with_unit", "read_number", "unit_of"]

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


def unit_of(text: str) -> str:
    """Return the unit in the format of a field.

    >>> unit_of("%.1f s"), unit_of("%.1f %%"), unit_of("no limit")
    ('s', '%', '')
    """
    _, *after = _FORMAT.split(text)
    return after[-1].replace("%%", "%").strip() if after else ""


def number_with_unit(text: str, value: float) -> str:
    """Return a number in the format of a field, which may be a word for a special value.

    >>> number_with_unit("%.1f s", 2.0), number_with_unit("no limit", 0.0)
    ('2.0 s', 'no limit')
    """
    return text % value if _FORMAT.search(text) else text


def read_number(text: str, unit: str = "") -> float:
    """Return a typed number in the unit of its field.

    Parameters
    ----------
    text : str
        A number or a calculation with ``+ - * / ( )`` and ``pi``, and optionally a unit. A comma
        may be used as the decimal point.
    unit : str
        Unit that the field shows; empty if it has none.

    Raises
    ------
    ValueError
        If the text is not a number, the number is too large, or its unit is not accepted by the
        field.

    >>> read_number("90/2"), read_number("-(1 + 2) * .5"), read_number("1,5 s", "s")
    (45.0, -1.5, 1.5)
    >>> read_number("pi rad", "\N{DEGREE SIGN}")
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
