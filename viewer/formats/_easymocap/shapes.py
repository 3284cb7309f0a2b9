"""Coefficients that many writers give once for a person: carried on from record to record."""

from __future__ import annotations

import numpy as np

from viewer.formats._numbers import LARGEST
from viewer.rig.arrays import Bools, Floats

__all__ = ["COEFFICIENTS", "carry", "last_given"]

COEFFICIENTS = ("shapes", "expression")
"""Keys of a record that later records of the same person may leave out."""


def carry(rows: Floats, is_given: Bools, known: Floats | None) -> Floats:
    """Return rows in which those that were not given repeat the last good one before them.

    Parameters
    ----------
    rows : (N, C)
        In time order; what stands in rows that were not given does not matter.
    is_given : (N,) bool
        Which rows the file has. Those that are not finite stay so, and are not repeated.
    known : (C,) or None
        The last good row before all of these; 0 if there is none.

    Returns
    -------
    (N, C)
        ``rows`` themselves if all were given.
    """
    if is_given.all():
        return rows
    last = _last_good(rows, is_given)
    before = np.zeros(rows.shape[1]) if known is None else known
    table = np.concatenate([rows, before[None]])
    # Where there is none before, the index -1 leads to the row that was put behind the others.
    return np.asarray(np.where(is_given[:, None], rows, table[last]))


def last_given(rows: Floats, is_given: Bools) -> Floats | None:
    """Return the last good row of (N, C), None if there is none; arguments as for ``carry``."""
    last = int(_last_good(rows, is_given)[-1]) if len(rows) else -1
    return rows[last].copy() if last >= 0 else None


def _last_good(rows: Floats, is_given: Bools) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Return the index of the last good row up to each row, -1 for none."""
    is_good = is_given & (np.abs(rows) <= LARGEST).all(axis=1)
    return np.maximum.accumulate(np.where(is_good, np.arange(len(rows)), -1))
