"""Frames of clips: rows in the order of frames, a range of frames, another frame rate."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from viewer.errors import RigError
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.captures.points import PointClip
from viewer.rigs.motion.sampled_clip import SampledClip, with_rows
from viewer.rigs.motion.timing import Timing

Captured = SampledClip | PointClip
"""A clip of sampled frames, of joints or of points."""
_Clip = TypeVar("_Clip", bound=Captured)
_Indices = NDArray[np.intp]
_ON_FRAME = 1e-6  # tolerance, as a fraction of a frame, for times that are treated as that frame
_MOST_FRAMES = 1_000_000  # maximum number of frames: 9 hours at 30 frames per second


def in_frame_order(clip: _Clip) -> _Clip:
    """Return the same motion with one row for each present frame, in time order."""
    return _with_rows(clip, np.arange(clip.timing.n_frames))


def trimmed(clip: _Clip, first: int | None = None, stop: int | None = None) -> _Clip:
    """Return frames ``first`` to ``stop`` - 1 of the file's numbering; RigError if none remain."""
    low = clip.timing.first_frame
    high = low + clip.timing.n_frames
    start, end = low if first is None else first, high if stop is None else stop
    if not low <= start < end <= high:
        asked = ":".join("" if number is None else str(number) for number in (first, stop))
        raise RigError(
            f"frames to keep: expected a range within {low}:{high} (frames {low} to {high - 1}), "
            f"found {asked}"
        )
    return _with_rows(clip, np.arange(start - low, end - low))


def _with_rows(clip: _Clip, frames: _Indices) -> _Clip:
    """Return some consecutive frames (F,), counted from 0, each with its own row, in time order."""
    timing = clip.timing
    chosen = timing.rows[frames]
    kept = chosen[chosen >= 0]
    rows = np.where(chosen >= 0, np.cumsum(chosen >= 0) - 1, -1).astype(np.int32)
    first = int(frames[0]) if len(frames) else 0
    moved = replace(
        timing, rows=rows, first_frame=timing.first_frame + first, start=timing.time(first)
    )
    return with_rows(clip, moved, lambda _, rows: rows[kept])


def resampled(clip: Captured, rate: float) -> Captured:
    """Return a clip at ``rate`` frames per second from the same start; RigError above a million.

    A new frame is missing if either of the frames around it is. Frames are counted from 0.
    """
    timing = clip.timing
    count = int(np.floor((timing.n_frames - 1) / timing.frame_rate * rate + _ON_FRAME)) + 1
    if count > _MOST_FRAMES:
        raise RigError(
            f"{clip.name}: expected at most {_MOST_FRAMES:,} frames, found {count:,} at "
            f"{rate:g} fps: choose a lower rate or trim the motion"
        )
    times = timing.start + np.arange(count if timing.n_frames else 0) / rate
    present = _present(timing, times)
    rows: Ints = np.where(present, np.cumsum(present) - 1, -1).astype(np.int32)
    again = replace(timing, frame_rate=rate, rows=rows, first_frame=0)
    if clip.points is not None:
        return replace(clip, timing=again, points=points_between(clip, times[present]))
    found = clip.sample(None, times[present])
    return with_rows(clip, again, lambda name, _: getattr(found, name))


def _present(timing: Timing, times: Floats) -> Bools:
    """Return whether the frames on both sides of each time, or the frame at it, exist: (T,)."""
    if not timing.n_frames:
        return np.zeros(0, dtype=np.bool_)
    place = (times - timing.start) * timing.frame_rate
    nearest = np.round(place)
    place = np.where(np.abs(place - nearest) < _ON_FRAME, nearest, place)
    last = timing.n_frames - 1
    before = np.clip(np.floor(place).astype(int), 0, last)
    after = np.clip(np.ceil(place).astype(int), 0, last)
    both: Bools = timing.present[before] & timing.present[after]
    return both


def points_between(clip: PointClip, times: Floats, interpolate: bool = False) -> Floats:
    """Return points (T, K, 4), interpolated where both neighbours are visible.

    Others keep the previous row's values or, with ``interpolate``, are invisible, even across gaps.
    """
    before, after, fraction = clip.timing.locate(times, interpolate)
    start, end = clip.points[before], clip.points[after]
    mixed = start + fraction[:, None, None] * (end - start)
    both = (start[..., 3:] > 0.0) & (end[..., 3:] > 0.0)
    return np.where(both, mixed, 0.0 if interpolate else start)
