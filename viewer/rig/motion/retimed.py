"""Sampled animations whose frames come at another rate."""

from __future__ import annotations

from dataclasses import replace

from viewer.rig.captures.points import PointClip
from viewer.rig.motion.sampled_clip import SampledClip

__all__ = ["with_rate"]


def with_rate(clip: SampledClip | PointClip, rate: float) -> SampledClip | PointClip:
    """Return a clip with the same frames at another rate; its first frame stays when it is.

    Parameters
    ----------
    clip : SampledClip or PointClip
        Itself returned if it has that rate.
    rate : float
        Frames a second.
    """
    if clip.timing.frame_rate == rate:
        return clip
    return replace(clip, timing=replace(clip.timing, frame_rate=rate))
