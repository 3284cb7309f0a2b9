"""Conversion between poses and a model's own pose vectors, by the offset of each joint."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Bools, Floats, Ints, freeze_fields
from viewer.rigs.geometry.rotation import (
    axis_rotations,
    matrix_to_euler,
    matrix_to_rotation_vector,
    rotation_vector_to_matrix,
)
from viewer.rigs.pose import Pose, joint_rotations, set_joint_rotations
from viewer.rigs.skeleton import Skeleton, clamp_dofs


@dataclass(frozen=True, slots=True, eq=False)
class PoseLayout:
    """Layout of the pose vector in a model's files."""

    n_numbers: int
    """Length of the vector."""
    starts: Ints
    """(J,) int32. Index of the first of each joint's three rotation values."""
    is_euler: Bools
    """(J,) bool. True for angles about z, y, x with R = Rz Ry Rx, False for a rotation vector."""
    translation: int = -1
    scale: int = -1
    """Index of the figure's translation (three values) and scale (one); -1 for none."""

    def __post_init__(self) -> None:
        freeze_fields(self, np.int32, starts=(None,))
        freeze_fields(self, np.bool_, is_euler=(len(self.starts),))


def own_numbers(layout: PoseLayout, rotations: Floats) -> Floats:
    """Return rotations (J, 3, 3) as three values a joint (J, 3), as in the model's files."""
    numbers = matrix_to_rotation_vector(rotations)
    numbers[layout.is_euler] = matrix_to_euler(rotations[layout.is_euler])[:, ::-1]
    return numbers


def write_vector(layout: PoseLayout | None, skeleton: Skeleton, pose: Pose) -> Floats:
    """Return a pose as the model's own vector (N,); ``layout`` is None if that is its DOFs."""
    if layout is None:
        return pose.dofs.copy()
    vector = np.zeros(layout.n_numbers)
    rotations = joint_rotations(skeleton, pose)
    vector[layout.starts[:, None] + np.arange(3)] = own_numbers(layout, rotations)
    if layout.translation >= 0:
        vector[layout.translation : layout.translation + 3] = pose.figure_translation
    if layout.scale >= 0:
        vector[layout.scale] = pose.figure_scale
    return vector


def read_vector(layout: PoseLayout | None, skeleton: Skeleton, pose: Pose, vector: Floats) -> None:
    """Set a pose, except its shape, from the model's vector (N,); RigError if N is wrong."""
    wanted = skeleton.n_dofs if layout is None else layout.n_numbers
    if len(vector) != wanted:
        raise RigError(f"expected {wanted} pose numbers, found {len(vector)}")
    if layout is None:
        pose.dofs[:] = clamp_dofs(skeleton, vector)
        return
    numbers = vector[layout.starts[:, None] + np.arange(3)]
    rotations = rotation_vector_to_matrix(numbers)
    if layout.is_euler.any():
        z, y, x = (axis_rotations(2 - axis, numbers[layout.is_euler, axis]) for axis in range(3))
        rotations[layout.is_euler] = z @ y @ x
    joints = np.arange(skeleton.n_joints, dtype=np.int32)
    set_joint_rotations(skeleton, pose, joints, rotations)
    if layout.translation >= 0:
        pose.figure_translation[:] = vector[layout.translation : layout.translation + 3]
    if layout.scale >= 0:
        pose.figure_scale = float(vector[layout.scale])
