"""Limits of the translations that a motion may contain.

Single precision has 24 bits: at 1e9 units, any body is drawn as a single point, and beyond 1e19,
the squares in lengths overflow. Recordings stay within a kilometre, 1e6 millimetres; a much larger
translation is an error in the file. The same limit applies to calibrated cameras and to the
translation of a pose. It does not limit the size of a mesh or skeleton.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from viewer.diagnostics import Phrase
from viewer.phrases import rounded
from viewer.rigs.arrays import Bools

FARTHEST = 1e9
"""Largest translation along an axis, in units of the file."""


def is_beyond(translations: NDArray[np.floating]) -> Bools:
    """Return a mask of rows of (N, …) translations beyond the limit; NaN is not beyond it."""
    rows = translations.reshape(len(translations), -1)
    low, high = rows.min(initial=0.0), rows.max(initial=0.0)
    if low >= -FARTHEST and high <= FARTHEST:  # this is true for nearly all motions
        return np.zeros(len(rows), dtype=np.bool_)
    return np.asarray((np.abs(rows) > FARTHEST).any(axis=1))


def within_text(found: float, limit: float = FARTHEST) -> Phrase:
    """Return the phrase "expected …, found …" for a number that is too large or not finite."""
    if not np.isfinite(found):
        return Phrase("expected finite numbers, found {found:g}", found=float(found))
    return Phrase(
        "expected numbers within ±{limit}, found {found:g}",
        limit=rounded(limit, 2),
        found=float(found),
    )
