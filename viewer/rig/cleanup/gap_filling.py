"""Interpolation of missing frames inside clips."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats
from viewer.rig.captures.points import PointClip
from viewer.rig.cleanup.frame_rows import Captured, is_shared, points_between, runs_of
from viewer.rig.motion.sampled_clip import SampledClip, sample_rows

__all__ = ["Gaps", "inner_gaps", "interpolate_gaps"]

Span = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Gaps:
    """Gaps of a clip as half-open ranges of frames, counted from 0.

    Attributes
    ----------
    closed : tuple of (int, int)
        Gaps that were interpolated.
    left : tuple of (int, int)
        Gaps that are too long.
    """

    closed: tuple[Span, ...] = ()
    left: tuple[Span, ...] = ()


def inner_gaps(clip: SampledClip | PointClip) -> list[Span]:
    """Return the gaps between the first and the last frame in which the person is present."""
    present = clip.timing.present
    there = np.flatnonzero(present)
    if len(there) == 0:
        return []
    first, last = int(there[0]), int(there[-1])
    return [(a + first, b + first) for a, b in runs_of(~present[first : last + 1])]


def interpolate_gaps(clip: Captured, longest: int | None = None) -> tuple[Captured, Gaps]:
    """Interpolate the short gaps of a clip, rotations along the shorter arc.

    Everything else is interpolated linearly. Frames before the first and after the last one stay
    missing.

    Parameters
    ----------
    clip : SampledClip or PointClip
        Any clip.
    longest : int, optional
        Number of frames of the longest gap to interpolate; all gaps if omitted.
    """
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
    count = len(clip.points) if isinstance(clip, PointClip) else clip.n_rows
    rows[frames] = count + np.arange(len(frames), dtype=np.int32)
    whole = replace(timing, rows=rows)
    if isinstance(clip, PointClip):
        points = np.concatenate([clip.points, points_between(clip, times, interpolate=True)])
        return replace(clip, timing=whole, points=points), Gaps(closed, left)
    return replace(_extended(clip, times), timing=whole), Gaps(closed, left)


def _extended(clip: SampledClip, times: Floats) -> SampledClip:
    """Return a clip with additional rows for times inside its gaps."""
    found = sample_rows(clip, times, interpolate=True)

    def longer(name: str) -> Floats | None:
        own = getattr(clip, name)
        if own is None or is_shared(clip, name):
            return None if own is None else np.asarray(own)
        return np.concatenate([own, getattr(found, name)])

    return SampledClip(
        clip.name,
        clip.timing,
        np.concatenate([clip.rotations, found.rotations]),
        longer("translations"),
        longer("figure_translations"),
        longer("figure_scales"),
        longer("shape_weights"),
        longer("scales"),
    )
