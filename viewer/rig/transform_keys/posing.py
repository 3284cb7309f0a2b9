"""Application of keyed transforms to a pose."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats, Ints
from viewer.rig.geometry.rotation import quaternion_to_matrix
from viewer.rig.pose import Pose
from viewer.rig.posing.pose_vector import set_joint_rotations
from viewer.rig.skeleton import FIRST_ROTATION, Skeleton
from viewer.rig.transform_keys.sampling import TransformSamples


def apply_transforms(samples: TransformSamples, row: int, skeleton: Skeleton, pose: Pose) -> None:
    """Set the values that the channels animate, in place; all others are unchanged.

    Parameters
    ----------
    samples : TransformSamples
        Values of all channels at some times.
    row : int
        Index of the time.
    skeleton : Skeleton
        Provides the DOF table and the rest pose.
    pose : Pose
        Rotations become DOFs of ball joints, and quaternions elsewhere, as in
        ``set_joint_rotations``.
    """
    if len(samples.rotated):
        rotations = quaternion_to_matrix(samples.rotations[row])
        set_joint_rotations(skeleton, pose, samples.rotated, rotations)
    apply_placements(samples, row, skeleton, pose)


def apply_placements(samples: TransformSamples, row: int, skeleton: Skeleton, pose: Pose) -> None:
    """Set all values that the channels animate except rotations; see ``apply_transforms``."""
    if len(samples.translated):
        set_joint_translations(skeleton, pose, samples.translated, samples.translations[row])
    pose.scales[samples.scaled] = samples.scales[row]
    pose.shape_weights[samples.weighted] = samples.weights[row]


def set_joint_translations(
    skeleton: Skeleton, pose: Pose, joints: Ints, translations: Floats
) -> None:
    """Set the translations of joints relative to their parents, in place.

    Parameters
    ----------
    skeleton : Skeleton
        Provides the DOF table.
    pose : Pose
        A joint's translation DOFs receive the offset from rest, within their limits; the pose's
        translations receive the remainder.
    joints : (N,)
        Joints to move.
    translations : (N, 3)
        Relative to the parent joint, rest translation included; lengths.
    """
    offsets = translations - skeleton.rest_translations[joints]
    moves = np.flatnonzero(skeleton.dof_kinds < FIRST_ROTATION)
    moves = moves[np.isin(skeleton.dof_joints[moves], joints)]
    if not len(moves):
        pose.translations[joints] = offsets
        return
    wanted = np.zeros((skeleton.n_joints, 3))
    wanted[joints] = offsets
    owners, axes = skeleton.dof_joints[moves], skeleton.dof_kinds[moves]
    # Of several DOFs along one axis, the first receives the offset.
    _, first = np.unique(owners * FIRST_ROTATION + axes, return_index=True)
    values = np.zeros(len(moves))
    values[first] = wanted[owners[first], axes[first]]
    pose.dofs[moves] = np.clip(values, *skeleton.dof_limits[moves].T)
    np.subtract.at(wanted, (owners, axes), pose.dofs[moves])
    pose.translations[joints] = wanted[joints]
