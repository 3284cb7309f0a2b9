"""Detection of a capture's up axis from its people, whose heads are mostly above their pelvises."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.captures.points import PointClip
from viewer.rig.motion.evaluation import frames_of, world_frames
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.scene import Actor

__all__ = ["CUSTOM", "guess_up"]

CUSTOM = "z"
"""Default up axis without evidence: EasyMocap's calibration board usually lies on the floor."""

_ENOUGH = 64  # maximum number of frames per person, as more frames would not change the result
_LOW = (("mid_hip",), ("pelvis",), ("left_hip", "right_hip"))
_HIGH = (("head",), ("nose",), ("left_ear", "right_ear"), ("neck",))


def guess_up(actors: Iterable[Actor]) -> str:
    """Return the axis along which heads are above pelvises, on average.

    Parameters
    ----------
    actors : iterable of Actor
        Bodies with sampled clips, and captured keypoints; only frames read so far are used, and
        other actors and all placements are ignored.

    Returns
    -------
    str
        ``"y"``, ``"z"``, ``"-y"`` or ``"-z"``; ``CUSTOM`` if there is no evidence, or people lie
        along x.
    """
    directions = [np.zeros((0, 3))]
    for actor in actors:
        if isinstance(actor.clip, SampledClip):
            directions.append(_of_body(actor, actor.clip))
        elif isinstance(actor.clip, PointClip):
            directions.append(_of_points(actor, actor.clip))
    steps = np.concatenate(directions)
    lengths = np.linalg.norm(steps, axis=1)
    mean = (steps[lengths > 0.0] / lengths[lengths > 0.0, None]).sum(axis=0)
    axis = int(np.abs(mean).argmax())
    if axis == 0:  # the axis is also 0 if all sums are 0
        return CUSTOM
    return ("-" if mean[axis] < 0.0 else "") + "xyz"[axis]


def _of_body(actor: Actor, clip: SampledClip) -> Floats:
    """Return the vectors from pelvis to head in the first frames: (N, 3)."""
    skeleton = actor.figure.skeleton
    if skeleton is None or not {"pelvis", "head"} <= set(skeleton.names):
        return np.zeros((0, 3))
    there = np.flatnonzero(clip.timing.present)[:_ENOUGH]
    times = clip.timing.start + there / clip.timing.frame_rate
    places = world_frames(actor.figure, frames_of(actor.figure, clip, times))[..., :3, 3]
    names = skeleton.names
    return np.asarray(places[:, names.index("head")] - places[:, names.index("pelvis")])


def _of_points(actor: Actor, clip: PointClip) -> Floats:
    """Return the vectors from hips to head in frames where both are visible: (N, 3)."""
    layout, points = actor.figure.points, clip.points[:_ENOUGH]
    names = () if layout is None else layout.names
    low, high = (_middle(points, names, choices) for choices in (_LOW, _HIGH))
    if low is None or high is None:
        return np.zeros((0, 3))
    seen = (low[:, 3] > 0.0) & (high[:, 3] > 0.0)
    return np.asarray((high - low)[seen, :3])


def _middle(
    points: Floats, names: tuple[str, ...], choices: tuple[tuple[str, ...], ...]
) -> Floats | None:
    """Return the mean of the first set of keypoints that exists in the layout: (N, 4)."""
    for choice in choices:
        if set(choice) <= set(names):
            chosen = points[:, [names.index(name) for name in choice]]
            middle = chosen.mean(axis=1)
            middle[:, 3] = chosen[..., 3].min(axis=1)
            return np.asarray(middle)
    return None
