"""Joining of tracks that belong to one person."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np

from viewer.errors import RigError
from viewer.rig.arrays import Floats, Ints
from viewer.rig.captures.points import PointClip
from viewer.rig.cleanup.frame_rows import Captured

__all__ = ["common_frames", "joined_tracks"]


def common_frames(first: Captured, second: Captured) -> Ints:
    """Return the frames in which both clips have data, counted from 0."""
    count = min(first.timing.n_frames, second.timing.n_frames)
    both = first.timing.present[:count] & second.timing.present[:count]
    return np.flatnonzero(both).astype(np.int32)


def joined_tracks(first: Captured, second: Captured) -> Captured:
    """Return a clip with the frames of both clips; the first takes precedence.

    Parameters
    ----------
    first, second : SampledClip or PointClip
        Clips of one skeleton, or of the same points, on one timeline.

    Raises
    ------
    RigError
        If the timelines, joints or points differ.
    """
    a, b = first.timing, second.timing
    if (a.frame_rate, a.first_frame, a.start) != (b.frame_rate, b.first_frame, b.start):
        raise RigError("tracks of one person: expected the same frame rate and first frame")
    count = max(a.n_frames, b.n_frames)
    rows = np.full((2, count), -1, dtype=np.int32)
    rows[0, : a.n_frames], rows[1, : b.n_frames] = a.rows, b.rows
    n_rows = len(first.points) if isinstance(first, PointClip) else first.n_rows
    merged = np.where(rows[0] >= 0, rows[0], np.where(rows[1] >= 0, rows[1] + n_rows, -1))
    arrays: dict[str, Any] = {
        field.name: _stacked(first, second, field.name)
        for field in fields(first)
        if field.name not in ("name", "timing")
    }
    timing = replace(a, rows=merged.astype(np.int32))
    return replace(first, timing=timing, **arrays)


def _stacked(first: Captured, second: Captured, name: str) -> Floats | None:
    """Return the rows of one array of both clips."""
    parts: list[Any] = [getattr(first, name), getattr(second, name)]
    if parts[0] is None and parts[1] is None:
        return None
    if parts[0] is None or parts[1] is None or parts[0].shape[1:] != parts[1].shape[1:]:
        raise RigError(f"tracks of one person: expected the same {name} in both")
    is_shared = name in ("shape_weights", "scales") and len(parts[0]) == len(parts[1]) == 1
    if is_shared and (parts[0] == parts[1]).all():
        return np.asarray(parts[0])
    counts = [
        len(clip.points) if isinstance(clip, PointClip) else clip.n_rows for clip in (first, second)
    ]
    shape: tuple[int, ...] = parts[0].shape[1:]
    return np.concatenate(
        [np.broadcast_to(part, (n, *shape)) for part, n in zip(parts, counts, strict=True)]
    )
