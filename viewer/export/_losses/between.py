"""Differences between the frames that are written."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.export._losses.lines import frames_losses
from viewer.export._losses.worst_times import Sampler, key_times, worst_times
from viewer.rig.arrays import Floats
from viewer.rig.motion.clip import Clip
from viewer.rig.motion.evaluation import Frames, frames_of
from viewer.rig.motion.sampled_animation import SampledAnimation, frames_at
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.timing import Timing
from viewer.rig.skinning import Skinning

_PLACES = "between frames"
_ON_FRAME = 1e-6  # of a frame: nearer than this to a frame is that frame


def resampling_losses(path: Path, animation: SampledAnimation, how: Skinning) -> list[str]:
    """Return a line that says what frames at a fixed rate leave out of a motion, or none.

    What is between the frames that are written has rotations on the shorter arc, and all else in
    straight lines.

    ``path``: what was written.
    ``animation``: what was written into it.
    ``how``: what moves the mesh.
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
    )
    first = frames.times[0]

    def found(times: Floats) -> Frames:
        return frames_of(animation.figure, written, np.maximum(times - first, 0.0))

    lines = between_losses(path, animation, found, how)
    return [f"{line}: written at {rate:g} per second" for line in lines]


def between_losses(
    path: Path,
    animation: SampledAnimation,
    found: Sampler,
    how: Skinning,
    also: Floats | None = None,
) -> list[str]:
    """Return a line with the largest differences between an animation's frames, or none.

    Keyed curves are searched for the times at which they differ most. A capture is known on its
    own frames alone, and is compared there.

    ``path``: what was written.
    ``animation``: what was written into it.
    ``found``: from seconds (T,) to the poses that a reader of the file makes of it.
    ``how``: what moves the mesh.
    ``also`` (T,): seconds at which captures are compared, too.
    """
    note = ""
    if isinstance(animation.motion, Clip):
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
            note = f" (an estimate: {worst.looked} times were looked at)"
    else:
        times = _own_times(animation, animation.motion)
        times = times if also is None else np.union1d(times, also)
    if len(times) == 0:
        return []
    read, wanted = found(times), frames_at(animation, times)
    wanted = replace(wanted, present=wanted.present & read.present)
    if not wanted.present.any():
        return []
    lines = frames_losses(path, replace(animation, frames=wanted), read, how, places=_PLACES)
    return [line + note for line in lines]


def _own_times(animation: SampledAnimation, motion: SampledClip) -> Floats:
    """Return the seconds of a capture's own frames that lie between frames of an animation."""
    own = motion.start + np.arange(motion.timing.n_frames) / motion.timing.frame_rate
    place = (own - animation.frames.times[0]) * animation.frame_rate
    is_between = np.abs(place - np.round(place)) > _ON_FRAME
    return own[is_between & (place > 0.0) & (place < animation.frames.n_frames - 1)]
