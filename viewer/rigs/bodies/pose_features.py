"""Features: weights of a body model's correctives as functions of the pose.

Every body model drives its pose correctives, offsets of the rest mesh, by other numbers:

- SMPL by the nine entries of R - I of each joint (``None`` instead of a feature, see
  ``Correctives``), SKEL by those of the joint nearest to SMPL's: ``MappedFeature``,
- STAR and SUPR by the quaternions of the joints: ``QuaternionFeature``,
- MHR by a sparse linear layer with a ReLU: ``NetworkFeature``.

All numbers are 0 in the rest pose.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Floats, Ints, freeze_fields
from viewer.rigs.geometry.rotation import matrix_to_quaternion, quaternion_to_matrix
from viewer.rigs.pose import Pose, joint_rotations
from viewer.rigs.skeleton import Skeleton

_FIRST = 2  # joints of MHR before this index position the whole body
_WIDTH = 6  # numbers per joint of MHR: two columns of its rotation


class Feature(Protocol):
    """Weights of pose correctives as a function of the pose; immutable."""

    @property
    def n_weights(self) -> int:
        """Number of weights, P."""

    def weights(self, skeleton: Skeleton, pose: Pose) -> Floats:
        """Return the weights (P,) of a pose of the shaped figure's skeleton."""


@dataclass(frozen=True, slots=True)
class MappedFeature:
    """SKEL: nine entries of R - I for each joint of SMPL, from SKEL's nearest joint."""

    targets: tuple[int, ...]
    """Joint of the other model that each joint drives; 0, its root, drives nothing. If several
    joints have the same target, the last one drives it."""
    n_targets: int
    """Number of joints of the other model."""

    @property
    def n_weights(self) -> int:
        """Number of weights, P."""
        return 9 * (self.n_targets - 1)

    def weights(self, skeleton: Skeleton, pose: Pose) -> Floats:
        """Return the weights of a pose: (P,)."""
        found = np.zeros((self.n_targets, 3, 3))
        rotations = joint_rotations(skeleton, pose) - np.eye(3)
        for target, rotation in zip(self.targets, rotations, strict=True):
            found[target] = rotation
        return found[1:].reshape(-1)


@dataclass(frozen=True, slots=True)
class QuaternionFeature:
    """STAR and SUPR: quaternions of joints, and in STAR the weight of a blend shape.

    Osman et al. 2020 (STAR), eq. 3, and Osman et al. 2022 (SUPR), eq. 5: a joint contributes the
    four numbers (x, y, z, w - 1) of its unit quaternion with w >= 0.
    """

    n_joints: int
    """Number of joints of the skeleton, J."""
    has_root: bool
    """Whether the root's quaternion is included, as in SUPR."""
    shape: int = -1
    """Blend shape whose weight comes last, as in STAR; -1 for none."""

    @property
    def n_weights(self) -> int:
        """Number of weights, P."""
        return 4 * (self.n_joints - (not self.has_root)) + (self.shape >= 0)

    def weights(self, skeleton: Skeleton, pose: Pose) -> Floats:
        """Return the weights of a pose: (P,)."""
        rotations = joint_rotations(skeleton, pose)[0 if self.has_root else 1 :]
        quaternions = matrix_to_quaternion(rotations)
        quaternions *= np.where(quaternions[:, 3:] < 0.0, -1.0, 1.0)
        quaternions[:, 3] -= 1.0
        if self.shape < 0:
            return quaternions.reshape(-1)
        given = pose.shape_weights[self.shape : self.shape + 1]
        return np.append(quaternions.reshape(-1), given if len(given) else 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class NetworkFeature:
    """MHR: a sparse linear layer of joint rotations with a ReLU, h = max(0, W x).

    The input x has six numbers for each joint from the third on: the first two columns of its
    rotation relative to its rest, minus those of the identity (``MHRPoseCorrectivesModel`` of the
    Momentum Human Rig).
    """

    n_joints: int
    """Number of joints of the skeleton, J."""
    n_weights: int
    """Number of outputs, P."""
    outputs: Ints
    inputs: Ints
    """(N,) int32. Row and column of each entry of the (P, 6 (J - 2)) matrix."""
    entries: Floats
    """(N,). Value of each entry."""

    def __post_init__(self) -> None:
        count = len(self.outputs)
        freeze_fields(self, np.int32, outputs=(count,), inputs=(count,))
        freeze_fields(self, entries=(count,))
        ends = {"outputs": self.n_weights, "inputs": _WIDTH * max(self.n_joints - _FIRST, 0)}
        for name, end in ends.items():
            values = getattr(self, name)
            if len(values) and not 0 <= values.min() <= values.max() < end:
                raise RigError(f"{name}: expected indices 0 to {end - 1}")

    def weights(self, skeleton: Skeleton, pose: Pose) -> Floats:
        """Return the weights of a pose: (P,)."""
        beneath = np.swapaxes(quaternion_to_matrix(skeleton.rest_rotations), 1, 2)
        rotations = (beneath @ joint_rotations(skeleton, pose))[_FIRST:] - np.eye(3)
        columns = np.swapaxes(rotations[..., :2], -1, -2).reshape(-1)
        terms = self.entries * columns[self.inputs]
        sums = np.bincount(self.outputs, terms, minlength=self.n_weights)
        return np.maximum(sums, 0.0)
