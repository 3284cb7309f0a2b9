"""Access to nested properties of parsed JSON of any structure."""

from __future__ import annotations

from typing import Any

__all__ = ["is_index", "listed", "part"]


def part(told: Any, *names: str) -> Any:
    """Return a nested property; None if it is missing or an outer value is not an object.

    Parameters
    ----------
    told : Any
        Parsed JSON.
    *names : str
        Keys from the outside to the inside.

    >>> part({"a": {"b": 1}}, "a", "b"), part({"a": []}, "a", "b")
    (1, None)
    """
    value = told
    for name in names:
        value = value.get(name) if isinstance(value, dict) else None
    return value


def listed(told: Any, *names: str) -> list[Any]:
    """Return a nested list; an empty one if it is missing or not a list."""
    found = part(told, *names)
    return found if isinstance(found, list) else []


def is_index(value: Any, count: int) -> bool:
    """Return whether a value is an integer from 0 to ``count - 1``."""
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < count
