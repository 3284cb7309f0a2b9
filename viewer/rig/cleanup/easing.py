"""Corrections that begin and end gradually."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Bools, Floats
from viewer.rig.cleanup.frame_rows import runs_of

__all__ = ["EASE", "faded", "falling"]

EASE = 0.2
"""Seconds over which a correction begins and ends outside contacts."""


def faded(values: Floats, is_held: Bools, present: Bools, ease: int) -> Floats:
    """Return values that fade in and out around held frames; gaps separate runs.

    Parameters
    ----------
    values : (F, C)
        Corrections in held frames.
    is_held, present : (F,)
        Masks of held frames and of existing frames.
    ease : int
        Number of frames over which a correction fades.
    """
    result = values.copy()
    for start, stop in runs_of(present):
        held = np.flatnonzero(is_held[start:stop]) + start
        if len(held) == 0:
            continue
        frames = np.arange(start, stop)
        place = np.searchsorted(held, frames, side="right")
        before, after = held[np.maximum(place - 1, 0)], held[np.minimum(place, len(held) - 1)]
        left = np.where(place > 0, frames - before, ease + 1)
        right = np.where(place < len(held), after - frames, ease + 1)
        first, second = falling(left / (ease + 1)), falling(right / (ease + 1))
        # Between two close contacts, the value blends from one to the other.
        total = np.maximum(first + second, 1.0)[:, None]
        mixed = first[:, None] * values[before] + second[:, None] * values[after]
        result[start:stop] = np.where(is_held[start:stop, None], values[start:stop], mixed / total)
    return result


def falling(x: Floats) -> Floats:
    """Return a smooth step from 1 at 0 to 0 at 1 and beyond, with slope 0 at both ends."""
    x = np.clip(x, 0.0, 1.0)
    return 1.0 - x * x * (3.0 - 2.0 * x)
