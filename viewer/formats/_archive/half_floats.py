"""Conversion of the half floats in archives to doubles, before anything is computed with them.

A half overflows at 65504: comparing it with a larger Python number, or adding two halves, already
causes a warning.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.rig.arrays import Deferred

__all__ = ["in_double", "widened"]


def widened(array: Deferred) -> Deferred:
    """Return an array whose values are converted by ``in_double``."""
    if array.dtype != np.float16:
        return array
    return Deferred(array.shape, np.float64, lambda: in_double(array.values()))


def in_double(values: NDArray[Any]) -> NDArray[Any]:
    """Return half floats as doubles, which is exact, and other values unchanged."""
    return values.astype(np.float64) if values.dtype == np.float16 else values
