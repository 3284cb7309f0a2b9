"""Feature of SKEL: SMPL's correctives, driven by the anatomical joints nearest to SMPL's."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats
from viewer.rig.pose import Pose, joint_rotations
from viewer.rig.skeleton import Skeleton

__all__ = ["MappedFeature"]


@dataclass(frozen=True, slots=True)
class MappedFeature:
    """Nine entries of R - I for each joint of another model, as in SMPL.

    Attributes
    ----------
    targets : tuple of J int
        Joint of the other model that each joint drives; 0, its root, drives nothing. If several
        joints have the same target, the last one drives it.
    n_targets : int
        Number of joints of the other model.
    """

    targets: tuple[int, ...]
    n_targets: int

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
