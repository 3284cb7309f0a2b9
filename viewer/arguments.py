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
    named = [_NAMES.get(kind, kind.__name__) for kind in kinds]
    raise RigError(f"{name}: expected {' or '.join(named)}, found {type(value).__name__}")


_NAMES: dict[type, str] = {
    float: "a number",
    str: "a text",
    range: "a range such as range(10)",
    NoneType: "None",
}
