"""Frames of clips: a range of them, another rate, interpolated gaps, joined tracks of a person."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Ints, runs_of
from viewer.rigs.captures.points import PointClip
from viewer.rigs.motion.sampled_clip import SampledClip, joined, with_rows

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
    present = timing.surrounds(times)
    rows: Ints = np.where(present, np.cumsum(present) - 1, -1).astype(np.int32)
    again = replace(timing, frame_rate=rate, rows=rows, first_frame=0)
    found = clip.sample(None, times[present])
    return with_rows(clip, again, lambda name, _: getattr(found, name))


# Interrupted tracks.

Span = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Gaps:
    """Gaps of a clip as half-open ranges of frames, counted from 0."""

    closed: tuple[Span, ...] = ()
    """Gaps that were interpolated."""
    left: tuple[Span, ...] = ()
    """Gaps that are too long."""


def inner_gaps(clip: SampledClip | PointClip) -> list[Span]:
    """Return the gaps between the first and the last frame in which the person is present."""
    present = clip.timing.present
    there = np.flatnonzero(present)
    if len(there) == 0:
        return []
    first, last = int(there[0]), int(there[-1])
    return [(a + first, b + first) for a, b in runs_of(~present[first : last + 1])]


def interpolate_gaps(clip: Captured, longest: int | None = None) -> tuple[Captured, Gaps]:
    """Interpolate gaps of up to ``longest`` frames (None: all), but not beyond the clip's ends."""
    gaps = inner_gaps(clip)
    limit = clip.timing.n_frames if longest is None else longest
    closed = tuple(gap for gap in gaps if gap[1] - gap[0] <= limit)
    left = tuple(gap for gap in gaps if gap not in closed)
    if not closed:
        return clip, Gaps(closed, left)
    frames = np.concatenate([np.arange(*gap) for gap in closed])
    timing = clip.timing
    times = timing.times[frames]
    rows = timing.rows.copy()
    count = clip.n_rows
    rows[frames] = count + np.arange(len(frames), dtype=np.int32)
    whole = replace(timing, rows=rows)
    found = clip.sample(None, times, interpolate=True)
    if clip.points is not None and found.points is not None:
        # Points that are not visible on both sides of a gap are not visible in it either.
        before, after, _ = timing.locate(times, interpolate=True)
        both = (clip.points[before, :, 3:] > 0.0) & (clip.points[after, :, 3:] > 0.0)
        found = replace(found, points=np.where(both, found.points, 0.0))
    longer = with_rows(clip, whole, lambda name, rows: np.concatenate([rows, getattr(found, name)]))
    return longer, Gaps(closed, left)


def common_frames(first: Captured, second: Captured) -> Ints:
    """Return the frames in which both clips have data, counted from 0."""
    count = min(first.timing.n_frames, second.timing.n_frames)
    both = first.timing.present[:count] & second.timing.present[:count]
    return np.flatnonzero(both).astype(np.int32)


def joined_tracks(first: Captured, second: Captured) -> Captured:
    """Return the frames of both clips; the first takes precedence. RigError if they don't match."""
    a, b = first.timing, second.timing
    if (a.frame_rate, a.first_frame, a.start) != (b.frame_rate, b.first_frame, b.start):
        raise RigError("tracks of one person: expected the same frame rate and first frame")
    count = max(a.n_frames, b.n_frames)
    rows = np.full((2, count), -1, dtype=np.int32)
    rows[0, : a.n_frames], rows[1, : b.n_frames] = a.rows, b.rows
    merged = np.where(rows[0] >= 0, rows[0], np.where(rows[1] >= 0, rows[1] + first.n_rows, -1))
    for name in (each.name for each in fields(first) if each.name not in ("name", "timing")):
        one, two = getattr(first, name), getattr(second, name)
        if (one is None) != (two is None) or np.shape(one)[1:] != np.shape(two)[1:]:
            raise RigError(f"tracks of one person: expected the same {name} in both")
    return joined((first, second), replace(a, rows=merged.astype(np.int32)))
