"""Spring joints of a skeleton and the shapes with which they collide, as in VRM."""

from __future__ import annotations

from dataclasses import field

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Floats, Ints, freeze_fields, frozen

OUTSIDE, INSIDE, PLANE = 0, 1, 2
"""Kinds of colliders."""


@dataclass(frozen=True, slots=True, eq=False)
class Colliders:
    """Spheres, capsules and planes that follow joints."""

    joints: Ints
    """(C,) int32. Joint that each shape follows."""
    offsets: Floats
    tails: Floats
    """(C, 3). Centres of both ends in joint space; equal for a sphere. For a plane, a point on it
    and the same point moved by its normal."""
    radii: Floats
    """(C,). Scene units; joints do not scale them. 0 for a plane."""
    kinds: Ints = ()  # type: ignore[assignment]  # converted to an array below
    """(C,) int32. ``OUTSIDE``, ``INSIDE`` or ``PLANE``: points stay outside of the shape, inside
    it, or on the side of a plane to which its normal points. Empty if all are ``OUTSIDE``."""

    def __post_init__(self) -> None:
        count = len(self.joints)
        kinds = self.kinds if len(self.kinds) else np.zeros(count, np.int32)
        object.__setattr__(self, "kinds", frozen("kinds", kinds, (count,), np.int32))
        freeze_fields(self, offsets=(count, 3), tails=(count, 3), radii=(count,))
        freeze_fields(self, np.int32, joints=(count,))

    @property
    def n_colliders(self) -> int:
        """Number of shapes, C."""
        return len(self.joints)


def _no_colliders() -> Colliders:
    return Colliders(np.zeros(0, np.int32), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))


@dataclass(frozen=True, slots=True, eq=False)
class Springs:
    """Joints whose rotation is determined by the inertia of a point below them."""

    joints: Ints
    """(N,) int32. The spring joints, each listed once."""
    tails: Floats
    """(N, 3). The point that swings, in the rest space of the joint."""
    stiffness: Floats
    """(N,). Speed towards the rest direction, scene units per second."""
    drags: Floats
    """(N,). Fraction of the speed that is lost in each step, 0 to 1."""
    gravities: Floats
    """(N, 3). Constant speed in figure space, per second."""
    radii: Floats
    """(N,). Radius of the colliding sphere around the point."""
    centers: Ints
    """(N,) int32. Joint relative to which inertia is evaluated; -1 for figure space."""
    colliders: Colliders = field(default_factory=_no_colliders)
    """Shapes of the figure."""
    obstacles: tuple[tuple[int, ...], ...] = ()
    """Indices of the colliders that each point avoids, in this order."""
    n_chains: int = 1
    """Number of chains in the file."""

    def __post_init__(self) -> None:
        count = len(self.joints)
        freeze_fields(self, tails=(count, 3), gravities=(count, 3))
        freeze_fields(self, stiffness=(count,), drags=(count,), radii=(count,))
        freeze_fields(self, np.int32, joints=(count,), centers=(count,))
        if len(np.unique(self.joints)) != count:
            raise RigError("springs: expected each joint once")
        if not self.obstacles:
            object.__setattr__(self, "obstacles", ((),) * count)
        indices = {index for listed in self.obstacles for index in listed}
        if len(self.obstacles) != count or not indices <= {*range(self.colliders.n_colliders)}:
            raise RigError("springs: expected indices of colliders for each joint")

    @property
    def n_joints(self) -> int:
        """Number of spring joints, N."""
        return len(self.joints)
