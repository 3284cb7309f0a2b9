"""Poses: DOFs, local transforms, shape weights and placement of one figure."""

from __future__ import annotations

from dataclasses import field
from typing import NamedTuple

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats
from viewer.rig.constraints.evaluation import constrained_matrices
from viewer.rig.geometry.axis_products import AxisProducts, axis_products
from viewer.rig.geometry.rotation import quaternion_to_matrix
from viewer.rig.memo import Memo
from viewer.rig.number_key import NumberKey
from viewer.rig.posed_skeleton import PosedSkeleton
from viewer.rig.skeleton import FIRST_ROTATION, Skeleton, clamp_dofs

__all__ = [
    "Pose",
    "PoseKey",
    "dof_rotations",
    "joint_rotations",
    "local_matrices",
    "placement_matrix",
    "pose_key",
    "pose_of",
    "rest_pose",
]

_orders: Memo[Skeleton, AxisProducts] = Memo()


@dataclass(slots=True, eq=False)
class Pose:
    """The mutable state of one figure; arrays are changed in place.

    Attributes
    ----------
    dofs : (D,)
        Lengths or radians.
    translations : (J, 3)
        Offsets from the skeleton's rest translations, which follow the figure's shape.
    rotations, scales : (J, 4), (J, 3)
        Local rotations before the DOFs, as quaternions (x, y, z, w), and local scale factors.
    shape_weights : (S,)
        Weights of the figure's blend shapes; missing trailing weights are treated as 0.
    figure_scale : float
        Scale of the whole skinned figure about its origin, applied after skinning.
    figure_translation : (3,)
        Translation of the whole skinned figure, applied after its scale.
    posed : PosedSkeleton or None
        Cached matrices; up to date if they have the key of the current values.
    """

    dofs: Floats
    translations: Floats
    rotations: Floats
    scales: Floats
    shape_weights: Floats = field(default_factory=lambda: np.zeros(0))
    figure_scale: float = 1.0
    figure_translation: Floats = field(default_factory=lambda: np.zeros(3))
    posed: PosedSkeleton | None = field(default=None, init=False, repr=False)
    _key: NumberKey | None = field(default=None, init=False, repr=False)

    @property
    def skinning_key(self) -> NumberKey:
        """Key of all values except the figure's placement, the same object until a value changes.

        Poses with equal keys have the same joints and need no second skinning.
        """
        arrays = self.dofs, self.translations, self.rotations, self.scales, self.shape_weights
        self._key = NumberKey(*arrays) if self._key is None else self._key.updated(*arrays)
        return self._key

    def copy(self) -> Pose:
        """Return a pose that shares no array with this one."""
        return Pose(
            dofs=self.dofs.copy(),
            translations=self.translations.copy(),
            rotations=self.rotations.copy(),
            scales=self.scales.copy(),
            shape_weights=self.shape_weights.copy(),
            figure_scale=self.figure_scale,
            figure_translation=self.figure_translation.copy(),
        )


class PoseKey(NamedTuple):
    """All values of a pose at one moment, to compare and to restore; see ``pose_of``.

    Attributes
    ----------
    numbers : NumberKey
        The pose's ``skinning_key``.
    scale : float
        The pose's ``figure_scale``.
    translation : tuple of 3 floats
        The pose's ``figure_translation``.
    """

    numbers: NumberKey
    scale: float
    translation: tuple[float, ...]


def pose_key(pose: Pose) -> PoseKey:
    """Return a key that identifies the pose. Nothing is copied unless a value has changed."""
    return PoseKey(pose.skinning_key, pose.figure_scale, tuple(pose.figure_translation.tolist()))


def pose_of(key: PoseKey) -> Pose:
    """Return a new pose with the values of a key."""
    numbers = key.numbers
    return Pose(
        dofs=numbers.array(0),
        translations=numbers.array(1).reshape(-1, 3),
        rotations=numbers.array(2).reshape(-1, 4),
        scales=numbers.array(3).reshape(-1, 3),
        shape_weights=numbers.array(4),
        figure_scale=key.scale,
        figure_translation=np.array(key.translation),
    )


