"""Rows of clips in the order of their frames."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.rig.arrays import Bools, Floats
from viewer.rig.captures.points import PointClip
from viewer.rig.motion.sampled_clip import SampledClip

__all__ = ["Captured", "in_frame_order", "is_shared", "points_between", "runs_of", "with_rows"]

Captured = SampledClip | PointClip
"""A clip of sampled frames, of joints or of points."""
Indices = NDArray[np.intp]


def runs_of(flags: Bools) -> list[tuple[int, int]]:
    """Return the runs of True as half-open ranges of indices.

    >>> runs_of(np.array([True, True, False, True]))
    [(0, 2), (3, 4)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def with_rows(clip: Captured, frames: Indices) -> Captured:
    """Return a clip of some of the frames, each with a separate row, in time order.

    Parameters
    ----------
    clip : SampledClip or PointClip
        Any clip.
    frames : (F,)
        Consecutive indices of frames, from 0; rate, first frame and start are adjusted.
    """
    timing = clip.timing
    chosen = timing.rows[frames]
    kept = chosen[chosen >= 0]
    rows = np.where(chosen >= 0, np.cumsum(chosen >= 0) - 1, -1).astype(np.int32)
    first = int(frames[0]) if len(frames) else 0
    moved = replace(
        timing, rows=rows, first_frame=timing.first_frame + first, start=timing.time(first)
    )
    count = len(clip.points) if isinstance(clip, PointClip) else clip.n_rows
    arrays: dict[str, Any] = {}
    for field in fields(clip):
        value = getattr(clip, field.name)
        # A single row that applies to all frames is unchanged.
        if (
            isinstance(value, np.ndarray)
            and len(value) == count
            and not is_shared(clip, field.name)
        ):
            arrays[field.name] = value[kept]
    return replace(clip, timing=moved, **arrays)


def is_shared(clip: Captured, name: str) -> bool:
    """Return whether an array of a clip has a single row, which applies to all frames."""
    if name not in ("shape_weights", "scales"):
        return False
    rows = getattr(clip, name)
    return rows is not None and len(rows) == 1


def points_between(clip: PointClip, times: Floats, interpolate: bool = False) -> Floats:
    """Return points (T, K, 4), interpolated where they are visible on both sides.

    Other points keep the values of the previous row or, with ``interpolate``, which also
    interpolates across gaps, are invisible.

    Parameters
    ----------
    clip : PointClip
        Points.
    times : (T,)
        Seconds.
    interpolate : bool
        See above.
    """
    before, after, fraction = clip.timing.locate(times, interpolate)
    start, end = clip.points[before], clip.points[after]
    mixed = start + fraction[:, None, None] * (end - start)
    both = (start[..., 3:] > 0.0) & (end[..., 3:] > 0.0)
    return np.where(both, mixed, 0.0 if interpolate else start)


def in_frame_order(clip: Captured) -> Captured:
    """Return the same motion with one row for each present frame, in time order."""
    return with_rows(clip, np.arange(clip.timing.n_frames))
