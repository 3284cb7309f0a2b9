"""Skeletons in ``.skel`` form: joints in depth-first order, three rotations each, a moving root."""

from __future__ import annotations

import numpy as np

from viewer.errors import RigError
from viewer.rig.arrays import Floats, Ints
from viewer.rig.geometry.rotation import quaternion_to_matrix
from viewer.rig.hierarchy import depth_first
from viewer.rig.pose import Pose
from viewer.rig.skeleton import Skeleton, joint_label

_CUBE = 0.01  # half the edge length of default boxes, relative to the skeleton's size


def course_skeleton(skeleton: Skeleton, pose: Pose) -> tuple[Skeleton, Ints]:
    """Return the skeleton in the form of ``.skel`` files, with the pose as its rest pose.

    ``skeleton``: skeleton without rest rotations and scales; its lengths already include the
      figure's scale.
    ``pose``: becomes the file's pose; the figure's translation is added to the roots' offsets.
    Returns ``skeleton``: joints in depth-first order.
    Returns ``order`` (J,) int32: the old index of each new joint.
    Raises RigError if a joint has properties that the format cannot store.
    """
    _check(skeleton, pose)
    order = depth_first(skeleton.parents)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    above = skeleton.parents[order]
    scale = pose.figure_scale  # already applied to the skeleton
    offsets = (skeleton.rest_translations + scale * pose.translations)[order]
    offsets[above < 0] += pose.figure_translation
    rows = _rotation_rows(skeleton)[order].ravel()
    values = np.where(rows >= 0, pose.dofs[rows], 0.0)
    limits = np.where(rows[:, None] >= 0, skeleton.dof_limits[rows], 0.0)
    offsets[0] += scale * _root_shift(skeleton, pose)
    count = skeleton.n_joints
    return Skeleton(
        names=tuple(skeleton.names[joint] for joint in order),
        parents=np.where(above >= 0, place[above], -1).astype(np.int32),
        rest_translations=offsets,
        rest_rotations=skeleton.rest_rotations[order],
        rest_scales=skeleton.rest_scales[order],
        dof_joints=np.concatenate([np.zeros(3, int), np.repeat(np.arange(count), 3)]),
        dof_kinds=np.concatenate([np.arange(3), np.tile([3, 4, 5], count)]),
        rest_dofs=np.concatenate([np.zeros(3), values]),
        dof_limits=np.concatenate([np.tile([-np.inf, np.inf], (3, 1)), limits]),
        boxes=_boxes(skeleton)[order],
    ), order


def _check(skeleton: Skeleton, pose: Pose) -> None:
    rotated = quaternion_to_matrix(pose.rotations) - np.eye(3)
    for what, off in (
        ("rest rotation", np.abs(rotated).max(axis=(1, 2))),
        ("scale", np.abs(pose.scales - 1.0).max(axis=1)),
    ):
        worst = int(off.argmax())
        if off[worst] > 1e-12:
            raise RigError(f".skel cannot store the {what} of joint {joint_label(skeleton, worst)}")


def _rotation_rows(skeleton: Skeleton) -> Ints:
    """Return each joint's DOF rows about x, y and z, -1 if missing: (J, 3)."""
    rows = np.full((skeleton.n_joints, 3), -1, dtype=np.int32)
    rotation_rows = np.flatnonzero(skeleton.dof_kinds >= 3)
    for row in rotation_rows.tolist():
        joint, axis = int(skeleton.dof_joints[row]), int(skeleton.dof_kinds[row]) - 3
        if rows[joint, axis:].max() >= 0:
            raise RigError(
                f".skel rotates joints about x, then y, then z; joint "
                f"{joint_label(skeleton, joint)} has a different rotation order"
            )
        rows[joint, axis] = row
    return rows


def _root_shift(skeleton: Skeleton, pose: Pose) -> Floats:
    """Return the translation of the first joint by its DOFs; other joints must not translate."""
    shift = np.zeros(3)
    for row in np.flatnonzero(skeleton.dof_kinds < 3).tolist():
        joint = int(skeleton.dof_joints[row])
        if joint == 0:
            shift[skeleton.dof_kinds[row]] += pose.dofs[row]
        elif pose.dofs[row] != 0.0:
            raise RigError(
                f".skel cannot store a translation of joint {joint_label(skeleton, joint)}"
            )
    return shift


def _boxes(skeleton: Skeleton) -> Floats:
    if skeleton.boxes is not None:
        return skeleton.boxes
    half = _CUBE * (float(np.abs(skeleton.rest_translations).max()) or 1.0)
    return np.tile([[-half] * 3, [half] * 3], (skeleton.n_joints, 1, 1))
