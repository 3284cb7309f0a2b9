"""Limits of the translations that a motion may contain.

Single precision holds 24 bits: at 1e9 units a body of any size is drawn as one point already, and
beyond 1e19 the squares that lengths are made of overflow. Recordings stay within kilometres, which
are 1e6 millimetres; what is further is a fault of the file. The limit is that of calibrated cameras
and of the translation of a pose. How large a mesh or skeleton itself may be is not limited by it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from viewer.diagnostics import Phrase
from viewer.rig.arrays import Bools

__all__ = ["FARTHEST", "is_beyond", "within_text"]

FARTHEST = 1e9
"""Units of the file, along an axis."""


def is_beyond(translations: NDArray[np.floating]) -> Bools:
    """Return which rows of (N, …) translations lead too far; NaN does not.

    >>> is_beyond(np.array([[0.0, 1e9], [0.0, -2e9]])).tolist()
    [False, True]
    """
    rows = translations.reshape(len(translations), -1)
    low, high = rows.min(initial=0.0), rows.max(initial=0.0)
    if low >= -FARTHEST and high <= FARTHEST:  # nearly always
        return np.zeros(len(rows), dtype=np.bool_)
    return np.asarray((np.abs(rows) > FARTHEST).any(axis=1))


def within_text(found: float, limit: float = FARTHEST) -> Phrase:
    """Return what was expected and found where a number is too large, or is none.

    >>> str(within_text(1e20)), str(within_text(float("inf")))
    ('expected numbers up to 1e+09, found 1e+20', 'expected finite numbers, found inf')
    """
    if not np.isfinite(found):
        return Phrase("not-finite", found=float(found))
    return Phrase("beyond-limit", limit=limit, found=float(found))
