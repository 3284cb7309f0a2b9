"""Keyed transforms baked to frames, for operations on local rotations at a fixed rate."""

from __future__ import annotations

import numpy as np

from viewer.rig.figure import Figure
from viewer.rig.motion.evaluation import frame_rate, frames_of
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.timing import Timing, frame_times
from viewer.rig.motion.transform_clip import TransformClip
from viewer.rig.pose import Pose

__all__ = ["baked"]


def baked(
    figure: Figure, clip: TransformClip, rate: float | None = None, base: Pose | None = None
) -> SampledClip:
    """Return a clip's poses at a fixed rate, from its start to its last whole frame.

    Parameters
    ----------
    figure : Figure
        With the skeleton that the clip moves.
    clip : TransformClip
        The motion.
    rate : float, optional
        Frames per second; the rate of the keys if omitted.
    base : Pose, optional
        Provides what the clip does not animate; the figure's own pose if omitted.

    Raises
    ------
    RigError
        If the figure has no skeleton.
    """
    rate = frame_rate(clip) if rate is None else rate
    times = frame_times(clip.start, clip.end, rate)
    frames = frames_of(figure, clip, times, base)
    return SampledClip(
        clip.name,
        Timing(rate, np.arange(len(times), dtype=np.int32), start=clip.start),
        frames.rotations,
        frames.translations,
        shape_weights=frames.shape_weights if figure.n_shapes else None,
        scales=frames.scales,
    )
