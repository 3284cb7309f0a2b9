"""Checks of the arguments of public functions: other types are errors that say what is expected."""

from __future__ import annotations

from numbers import Real
from types import NoneType

from viewer.errors import RigError


def check_type(name: str, value: object, *kinds: type) -> None:
    """Raise ``RigError`` if an argument has none of some types; ``float`` stands for any number."""
    allowed = tuple(Real if kind is float else kind for kind in kinds)
    if isinstance(value, allowed):
        return
    named = [type_name(kind) for kind in kinds]
    raise RigError(f"{name}: expected {' or '.join(named)}, found {type(value).__name__}")


def type_name(kind: type) -> str:
    """Return what an error says about a type that is expected."""
    return _NAMES.get(kind, kind.__name__)


_NAMES: dict[type, str] = {
    float: "a number",
    int: "an integer",
    str: "a text",
    bool: "True or False",
    range: "a range such as range(10)",
    NoneType: "None",
}
