"""Features: weights of a body model's correctives as functions of the pose."""

from __future__ import annotations

from typing import Protocol

from viewer.rig.arrays import Floats
from viewer.rig.pose import Pose
from viewer.rig.skeleton import Skeleton

__all__ = ["Feature"]


class Feature(Protocol):
    """Weights of pose correctives as a function of the pose; immutable."""

    @property
    def n_weights(self) -> int:
        """Number of weights, P."""

    def weights(self, skeleton: Skeleton, pose: Pose) -> Floats:
        """Return the weights of a pose: (P,).

        Parameters
        ----------
        skeleton : Skeleton
            Skeleton of the shaped figure.
        pose : Pose
            DOFs in lengths and radians.
        """
