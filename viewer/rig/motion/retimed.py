"""Sampled animations played at a different frame rate."""

from __future__ import annotations

from dataclasses import replace

from viewer.rig.captures.points import PointClip
from viewer.rig.motion.sampled_clip import SampledClip

__all__ = ["with_rate"]


def with_rate(clip: SampledClip | PointClip, rate: float) -> SampledClip | PointClip:
    """Return a clip with the same frames at a different rate; its start time is unchanged.

    Parameters
    ----------
    clip : SampledClip or PointClip
        Clip, returned unchanged if it already has that rate.
    rate : float
        Frames per second.
    """
    if clip.timing.frame_rate == rate:
        return clip
    return replace(clip, timing=replace(clip.timing, frame_rate=rate))
