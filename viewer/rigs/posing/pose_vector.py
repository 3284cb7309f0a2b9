"""Conversion between poses and a model's own pose vectors, by the offset of each joint."""

from __future__ import annotations

from typing import Literal

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Bools, Floats, Ints, freeze_fields
from viewer.rigs.geometry.rotation import (
    axis_rotations,
    matrix_to_euler,
    matrix_to_quaternion,
    matrix_to_rotation_vector,
    quaternion_to_matrix,
    rotation_vector_to_matrix,
)
from viewer.rigs.memo import Memo
from viewer.rigs.pose import Pose, dof_rotations, joint_rotations
from viewer.rigs.skeleton import Skeleton, clamp_dofs

_ball_rows: Memo[Skeleton, Ints] = Memo()


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


def rotation_rows(skeleton: Skeleton) -> Ints:
    """Return ball joints' DOF rows about x, y, z (J, 3); -1 for joints with other rotations."""
    return _ball_rows.get(skeleton, None, lambda: _rows_of_balls(skeleton))


def _rows_of_balls(skeleton: Skeleton) -> Ints:
    rows = np.full((skeleton.n_joints, 3), -1, dtype=np.int32)
    rotations = np.flatnonzero(skeleton.dof_kinds >= 3)
    counts = np.bincount(skeleton.dof_joints[rotations], minlength=skeleton.n_joints)
    rows[skeleton.dof_joints[rotations], skeleton.dof_kinds[rotations] - 3] = rotations
    is_ball = (counts == 3) & (rows >= 0).all(axis=1) & (np.diff(rows, axis=1) > 0).all(axis=1)
    rows[~is_ball] = -1
    rows.flags.writeable = False
    return rows


Beyond = Literal["cut", "dofs", "quaternion"]
"""Where a rotation beyond the limits of a ball joint goes: it is cut off at the limits, the DOFs
exceed them, or the quaternion beneath the DOFs has what they lack."""


def set_joint_rotations(
    skeleton: Skeleton, pose: Pose, joints: Ints, rotations: Floats, beyond: Beyond = "cut"
) -> None:
    """Set joints' rotations (N, 3, 3) relative to parents, in place, as ``rotate_joints`` does."""
    dofs = pose.dofs[None].copy()
    pose.rotations[joints] = rotate_joints(skeleton, dofs, joints, rotations[None], beyond)[0]
    pose.dofs[:] = dofs[0]


def rotate_joints(
    skeleton: Skeleton, dofs: Floats, joints: Ints, rotations: Floats, beyond: Beyond
) -> Floats:
    """Set DOFs (T, D), in place, to rotations (T, N, 3, 3) of joints; return quaternions (T, N, 4).

    A ball joint's DOFs become the angles about x, y, z; other joints keep their DOFs as near to 0
    as limits allow, and the quaternion has the rest.
    """
    joints = np.asarray(joints)
    rows = rotation_rows(skeleton)[joints]
    is_ball = rows[:, 0] >= 0
    # A slice copies nothing.
    balls = slice(None) if is_ball.all() else np.flatnonzero(is_ball)
    rest = skeleton.rest_rotations[joints]
    quaternions = np.broadcast_to(rest, (len(dofs), *rest.shape))
    within = np.swapaxes(quaternion_to_matrix(rest[balls]), -1, -2) @ rotations[:, balls]
    angles = matrix_to_euler(within)
    dofs[:, rows[balls]] = angles
    others = joints[~is_ball]
    if len(others):
        dofs[:, np.isin(skeleton.dof_joints, others) & (skeleton.dof_kinds >= 3)] = 0.0
    if beyond != "dofs":
        np.clip(dofs, *skeleton.dof_limits.T, out=dofs)
    has_rest = np.broadcast_to(~is_ball, quaternions.shape[:-1]).copy()
    if beyond == "quaternion":
        has_rest[:, balls] = (dofs[:, rows[balls]] != angles).any(axis=-1)
    if has_rest.any():
        # R = Q R(DOFs), so Q = R R(DOFs)^T has what the DOFs lack.
        held = dof_rotations(skeleton, dofs)[:, joints]
        left = matrix_to_quaternion(rotations @ np.swapaxes(held, -1, -2))
        quaternions = np.where(has_rest[..., None], left, quaternions)
    return quaternions


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
