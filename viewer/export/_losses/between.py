"""What a motion does between the frames that are written, where it is resampled."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.export._losses.lines import frames_losses
from viewer.rig.arrays import Floats
from viewer.rig.motion.clip import Clip
from viewer.rig.motion.evaluation import frames_of
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.take import Take, frames_at
from viewer.rig.motion.timing import Timing
from viewer.rig.skinning import Skinning

__all__ = ["PLACES", "own_times", "resampling_losses"]

PLACES = "between frames"
_ON_FRAME = 1e-6  # of a frame: nearer than this to a frame is that frame


def own_times(take: Take) -> Floats:
    """Return the seconds of a motion's own frames or keys that lie between frames of a take."""
    motion, times = take.motion, take.frames.times
    if isinstance(motion, Clip):
        own = np.unique(np.concatenate([np.zeros(0), *(c.times for c in motion.channels)]))
    else:
        own = motion.start + np.arange(motion.timing.n_frames) / motion.timing.frame_rate
    place = (own - times[0]) * take.frame_rate
    is_between = np.abs(place - np.round(place)) > _ON_FRAME
    return own[is_between & (place > 0.0) & (place < len(times) - 1)]


def resampling_losses(path: Path, take: Take, how: Skinning) -> list[str]:
    """Return a line that says what frames at a fixed rate leave out of a motion, or none.

    A capture's own frames, or a clip's keys, that lie between the frames that are written are held
    against these, with rotations on the shorter arc and all else in straight lines between them.

    Parameters
    ----------
    path : Path
        What was written.
    take : Take
        What was written into it.
    how : Skinning
        What moves the mesh.
    """
    motion, frames, rate = take.motion, take.frames, take.frame_rate
    times = own_times(take)
    if len(times) == 0:
        return []
    written = SampledClip(
        motion.name,
        Timing(rate, np.where(frames.present, np.arange(frames.n_frames), -1).astype(np.int32)),
        frames.rotations,
        frames.translations,
        frames.figure_translations,
        frames.figure_scales,
        frames.shape_weights,
    )
    found = frames_of(take.figure, written, times - frames.times[0])
    wanted = frames_at(take, times)
    wanted = replace(wanted, present=wanted.present & found.present)
    if not wanted.present.any():
        return []
    lines = frames_losses(path, replace(take, frames=wanted), found, how, places=PLACES)
    return [f"{line}: {rate:g} a second are written" for line in lines]
