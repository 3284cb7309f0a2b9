"""Access to nested properties of parsed JSON of any structure."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeGuard

import numpy as np

from viewer.rigs.arrays import Floats
from viewer.rigs.file_record import Json


def part(told: object, *names: str) -> Any:
    """Return a nested property; None if it is missing or an outer value is not an object."""
    value = told
    for name in names:
        value = value.get(name) if isinstance(value, dict) else None
    return value


def list_in(told: object, *names: str) -> list[Any]:
    """Return a nested list; an empty one if it is missing or not a list."""
    found = part(told, *names)
    return found if isinstance(found, list) else []


def objects_in(told: object, *names: str) -> Iterator[tuple[int, Json]]:
    """Yield the objects in a nested list, with their indices."""
    return ((at, each) for at, each in enumerate(list_in(told, *names)) if isinstance(each, dict))


def is_index(value: object, count: int) -> TypeGuard[int]:
    """Return whether a value is an integer from 0 to ``count - 1``."""
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < count


_LARGEST = 1e6


def value_of(told: object, default: float) -> float | None:
    """Return a number; the default if it is missing, None if it is no number below 1e6 in size."""
    if told is None:
        return default
    if not isinstance(told, int | float) or isinstance(told, bool):
        return None
    # Numbers far outside a plausible range would overflow in products.
    return float(told) if abs(told) < _LARGEST else None


def rows_of(told: object, default: tuple[float, ...]) -> Floats | None:
    """Return a vector with as many numbers as the default; None if it is invalid."""
    if told is None:
        return np.array(default)
    if not isinstance(told, list) or len(told) != len(default):
        return None
    values = [value_of(each, 0.0) for each in told]
    return None if None in values else np.array(values, dtype=np.float64)
