"""Where an actor's joints are in every frame of its clip, in the scene."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from viewer.lint._finding import Subject
from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.clip import Clip
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.motion import Frames, frames_of, world_frames
from viewer.rig.points import PointClip
from viewer.rig.sampled_clip import SampledClip
from viewer.rig.shape import rest_joints

__all__ = ["Track", "track_of"]

_TOGETHER = 1000  # frames whose matrices are in memory at once
_MOST = 200_000  # frames of a clip of keys


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A motion, frame by frame.

    Attributes
    ----------
    times : (F,)
        Seconds of the scene's clock.
    numbers : (F,) int32
        What the file calls each frame.
    present : (F,) bool
        Where False, the other rows mean nothing: nobody is there, or the file cannot say where.
    positions : (F, J, 3)
        Joints in the scene.
    rotations : (F, J, 4)
        Each within its parent: unit quaternions.
    size : float
        Of the skeleton at rest, in the scene.
    scale : float
        Scene units per figure unit.
    """

    times: Floats
    numbers: Ints
    present: Bools
    positions: Floats
    rotations: Floats
    size: float
    scale: float


def track_of(subject: Subject) -> Track | None:
    """Return the motion of an actor's skeleton, made once; None if it has none."""
    if not subject.tracks:
        track = _track(subject)
        if track is None:
            return None
        subject.tracks.append(track)
    return subject.tracks[0]


def _track(subject: Subject) -> Track | None:
    actor = subject.actor
    figure, clip, skeleton = actor.figure, actor.clip, actor.figure.skeleton
    if clip is None or skeleton is None or isinstance(clip, PointClip):
        return None
    if isinstance(clip, SampledClip):
        timing = clip.timing
        count, first = timing.n_frames, timing.first_frame
        times = timing.start + np.arange(count) / timing.frame_rate
    else:
        # A clip of keys has no frames of its own.
        count = min(round((clip.end - clip.start) * subject.options.rate) + 1, _MOST)
        first, times = 0, np.linspace(clip.start, clip.end, count)
    frames = frames_of(figure, clip, times, actor.pose)
    joints = np.empty((count, skeleton.n_joints, 3))
    for start in range(0, count, _TOGETHER):
        part = slice(start, start + _TOGETHER)
        joints[part] = world_frames(figure, _slice(frames, part))[..., :3, 3]
    placed = joints @ actor.placement[:3, :3].T + actor.placement[:3, 3]
    scale = float(np.cbrt(abs(np.linalg.det(actor.placement[:3, :3]))))
    return Track(
        times=times + actor.offset,
        numbers=first + np.arange(count, dtype=np.int32),
        present=frames.present & _known(subject, clip, count),
        positions=placed,
        rotations=frames.rotations,
        size=scale * box_size(bounding_box(rest_joints(figure))),
        scale=scale,
    )


def _known(subject: Subject, clip: Clip | SampledClip, count: int) -> Bools:
    """Return which frames are the file's own: (F,)."""
    if not isinstance(clip, SampledClip):
        return np.ones(count, dtype=np.bool_)
    rows = clip.timing.rows
    return subject.sound("frames", clip.n_rows)[rows] | (rows < 0)


def _slice(frames: Frames, part: slice) -> Frames:
    weights = frames.shape_weights
    return replace(
        frames,
        times=frames.times[part],
        present=frames.present[part],
        rotations=frames.rotations[part],
        translations=frames.translations[part],
        shape_weights=weights if len(weights) == 1 else weights[part],
        figure_translations=frames.figure_translations[part],
        figure_scales=frames.figure_scales[part],
    )
