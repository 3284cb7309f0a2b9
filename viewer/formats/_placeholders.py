"""Neutral values in place of invalid ones, so that a figure with errors can be shown."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from viewer.rigs.arrays import Bools, Floats, Ints


def neutral_positions(positions: Floats, triangles: Ints) -> Floats:
    """Return positions (V, 3) with NaN vertices at the mean of their valid neighbours."""
    if not np.isnan(positions.sum()):
        # Most files have no invalid positions, so this test must be cheap.
        return positions
    bad: Bools = np.isnan(positions.sum(axis=1))
    known = positions[~bad]
    result = positions.copy()
    result[bad] = known.mean(axis=0) if len(known) else 0.0
    # Each triangle edge in both directions: (ends[i], others[i]) are neighbours.
    ends = np.concatenate([triangles, triangles[:, [1, 2, 0]]]).ravel()
    others = np.concatenate([triangles[:, [1, 2, 0]], triangles]).ravel()
    counts = ~bad[others] & bad[ends]
    ends, others = ends[counts], others[counts]
    number = np.bincount(ends, minlength=len(positions))
    sums = [np.bincount(ends, result[others, k], minlength=len(positions)) for k in range(3)]
    found = bad & (number > 0)
    result[found] = np.stack(sums, axis=1)[found] / number[found, None]
    return result


def held_rows(rows: Floats, bad: Bools) -> Floats:
    """Return rows (N, ...) of a motion; ``bad`` ones repeat the valid one before, or the first."""
    if not bad.any():
        return rows
    if bad.all():
        return np.zeros_like(rows)
    held = np.maximum.accumulate(np.where(bad, -1, np.arange(len(rows))))
    return rows[np.where(held < 0, int((~bad).argmax()), held)]


def neutral_corners(corners: NDArray[np.integer], fits: Bools) -> Ints:
    """Return triangles (T, 3) of zero area where a corner does not fit: a valid one repeated."""
    first = corners[np.arange(len(corners)), fits.argmax(axis=1)]
    usable = np.where(fits.any(axis=1), first, 0)
    return np.where(fits, corners, usable[:, None]).astype(np.int32)
