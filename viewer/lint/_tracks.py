"""Evaluation of an actor's clip frame by frame."""

from __future__ import annotations

import math

import numpy as np

from viewer.lint._counting import Counting
from viewer.lint._finding import Subject
from viewer.lint._track import Track
from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.captures.points import PointClip
from viewer.rig.figure import Figure
from viewer.rig.inspection.soles import soles_of
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.motion.clip import Clip
from viewer.rig.motion.evaluation import (
    JointMotion,
    frame_rate,
    frames_between,
    frames_of,
    world_frames,
)
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.transform_clip import TransformClip
from viewer.rig.shape import rest_joints, shaped
from viewer.rig.skeleton import Skeleton

__all__ = ["frame_numbers", "key_times", "track_of"]

_TOGETHER = 1000  # frames per batch, which limits the memory for their matrices
_MOST = 200_000  # maximum number of sampling times of a keyed clip
_PROP = 0.1  # relative size of a skeleton below which its mesh determines the size
_ON_STEP = 1e-6  # tolerance, as a fraction of a step


def track_of(subject: Subject) -> Track | None:
    """Return the cached track of an actor's skeleton; None if it has none."""
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
        count = timing.n_frames
        times = timing.start + np.arange(count) / timing.frame_rate
        numbers = timing.first_frame + np.arange(count, dtype=np.int32)
    else:
        times = key_times(subject, clip)
        count = len(times)
        numbers = frame_numbers(subject, times)
    frames = frames_of(figure, clip, times, actor.pose)
    scale = float(np.cbrt(abs(np.linalg.det(actor.placement[:3, :3]))))
    is_bound = figure.is_attached and not len(subject.invalid.get("bindings", ()))
    soles = soles_of(shaped(figure, frames.shape_weights[0]), is_bound) if count else None
    feet = np.zeros(0, dtype=np.int32) if soles is None else soles.joints
    joints, lowest = np.empty((count, skeleton.n_joints, 3)), np.empty((count, len(feet)))
    axis = actor.placement[2 if subject.up == "z" else 1]
    for start in range(0, count, _TOGETHER):
        part = slice(start, start + _TOGETHER)
        world = world_frames(figure, frames_between(frames, part))
        joints[part] = world[..., :3, 3]
        if soles is not None:
            lowest[part] = soles.heights(world, axis, scale)
    placed = joints @ actor.placement[:3, :3].T + actor.placement[:3, 3]
    return Track(
        times=times + actor.offset,
        numbers=numbers,
        present=frames.present & _known(subject, clip, count),
        positions=placed,
        rotations=frames.rotations,
        stepped=_stepped(clip, skeleton, times),
        size=scale * _size(subject, figure),
        scale=scale,
        feet=feet,
        soles=lowest,
    )


def _stepped(clip: JointMotion, skeleton: Skeleton, times: Floats) -> Bools:
    """Return where keys without interpolation move a joint or its ancestors: (F, J)."""
    result = np.zeros((len(times), skeleton.n_joints), dtype=np.bool_)
    if not isinstance(clip, TransformClip):
        return result
    for channel in clip.channels:
        if channel.joint >= 0 and channel.interpolation == "step":
            rows = np.searchsorted(times, channel.times)
            result[rows[rows < len(times)], channel.joint] = True
    for joint, parent in enumerate(skeleton.parents.tolist()):
        if parent >= 0:
            result[:, joint] |= result[:, parent]
    return result


def _size(subject: Subject, figure: Figure) -> float:
    """Return the size of the skeleton, or of the mesh if that is much larger: a prop on a joint."""
    joints, mesh = box_size(bounding_box(rest_joints(figure))), subject.size()
    return joints if joints > _PROP * mesh else mesh


def key_times(subject: Subject, clip: Clip | TransformClip) -> Floats:
    """Return the sampling times of a keyed clip: its frames, and steps between them. (F,).

    Times are seconds on the clip's own clock.
    """
    options = subject.options
    rate = options.frame_rate or frame_rate(clip)
    rate *= max(1, math.ceil(options.rate / rate))
    count = min(math.floor((clip.end - clip.start) * rate + _ON_STEP) + 1, _MOST)
    return clip.start + np.arange(count) / rate


def frame_numbers(subject: Subject, times: Floats) -> Ints:
    """Return the frames of the timeline at times of a keyed clip: (F,) int32."""
    actor = subject.actor
    assert actor.clip is not None  # checked by the callers
    rate = subject.options.frame_rate or frame_rate(actor.clip)
    counting = subject.counting or Counting(rate, actor.clip.start + actor.offset)
    return counting.numbers(times + actor.offset)


def _known(subject: Subject, clip: JointMotion, count: int) -> Bools:
    """Return which frames have valid data from the file: (F,)."""
    if not isinstance(clip, SampledClip):
        return np.ones(count, dtype=np.bool_)
    rows = clip.timing.rows
    return subject.valid("frames", clip.n_rows)[rows] | (rows < 0)
