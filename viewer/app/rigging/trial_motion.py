"""Trial motion of a rigged mesh: the joints bend in both directions, one after the other."""

from __future__ import annotations

import math

import numpy as np

from viewer.rig.hierarchy import depth_first
from viewer.rig.motion.clip import Channel, Clip
from viewer.rig.pose import Pose
from viewer.rig.skeleton import FIRST_ROTATION, Skeleton

__all__ = ["TRIAL", "trial_clip"]

TRIAL = "trial motion"
"""Name of the clip."""

_ANGLE = math.radians(35.0)
_LONGEST, _WHOLE = 0.9, 20.0
"""Maximum duration of the motion of one joint, and of all joints, in seconds."""


def trial_clip(skeleton: Skeleton, pose: Pose) -> Clip | None:
    """Return a motion that begins and ends in a pose; None if no joint can rotate.

    Each joint except the roots rotates about the axis with the widest range, within its limits.

    Parameters
    ----------
    skeleton : Skeleton
        Skeleton with J joints and their DOFs.
    pose : Pose
        Pose of the skeleton.
    """
    order = depth_first(skeleton.parents)
    dofs = [dof for joint in order.tolist() if (dof := _bending_dof(skeleton, joint)) >= 0]
    if not dofs:
        return None
    seconds = min(_LONGEST, _WHOLE / len(dofs))
    channels = tuple(
        _channel(skeleton, dof, float(pose.dofs[dof]), number * seconds, seconds)
        for number, dof in enumerate(dofs)
    )
    return Clip(TRIAL, channels, 0.0, seconds * len(dofs))


def _bending_dof(skeleton: Skeleton, joint: int) -> int:
    """Return the rotation DOF of a joint with the widest range; -1 if it has none or is a root."""
    if skeleton.parents[joint] < 0:
        return -1
    own = np.flatnonzero((skeleton.dof_joints == joint) & (skeleton.dof_kinds >= FIRST_ROTATION))
    ranges = np.ptp(skeleton.dof_limits[own], axis=1)
    own, ranges = own[ranges > 0.0], ranges[ranges > 0.0]
    return int(own[np.argmax(ranges)]) if len(own) else -1


def _channel(skeleton: Skeleton, dof: int, value: float, start: float, seconds: float) -> Channel:
    low, high = skeleton.dof_limits[dof]
    bent = np.clip([value, value + _ANGLE, value - _ANGLE, value], low, high)
    bent[[0, 3]] = value
    times = start + seconds * np.array([0.0, 0.3, 0.7, 1.0])
    return Channel(dof, times, bent, (("smooth", "smooth"),) * 4)
