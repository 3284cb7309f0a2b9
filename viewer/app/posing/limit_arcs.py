"""Arcs of rotation limits, about the current axes of a joint.

An arc covers the directions that the bone can reach: it starts at the bone's current direction
perpendicular to the axis, and its ends are the limits. If the bone is parallel to the axis, as for
a twist, one of the joint's own axes is used instead.
"""

from __future__ import annotations

import math

import numpy as np

from viewer.app.posing.posed_joint import PosedJoint
from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats
from viewer.rig.geometry.vectors import unit
from viewer.rig.pose import Pose
from viewer.rig.posing.inverse_kinematics import rotation_axes
from viewer.rig.posing.joint_rotation import rotation_dofs

__all__ = ["LimitArc", "arc_points", "limit_arcs"]

_ALONG = 0.35  # sine of the angle between bone and axis below which the rotation is not visible
_STEP = math.radians(4.0)
_WHOLE = 2.0 * math.pi
_ROUNDING = 1e-6  # tolerance within which a value is at a limit, radians


@dataclass(frozen=True, slots=True, eq=False)
class LimitArc:
    """The range of one rotation DOF.

    Attributes
    ----------
    dof : int
        Row of the DOF table.
    color : int
        0, 1, 2 for x, y, z.
    axis, start : (3,)
        Rotation axis, and the current direction perpendicular to it: unit vectors, scene space.
    low, high : float
        Limits relative to the current value, radians about the axis; low <= 0 <= high.
    is_limited : bool
        Whether the value is at a limit.
    """

    dof: int
    color: int
    axis: Floats
    start: Floats
    low: float
    high: float
    is_limited: bool


def limit_arcs(joint: PosedJoint, pose: Pose) -> list[LimitArc]:
    """Return an arc for each free rotation DOF with two finite limits.

    Parameters
    ----------
    joint : PosedJoint
        The joint in the scene.
    pose : Pose
        Pose of the actor.
    """
    skeleton, found = joint.skeleton, []
    axes = rotation_axes(skeleton, pose, joint.joint)
    for dof in rotation_dofs(skeleton, joint.joint, free=True).tolist():
        low, high = skeleton.dof_limits[dof]
        if not np.isfinite([low, high]).all():
            continue
        axis = joint.rotation_axis(axes[dof])
        value = min(max(float(pose.dofs[dof]), float(low)), float(high))
        below, above = float(low) - value, float(high) - value
        is_limited = min(-below, above) <= _ROUNDING
        color = int(skeleton.dof_kinds[dof]) - 3
        start = _present(joint, axis, color)
        found.append(LimitArc(dof, color, axis, start, below, above, is_limited))
    return found


def _present(joint: PosedJoint, axis: Floats, kind: int) -> Floats:
    """Return the direction perpendicular to an axis that shows the rotation about it."""
    own = joint.axes("local")
    across = _without(_bone(joint), axis)
    if np.linalg.norm(across) < _ALONG:
        # Use the more perpendicular of the joint's other two axes, whose projection cannot vanish.
        others = [_without(own[:, (kind + k) % 3], axis) for k in (1, 2)]
        across = max(others, key=lambda vector: float(np.linalg.norm(vector)))
    return unit(across)


def _without(vector: Floats, axis: Floats) -> Floats:
    return np.asarray(vector - (vector @ axis) * axis)


def _bone(joint: PosedJoint) -> Floats:
    """Return the vector from a joint to the middle of its children, or of a leaf's box."""
    skeleton, index = joint.skeleton, joint.joint
    children = np.flatnonzero(skeleton.parents == index)
    if len(children):
        away = joint.world[children, :3, 3].mean(axis=0) - joint.center
    elif skeleton.boxes is not None:
        away = joint.world[index, :3, :3] @ skeleton.boxes[index].mean(axis=0)
    else:
        parent = int(skeleton.parents[index])
        away = joint.center - joint.world[parent, :3, 3] if parent >= 0 else np.zeros(3)
    return unit(away)


def arc_points(arc: LimitArc, center: Floats, radius: float) -> Floats:
    """Return points along an arc from its low to its high end: (N, 3), scene space.

    Parameters
    ----------
    arc : LimitArc
        Arc to draw, limited to 2 pi.
    center : (3,)
        Position of the joint.
    radius : float
        Scene units.
    """
    low, high = arc.low, min(arc.high, arc.low + _WHOLE)
    count = max(2, math.ceil((high - low) / _STEP) + 1)
    angles = np.linspace(low, high, count)[:, None]
    across = np.cross(arc.axis, arc.start)
    return np.asarray(center + radius * (np.cos(angles) * arc.start + np.sin(angles) * across))
