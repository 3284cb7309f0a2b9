"""Feature of MHR: a sparse linear layer of joint rotations with a ReLU.

The input has six numbers for each joint from the third on: the first two columns of its rotation
relative to its rest, minus those of the identity. ``MHRPoseCorrectivesModel`` of the Momentum Human
Rig::

    h = max(0, W x)
"""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rig.arrays import Floats, Ints, frozen
from viewer.rig.geometry.rotation import quaternion_to_matrix
from viewer.rig.pose import Pose, joint_rotations
from viewer.rig.skeleton import Skeleton

__all__ = ["NetworkFeature"]

_FIRST = 2  # joints before this index position the whole body
_WIDTH = 6


@dataclass(frozen=True, slots=True, eq=False)
class NetworkFeature:
    """The sparse layer.

    Attributes
    ----------
    n_joints : int
        Number of joints of the skeleton, J.
    n_weights : int
        Number of outputs, P.
    outputs, inputs : (N,) int32
        Row and column of each entry of the (P, 6 (J - 2)) matrix.
    entries : (N,)
        Value of each entry.
    """

    n_joints: int
    n_weights: int
    outputs: Ints
    inputs: Ints
    entries: Floats

    def __post_init__(self) -> None:
        for name, dtype in (("outputs", np.int32), ("inputs", np.int32), ("entries", np.float64)):
            values = frozen(name, getattr(self, name), (len(self.outputs),), dtype)
            object.__setattr__(self, name, values)
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
