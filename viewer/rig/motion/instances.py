"""Instances: many actors of one figure posed together, and their joint matrices.

All computation is vectorised over actors; only copying results into each pose is per actor.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.geometry.rotation import quaternion_to_matrix
from viewer.rig.geometry.transform import affine_matrices
from viewer.rig.kinematics import (
    is_posed,
    joint_worlds,
    posed_skeleton,
)
from viewer.rig.pose import Pose, PosedSkeleton, dof_rotations, local_transforms
from viewer.rig.skeleton import Skeleton


def local_rotations(skeleton: Skeleton, poses: Sequence[Pose]) -> Floats:
    """Return R(quaternion) R(DOFs) of each pose's joints (A, J, 3, 3)."""
    beneath = quaternion_to_matrix(np.stack([pose.rotations for pose in poses]))
    return beneath @ dof_rotations(skeleton, np.stack([pose.dofs for pose in poses]))


def worlds(skeleton: Skeleton, poses: Sequence[Pose], rotations: Floats | None = None) -> Floats:
    """Return poses' world matrices (A, J, 4, 4); ``rotations``: their local ones, if known."""
    rotations = local_rotations(skeleton, poses) if rotations is None else rotations
    parts = (
        np.stack([getattr(pose, name) for pose in poses])
        for name in ("dofs", "translations", "scales")
    )
    return joint_worlds(skeleton.parents, *local_transforms(skeleton, rotations, *parts))


def posed_worlds(
    skeleton: Skeleton, poses: Sequence[Pose], rotations: Floats | None = None
) -> Floats:
    """Return ``worlds``; missing ones are computed in one batch and cached in the poses."""
    rows = [row for row, pose in enumerate(poses) if not is_posed(skeleton, pose)]
    missing = [poses[row] for row in rows]
    if missing:
        found = worlds(skeleton, missing, None if rotations is None else rotations[rows])
        for pose, world in zip(missing, found, strict=True):
            pose.posed = PosedSkeleton(skeleton, pose.skinning_key, world)
        if len(missing) == len(poses):
            return found
    return np.stack([posed_skeleton(skeleton, pose).world for pose in poses])


def placements(poses: Sequence[Pose]) -> Floats:
    """Return T(figure_translation) S(figure_scale) of poses: (A, 4, 4), applied after skinning."""
    scales = np.array([pose.figure_scale for pose in poses])
    places = np.array([pose.figure_translation for pose in poses])
    return affine_matrices(scales[:, None, None] * np.eye(3), places)
