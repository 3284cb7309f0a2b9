"""Frames on a timeline: which stored row each frame has, and which frames are missing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from viewer.errors import RigError
from viewer.rig.arrays import Bools, Floats, Ints, frozen

__all__ = ["FASTEST", "RATES", "SLOWEST", "Timing", "is_rate"]

SLOWEST, FASTEST = 1e-6, 1e6
"""Frames a second: with fewer or more, times of long motions have no exact numbers."""

RATES = f"{SLOWEST:g} to {FASTEST:,.0f} frames a second"
"""The same, for messages."""

_ON_FRAME = 1e-6  # of a frame: nearer than this to a frame is that frame


def is_rate(rate: float) -> bool:
    """Return whether a motion can have so many frames a second.

    >>> is_rate(29.97), is_rate(1e-320), is_rate(float("nan"))
    (True, False, False)
    """
    return SLOWEST <= rate <= FASTEST


@dataclass(frozen=True, slots=True, eq=False)
class Timing:
    """A fixed frame rate, and where the data of each frame is.

    Attributes
    ----------
    frame_rate : float
        Frames a second.
    rows : (F,) int32
        Row of each frame in the data, -1 for a missing one.
    first_frame : int
        What the file calls the first frame.
    start : float
        Seconds of the first frame.
    holds : bool
        Before the first and after the last frame: True holds those, False is absence.
    """

    frame_rate: float
    rows: Ints
    first_frame: int = 0
    start: float = 0.0
    holds: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "rows", frozen("rows", self.rows, (None,), np.int32))
        if not is_rate(self.frame_rate):
            raise RigError(f"frame rate: expected {RATES}, found {self.frame_rate:g}")

    @property
    def n_frames(self) -> int:
        """Number of frames, gaps included, F."""
        return len(self.rows)

    @property
    def end(self) -> float:
        """Seconds of the last frame."""
        return self.start + max(self.n_frames - 1, 0) / self.frame_rate

    @property
    def present(self) -> Bools:
        """Which frames are there: (F,)."""
        return self.rows >= 0

    def time(self, frame: int) -> float:
        """Return the seconds of a frame, counted from 0."""
        return self.start + frame / self.frame_rate

    def locate(self, times: Floats, fill: bool = False) -> tuple[Ints, Ints, Floats]:
        """Return between which rows times lie.

        Parameters
        ----------
        times : (T,)
            Seconds.
        fill : bool
            Bridge gaps between the frames on both sides, and hold the ends.

        Returns
        -------
        before, after : (T,)
            Rows; -1 in both where nothing is.
        share : (T,)
            0 at ``before``, 1 at ``after``. On a frame it is exactly 0.
        """
        times = np.atleast_1d(np.asarray(times, dtype=np.float64))
        nothing = np.full(len(times), -1, dtype=np.int32)
        if not self.n_frames or not self.present.any():
            return nothing, nothing, np.zeros(len(times))
        place = (times - self.start) * self.frame_rate
        nearest = np.round(place)
        place = np.where(np.abs(place - nearest) < _ON_FRAME, nearest, place)
        outside = (place < 0.0) | (place > self.n_frames - 1)
        place = np.clip(place, 0.0, self.n_frames - 1)
        frame = np.floor(place).astype(np.int32)
        following = np.minimum(frame + 1, self.n_frames - 1)
        share = place - frame
        if fill:
            return self._bridged(place)
        before, after = self.rows[frame], self.rows[following]
        # A frame lasts until the next one is due; one that follows a gap comes no earlier.
        share = np.where(after < 0, 0.0, share)
        after = np.where(after < 0, before, after)
        absent = (before < 0) | (outside & (not self.holds))
        return (
            np.where(absent, -1, before).astype(np.int32),
            np.where(absent, -1, after).astype(np.int32),
            np.where(absent, 0.0, share),
        )

    def _bridged(self, place: Floats) -> tuple[Ints, Ints, Floats]:
        there = np.flatnonzero(self.present)
        right = np.searchsorted(there, place, side="right")
        left = np.clip(right - 1, 0, len(there) - 1)
        right = np.clip(right, 0, len(there) - 1)
        span = there[right] - there[left]
        share = np.divide(place - there[left], span, out=np.zeros(len(place)), where=span > 0).clip(
            0.0, 1.0
        )
        return self.rows[there[left]], self.rows[there[right]], share
