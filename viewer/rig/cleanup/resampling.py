"""Resampling of clips at another frame rate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.errors import RigError
from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.captures.points import PointClip
from viewer.rig.cleanup.frame_rows import Captured, is_shared, points_between
from viewer.rig.motion.sampled_clip import SampledClip, sample_rows
from viewer.rig.motion.timing import Timing

__all__ = ["resampled"]

_ON_FRAME = 1e-6  # tolerance, as a fraction of a frame, for times that are treated as that frame
_MOST_FRAMES = 1_000_000  # maximum number of frames: 9 hours at 30 frames per second


def resampled(clip: Captured, rate: float) -> Captured:
    """Return a clip with another frame rate, which begins at the same time.

    Rotations are interpolated along the shorter arc, everything else linearly. At the times of the
    original frames, values are unchanged. A new frame between two original frames is missing if
    either of those is missing. Frames are counted from 0.

    Parameters
    ----------
    clip : SampledClip or PointClip
        Any clip.
    rate : float
        Frames per second.

    Raises
    ------
    RigError
        If there would be more than a million frames.
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
    if isinstance(clip, PointClip):
        return replace(clip, timing=again, points=points_between(clip, times[present]))
    found = sample_rows(clip, times[present])
    return SampledClip(
        clip.name,
        again,
        found.rotations,
        found.translations,
        found.figure_translations,
        found.figure_scales,
        clip.shape_weights if is_shared(clip, "shape_weights") else found.shape_weights,
        clip.scales if is_shared(clip, "scales") else found.scales,
    )


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
