"""Model parameters of Momentum rigs: a linear map to the parameters of all joints.

Each joint has seven parameters: translation, rotation about x, y and z in this order, and scale::

    joint parameters = transform @ model parameters        scale factor = 2 ** s
    local matrix = T(offset + t) R(prerotation) Rz Ry Rx S(2 ** s)
"""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Floats, Ints, freeze_fields
from viewer.rigs.pose import Pose
from viewer.rigs.skeleton import Skeleton

PER_JOINT = 7
"""Number of parameters of a joint."""

_SCALE = 6  # index of the scale among the parameters of a joint


@dataclass(frozen=True, slots=True, eq=False)
class ModelParameters:
    """Parameters that pose and scale a figure."""

    names: tuple[str, ...]
    """Names of the model parameters."""
    transform: Floats
    """(7 J, P). Joint parameters per unit of each model parameter: lengths, radians and octaves."""

    def __post_init__(self) -> None:
        freeze_fields(self, transform=(None, len(self.names)))

    @property
    def count(self) -> int:
        """Number of model parameters, P."""
        return len(self.names)

    def apply(self, skeleton: Skeleton, pose: Pose, values: Floats) -> None:
        """Set the DOFs, translations and scales of a pose in place from parameters (P,)."""
        if len(values) != self.count:
            raise RigError(f"expected {self.count} model parameters, found {len(values)}")
        joints = (self.transform @ values).reshape(-1, PER_JOINT)
        pose.dofs[:] = joints[skeleton.dof_joints, skeleton.dof_kinds]
        pose.translations[:] = 0.0
        pose.rotations[:] = skeleton.rest_rotations
        pose.scales[:] = 2.0 ** joints[:, _SCALE:]


def driven_dofs(transform: Floats) -> tuple[Ints, Ints]:
    """Return the joints and kinds, (D,) int32 each, of DOFs that a (7 J, P) transform drives."""
    driven = transform.any(axis=1).reshape(-1, PER_JOINT)[:, :_SCALE]
    joints, kinds = np.nonzero(driven)
    return joints.astype(np.int32), kinds.astype(np.int32)
