"""Feature of STAR and SUPR: a quaternion for each joint, and a shape coefficient in STAR.

Osman et al. 2020 (STAR), eq. 3, and Osman et al. 2022 (SUPR), eq. 5: the correctives of a joint are
driven by the four numbers (x, y, z, w - 1) of its unit quaternion, which are 0 at rest.
"""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats
from viewer.rig.geometry.rotation import matrix_to_quaternion
from viewer.rig.pose import Pose, joint_rotations
from viewer.rig.skeleton import Skeleton

__all__ = ["QuaternionFeature"]


@dataclass(frozen=True, slots=True)
class QuaternionFeature:
    """Quaternions of joints, with w >= 0, and optionally the weight of one blend shape.

    Attributes
    ----------
    n_joints : int
        Number of joints of the skeleton, J.
    has_root : bool
        Whether the root's quaternion is included, as in SUPR.
    shape : int
        Blend shape whose weight comes last, as in STAR; -1 for none.
    """

    n_joints: int
    has_root: bool
    shape: int = -1

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
