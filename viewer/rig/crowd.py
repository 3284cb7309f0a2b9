"""Many poses of one figure at once: their joints' matrices, without a loop over actors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.kinematics import forward_kinematics, skinning_matrices
from viewer.rig.pose import Pose, dof_rotations
from viewer.rig.rotation import quaternion_to_matrix
from viewer.rig.shape import shaped
from viewer.rig.skeleton import Skeleton

__all__ = ["local_rotations", "palettes", "placements", "worlds"]

_FIRST_ROTATION = 3  # DOF kinds 0-2 translate, 3-5 rotate


def local_rotations(skeleton: Skeleton, poses: Sequence[Pose]) -> Floats:
    """Return each joint's rotation within its parent, R(quaternion) R(DOFs).

    Parameters
    ----------
    skeleton : Skeleton
        Of J joints.
    poses : sequence of A Pose
        DOFs in lengths and radians.

    Returns
    -------
    (A, J, 3, 3)
        Matrices for column vectors.
    """
    beneath = quaternion_to_matrix(np.stack([pose.rotations for pose in poses]))
    return beneath @ dof_rotations(skeleton, np.stack([pose.dofs for pose in poses]))


def worlds(skeleton: Skeleton, poses: Sequence[Pose], rotations: Floats | None = None) -> Floats:
    """Return where poses put every joint; see ``viewer.rig.kinematics.world_matrices``.

    Parameters
    ----------
    skeleton : Skeleton
        Of the figure, already shaped; all poses have this shape.
    poses : sequence of A Pose
        DOFs in lengths and radians.
    rotations : (A, J, 3, 3), optional
        Their ``local_rotations``, if they are known.

    Returns
    -------
    (A, J, 4, 4)
        Joint-to-figure matrices.
    """
    rotations = local_rotations(skeleton, poses) if rotations is None else rotations
    # Joints come first: kinematics takes one matrix or a whole row of them alike.
    local = np.zeros((skeleton.n_joints, len(poses), 4, 4))
    local[..., 3, 3] = 1.0
    scales = np.stack([pose.scales for pose in poses])
    local[..., :3, :3] = np.swapaxes(rotations * scales[:, :, None, :], 0, 1)
    shifts = np.stack([pose.translations for pose in poses])
    moves = np.flatnonzero(skeleton.dof_kinds < _FIRST_ROTATION)
    if len(moves):
        dofs = np.stack([pose.dofs[moves] for pose in poses])
        every = np.arange(len(poses))[:, None]
        np.add.at(shifts, (every, skeleton.dof_joints[moves], skeleton.dof_kinds[moves]), dofs)
    local[..., :3, 3] = np.swapaxes(skeleton.rest_translations + shifts, 0, 1)
    return np.swapaxes(forward_kinematics(skeleton.parents, local), 0, 1)


def palettes(figure: Figure, poses: Sequence[Pose]) -> Floats:
    """Return the skinning matrices of poses of one shape: M[a, j] = W[a, j] inverse(B[j]).

    Parameters
    ----------
    figure : Figure
        With skeleton and skin.
    poses : sequence of A Pose
        At least one; their shape is that of the first.

    Returns
    -------
    (A, J, 4, 4)
        Bind-to-posed matrices; the figure's own place is not part of them.
    """
    figure = shaped(figure, poses[0].shape_weights)
    assert figure.skeleton is not None and figure.skin is not None  # the caller looked
    return skinning_matrices(worlds(figure.skeleton, poses), figure.skin.inverse_bind)


def placements(poses: Sequence[Pose]) -> Floats:
    """Return T(figure_translation) S(figure_scale) of poses: (A, 4, 4), applied after skinning."""
    matrices = np.zeros((len(poses), 4, 4))
    matrices[:, [0, 1, 2], [0, 1, 2]] = np.array([pose.figure_scale for pose in poses])[:, None]
    matrices[:, :3, 3] = [pose.figure_translation for pose in poses]
    matrices[:, 3, 3] = 1.0
    return matrices
