"""Frames on a timeline: the stored row of each frame, and which frames are missing."""

from __future__ import annotations

import math

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Bools, Floats, Ints, freeze_fields

SLOWEST, FASTEST = 1e-6, 1e6
"""Limits of the frame rate, outside which the times of long motions lose precision."""

DEFAULT_RATE = 30.0
"""Frames per second of motions that have no frame rate."""

RATES = f"{SLOWEST:g} to {FASTEST:,.0f} frames per second"
"""Limits of the frame rate as text for messages."""

_ON_FRAME = 1e-6  # fraction of a frame; times this close to a frame are treated as that frame
# The same tolerance for the ends of motions, which files store as single-precision seconds.
_AT_FRAME = 1e-3


def is_rate(rate: float) -> bool:
    """Return whether a frame rate is supported: 29.97 is, 1e-320 and nan are not."""
    return SLOWEST <= rate <= FASTEST


def frame_at(seconds: float, rate: float) -> int:
    """Return the last frame that has begun at a time since frame 0.

    >>> frame_at(0.99, 10.0), frame_at(33.299999237060547, 30.0)  # the single precision of 33.3
    (9, 999)
    """
    return math.floor(seconds * rate + _AT_FRAME)


def frame_times(start: float, end: float, rate: float) -> Floats:
    """Return the times of all frames from a start to an end (F,), seconds."""
    times: Floats = start + np.arange(frame_at(end - start, rate) + 1) / rate
    # Just after its end, a repeating curve would be at its start again.
    return np.minimum(times, end)


def check_range(clip: object, name: str, start: float, end: float) -> None:
    """Make the playback range of a new clip two floats; RigError unless they are one."""
    object.__setattr__(clip, "start", float(start))
    object.__setattr__(clip, "end", float(end))
    if not (math.isfinite(start) and start <= end < math.inf):
        raise RigError(f"clip {name}: expected a range, found {float(start)} to {float(end)}")


@dataclass(frozen=True, slots=True, eq=False)
class Timing:
    """A fixed frame rate, and the data row of each frame."""

    frame_rate: float
    """Frames per second."""
    rows: Ints
    """(F,) int32. Row of each frame in the data, -1 for a missing frame."""
    first_frame: int = 0
    """Number of the first frame in the file."""
    start: float = 0.0
    """Seconds of the first frame."""
    holds: bool = True
    """Behaviour before the first and after the last frame: True holds the end frames, False means
    absent."""

    def __post_init__(self) -> None:
        freeze_fields(self, np.int32, rows=(None,))
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
    def times(self) -> Floats:
        """Seconds of all frames: (F,)."""
        return self.start + np.arange(self.n_frames) / self.frame_rate

    @property
    def present(self) -> Bools:
        """Mask of the frames that exist: (F,)."""
        return self.rows >= 0

    def time(self, frame: int) -> float:
        """Return the time in seconds of a frame, counted from 0."""
        return self.start + frame / self.frame_rate

    def locate(self, times: Floats, interpolate: bool = False) -> tuple[Ints, Ints, Floats]:
        """Return rows before and after times (T,), -1 without data, and fractions, 0 on a frame."""
        times = np.atleast_1d(np.asarray(times, dtype=np.float64))
        nothing = np.full(len(times), -1, dtype=np.int32)
        if not self.n_frames or not self.present.any():
            return nothing, nothing, np.zeros(len(times))
        place = self._places(times)
        outside = (place < 0.0) | (place > self.n_frames - 1)
        place = np.clip(place, 0.0, self.n_frames - 1)
        frame = np.floor(place).astype(np.int32)
        following = np.minimum(frame + 1, self.n_frames - 1)
        fraction = place - frame
        if interpolate:
            return self._bridged(place)
        before, after = self.rows[frame], self.rows[following]
        # The frame before a gap is held until the gap begins; the frame after it does not start
        # early.
        fraction = np.where(after < 0, 0.0, fraction)
        after = np.where(after < 0, before, after)
        absent = (before < 0) | (outside & (not self.holds))
        return (
            np.where(absent, -1, before).astype(np.int32),
            np.where(absent, -1, after).astype(np.int32),
            np.where(absent, 0.0, fraction),
        )

    def surrounds(self, times: Floats) -> Bools:
        """Return whether the frames on both sides of each time, or the frame at it, exist: (T,)."""
        if not self.n_frames:
            return np.zeros(len(times), dtype=np.bool_)
        place = np.clip(self._places(times), 0.0, self.n_frames - 1)
        before, after = np.floor(place).astype(np.int32), np.ceil(place).astype(np.int32)
        both: Bools = self.present[before] & self.present[after]
        return both

    def _places(self, times: Floats) -> Floats:
        """Return times in frames since the start; those close to a frame are at it."""
        place = (times - self.start) * self.frame_rate
        nearest = np.round(place)
        # Snapping undoes rounding in time * rate: exactly at a frame, its stored data is returned.
        return np.where(np.abs(place - nearest) < _ON_FRAME, nearest, place)

    def _bridged(self, place: Floats) -> tuple[Ints, Ints, Floats]:
        there = np.flatnonzero(self.present)
        right = np.searchsorted(there, place, side="right")
        left = np.clip(right - 1, 0, len(there) - 1)
        right = np.clip(right, 0, len(there) - 1)
        span = there[right] - there[left]
        fraction = np.divide(
            place - there[left], span, out=np.zeros(len(place)), where=span > 0
        ).clip(0.0, 1.0)
        return self.rows[there[left]], self.rows[there[right]], fraction
