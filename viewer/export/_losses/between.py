"""Errors of an exported motion at times between its frames."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic, Phrase
from viewer.export._losses.apart import with_values
from viewer.export._losses.lines import frames_losses
from viewer.export._losses.worst_times import Sampler, key_times, worst_times
from viewer.rig.arrays import Floats
from viewer.rig.motion.clip import Clip
from viewer.rig.motion.evaluation import Frames, frame_rate, frames_of
from viewer.rig.motion.sampled_animation import SampledAnimation, frames_at
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.timing import Timing
from viewer.rig.motion.transform_clip import TransformClip
from viewer.rig.skinning import Skinning
from viewer.rig.transform_keys.rate import is_regular

_ON_FRAME = 1e-6  # tolerance in frames for a time to be on a frame


def resampling_losses(path: Path, animation: SampledAnimation, how: Skinning) -> list[Diagnostic]:
    """Return a note about the error of sampling a motion at a fixed rate, if there is one.

    Between written frames, rotations are interpolated along the shorter arc and everything else
    linearly.

    ``path``: the written file.
    ``animation``: contents of the file.
    ``how``: skinning of the mesh.
    """
    motion, frames, rate = animation.motion, animation.frames, animation.frame_rate
    written = SampledClip(
        motion.name,
        Timing(rate, np.where(frames.present, np.arange(frames.n_frames), -1).astype(np.int32)),
        frames.rotations,
        frames.translations,
        frames.figure_translations,
        frames.figure_scales,
        frames.shape_weights,
        frames.scales,
    )
    first = frames.times[0]

    def found(times: Floats) -> Frames:
        return frames_of(animation.figure, written, np.maximum(times - first, 0.0))

    return with_values(between_losses(path, animation, found, how), rate=rate)


def rate_note(animation: SampledAnimation) -> list[Diagnostic]:
    """Return a note about the rate that was chosen for keys at irregular times."""
    motion, rate = animation.motion, animation.frame_rate
    if not isinstance(motion, TransformClip) or is_regular(motion) or rate != frame_rate(motion):
        return []
    return [Diagnostic("X005.irregular-keys", values={"rate": rate})]


def between_losses(
    path: Path,
    animation: SampledAnimation,
    found: Sampler,
    how: Skinning,
    also: Floats | None = None,
) -> list[Diagnostic]:
    """Return a note with the largest errors between an animation's frames, if there are any.

    Keys are searched for the times of the largest error. A capture is defined only at
    its own frames, and is compared there.

    ``path``: the written file.
    ``animation``: contents of the file.
    ``found``: function from seconds (T,) to the poses in the file.
    ``how``: skinning of the mesh.
    ``also`` (T,): additional times at which captures are compared, seconds.
    """
    estimate: Phrase | str = ""
    if isinstance(animation.motion, Clip | TransformClip):
        edges = np.union1d(
            animation.frames.times,
            key_times(animation.motion, *animation.frames.times[[0, -1]].tolist()),
        )
        worst = worst_times(
            animation.figure,
            lambda times: frames_at(animation, times),
            found,
            edges,
            animation.frame_rate,
            how,
        )
        times = worst.times
        if worst.is_estimate:
            estimate = Phrase("estimated-times", n=worst.looked)
    else:
        times = _own_times(animation, animation.motion)
        times = times if also is None else np.union1d(times, also)
    if len(times) == 0:
        return []
    read, wanted = found(times), frames_at(animation, times)
    wanted = replace(wanted, present=wanted.present & read.present)
    if not wanted.present.any():
        return []
    notes = frames_losses(path, replace(animation, frames=wanted), read, how, is_between=True)
    return with_values(notes, estimate=estimate)


def _own_times(animation: SampledAnimation, motion: SampledClip) -> Floats:
    """Return the times of a capture's frames that are between frames of an animation, seconds."""
    own = motion.start + np.arange(motion.timing.n_frames) / motion.timing.frame_rate
    place = (own - animation.frames.times[0]) * animation.frame_rate
    is_between = np.abs(place - np.round(place)) > _ON_FRAME
    return own[is_between & (place > 0.0) & (place < animation.frames.n_frames - 1)]
