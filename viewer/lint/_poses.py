"""Representative poses of an actor, in which rig errors are visible."""

from __future__ import annotations

import numpy as np

from viewer.rig.captures.points import PointClip
from viewer.rig.motion.evaluation import frames_of, pose_of
from viewer.rig.pose import Pose
from viewer.rig.scene import Actor, figure_pose
from viewer.rig.skeleton import FIRST_ROTATION, clamp_dofs

__all__ = ["some_poses"]

_COUNT = 4  # number of poses in addition to the rest pose and the current pose
_SWING = 0.6  # radians: roughly the largest rotation of most joints in a walk
_SEED = 5  # fixed, so that results are reproducible


def some_poses(actor: Actor) -> list[Pose]:
    """Return the rest pose, the current pose, and some poses of the clip, or else random ones.

    Parameters
    ----------
    actor : Actor
        Actor with a skeleton.
    """
    figure, clip = actor.figure, actor.clip
    assert figure.skeleton is not None and actor.pose is not None  # checked by the callers
    rest = figure_pose(figure)
    poses = [rest, actor.pose]
    if clip is not None and not isinstance(clip, PointClip):
        times = np.linspace(clip.start, clip.end, _COUNT)
        frames = frames_of(figure, clip, times, actor.pose, interpolate=True)
        return poses + [
            pose_of(figure, frames, int(frame)) for frame in np.flatnonzero(frames.present)
        ]
    rng = np.random.default_rng(_SEED)
    is_rotation = figure.skeleton.dof_kinds >= FIRST_ROTATION
    for _ in range(_COUNT):
        pose = actor.pose.copy()
        pose.dofs[is_rotation] += rng.uniform(-_SWING, _SWING, int(is_rotation.sum()))
        pose.dofs[:] = clamp_dofs(figure.skeleton, pose.dofs)
        poses.append(pose)
    return poses