def placement_matrix(pose: Pose) -> Floats:
    """Return T(figure_translation) S(figure_scale): (4, 4), applied after skinning."""
    matrix = np.eye(4)
    matrix[:3, :3] *= pose.figure_scale
    matrix[:3, 3] = pose.figure_translation
    return matrix


def rest_pose(skeleton: Skeleton) -> Pose:
    """Return a new pose with the values stored in the file, clamped to the limits.

    Parameters
    ----------
    skeleton : Skeleton
        Provides the rest transforms and DOF values.

    Returns
    -------
    Pose
        Pose that shares no array with the skeleton.
    """
    return Pose(
        dofs=clamp_dofs(skeleton, skeleton.rest_dofs),
        translations=np.zeros((skeleton.n_joints, 3)),
        rotations=skeleton.rest_rotations.copy(),
        scales=skeleton.rest_scales.copy(),
    )


def local_matrices(skeleton: Skeleton, pose: Pose) -> Floats:
    """Build each joint's matrix: L = T(rest + translation + DOFs) R(quaternion) R(DOFs) S(scale).

    The rotations of the DOF table are multiplied so that the first row is applied first: rows x, y,
    z give R(DOFs) = Rz Ry Rx (CSE169 course notes, "rotation about x first, then y, then z").
    Joints with a constraint follow their source instead.

    Parameters
    ----------
    skeleton : Skeleton
        Provides the DOF table.
    pose : Pose
        DOFs in lengths and radians.

    Returns
    -------
    (J, 4, 4)
        Joint-to-parent matrices.
    """
    local = np.zeros((skeleton.n_joints, 4, 4))
    local[:, 3, 3] = 1.0
    local[:, :3, 3] = skeleton.rest_translations + pose.translations
    moves = np.flatnonzero(skeleton.dof_kinds < FIRST_ROTATION)
    if len(moves):
        # A joint may have several translation DOFs along one axis: unlike +=, add.at sums them all.
        entries = skeleton.dof_joints[moves], skeleton.dof_kinds[moves]
        np.add.at(local[:, :3, 3], entries, pose.dofs[moves])
    if skeleton.posing is not None:
        local[:, :3, 3] += skeleton.posing.translations(pose.dofs)
    rotations = constrained_matrices(
        skeleton, joint_rotations(skeleton, pose), local[:, :3, 3], pose.scales
    )
    local[:, :3, :3] = rotations * pose.scales[:, None, :]
    return local


def joint_rotations(skeleton: Skeleton, pose: Pose) -> Floats:
    """Return each joint's rotation relative to its parent, R(quaternion) R(DOFs): (J, 3, 3).

    Constraints are not applied: these are the rotations that the pose specifies.
    """
    return quaternion_to_matrix(pose.rotations) @ dof_rotations(skeleton, pose.dofs)


def dof_rotations(skeleton: Skeleton, dofs: Floats) -> Floats:
    """Multiply the rotation DOFs of every joint, one row of all joints at a time.

    Parameters
    ----------
    skeleton : Skeleton
        Provides the DOF table.
    dofs : (..., D)
        Lengths and radians, of any number of poses.

    Returns
    -------
    (..., J, 3, 3)
        The first row of a joint is applied first.
    """
    if skeleton.posing is not None:
        return skeleton.posing.rotations(dofs)
    return _order_of(skeleton).at(dofs)


def _order_of(skeleton: Skeleton) -> AxisProducts:
    def order() -> AxisProducts:
        rows = np.flatnonzero(skeleton.dof_kinds >= FIRST_ROTATION)
        axes = skeleton.dof_kinds[rows] - FIRST_ROTATION
        return axis_products(skeleton.n_joints, skeleton.dof_joints[rows], axes, rows)

    return _orders.get(skeleton, None, order)
