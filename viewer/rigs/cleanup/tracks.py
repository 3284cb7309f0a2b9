"""Interrupted tracks of people: short gaps interpolated, tracks of one person joined."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Ints, runs_of
from viewer.rigs.captures.points import PointClip
from viewer.rigs.cleanup.frames import Captured, points_between
from viewer.rigs.motion.sampled_clip import SampledClip, joined, with_rows

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
    times = timing.start + frames / timing.frame_rate
    rows = timing.rows.copy()
    count = clip.n_rows
    rows[frames] = count + np.arange(len(frames), dtype=np.int32)
    whole = replace(timing, rows=rows)
    if clip.points is not None:
        points = np.concatenate([clip.points, points_between(clip, times, interpolate=True)])
        return replace(clip, timing=whole, points=points), Gaps(closed, left)
    found = clip.sample(None, times, interpolate=True)
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
