"""Repetition of coefficients that many writers store only once per person."""

from __future__ import annotations

import numpy as np

from viewer.formats._text.numbers import LARGEST
from viewer.rig.arrays import Bools, Floats

__all__ = ["COEFFICIENTS", "hold", "last_given"]

COEFFICIENTS = ("shapes", "expression")
"""Keys of a record that later records of the same person may omit."""


def hold(rows: Floats, is_given: Bools, known: Floats | None) -> Floats:
    """Return rows with each missing row replaced by the last valid row before it.

    Parameters
    ----------
    rows : (N, C)
        Rows in time order; the content of missing rows is ignored.
    is_given : (N,) bool
        True for rows in the file. Non-finite rows are preserved, but not repeated.
    known : (C,) or None
        The last valid row before all of these; None means 0.

    Returns
    -------
    (N, C)
        ``rows`` itself if no row is missing.
    """
    if is_given.all():
        return rows
    last = _last_good(rows, is_given)
    before = np.zeros(rows.shape[1]) if known is None else known
    table = np.concatenate([rows, before[None]])
    # If there is no earlier row, the index -1 selects the row that was appended.
    return np.asarray(np.where(is_given[:, None], rows, table[last]))


def last_given(rows: Floats, is_given: Bools) -> Floats | None:
    """Return the last valid row of (N, C), or None; see ``hold`` for the arguments."""
    last = int(_last_good(rows, is_given)[-1]) if len(rows) else -1
    return rows[last].copy() if last >= 0 else None


def _last_good(rows: Floats, is_given: Bools) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Return the index of the last valid row up to each row; -1 for none."""
    is_good = is_given & (np.abs(rows) <= LARGEST).all(axis=1)
    return np.maximum.accumulate(np.where(is_good, np.arange(len(rows)), -1))
