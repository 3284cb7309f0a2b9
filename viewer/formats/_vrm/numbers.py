"""Numbers and vectors in parsed JSON, None if they are invalid."""

from __future__ import annotations

from typing import Any

import numpy as np

from viewer.rig.arrays import Floats

__all__ = ["rows_of", "value_of"]

_LARGEST = 1e6


def value_of(told: Any, default: float) -> float | None:
    """Return a number; the default if it is missing, None if it is invalid.

    >>> value_of(None, 2.0), value_of(1, 2.0), value_of("a", 2.0)
    (2.0, 1.0, None)
    >>> value_of(10**400, 2.0), value_of(float("nan"), 2.0)
    (None, None)
    """
    if told is None:
        return default
    is_number = isinstance(told, int | float) and not isinstance(told, bool)
    # Numbers far outside a plausible range would overflow in products.
    return float(told) if is_number and abs(told) < _LARGEST else None


def rows_of(told: Any, default: tuple[float, ...]) -> Floats | None:
    """Return a vector with as many numbers as the default; None if it is invalid."""
    if told is None:
        return np.array(default)
    if not isinstance(told, list) or len(told) != len(default):
        return None
    values = [value_of(each, 0.0) for each in told]
    return None if None in values else np.array(values, dtype=np.float64)
