"""The selected joint with its position and axes in the scene, for the tools."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.rotation import nearest_rotations
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.kinematics import posed_skeleton
from viewer.rigs.pose import Pose, placement_matrix
from viewer.rigs.scene import Actor
from viewer.rigs.shape import shaped_skeleton
from viewer.rigs.skeleton import Skeleton

Orientation: TypeAlias = Literal["local", "parent", "world"]
"""Whose axes the rings and arrows of a joint have."""


@dataclass(frozen=True, slots=True, eq=False)
class PosedJoint:
    """One joint of a posed and placed actor."""

    skeleton: Skeleton
    """Skeleton of the actor's figure in its current shape."""
    joint: int
    """Index of the joint."""
    placement: Floats
    """Figure space to scene, including the figure's own translation and scale: (4, 4)."""
    world: Floats
    """Joint space to scene, all joints: (J, 4, 4)."""

    @property
    def center(self) -> Floats:
        """Position of the joint: (3,), scene space."""
        return np.asarray(self.world[self.joint, :3, 3])

    @property
    def parent_linear(self) -> Floats:
        """The parent's axes in the scene with their lengths: (3, 3); for a root, the figure's."""
        parent = int(self.skeleton.parents[self.joint])
        return np.asarray((self.placement if parent < 0 else self.world[parent])[:3, :3])

    @property
    def parent_rotation(self) -> Floats:
        """The parent's axes in the scene, orthonormalised: (3, 3)."""
        return _axes(self.parent_linear)

    def rotation_axis(self, axis: Floats) -> Floats:
        """Return a rotation axis (3,) of the parent's frame as a unit vector of the scene."""
        # With the parent's axes A, the scene axis is cof(A) axis: cofactors transform rotation
        # axes correctly even through reflected and stretched frames.
        x, y, z = self.parent_linear.T
        cofactors = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=1)
        return unit(cofactors @ axis)

    def parent_axis(self, axis: Floats) -> Floats:
        """Return a rotation axis of the scene in the parent's frame: (3,), unit."""
        # The inverse of cof(A) is A^T / det A; only its sign matters to a unit vector.
        linear = self.parent_linear
        return unit(linear.T @ axis) * (-1.0 if np.linalg.det(linear) < 0.0 else 1.0)

    def axes(self, orientation: Orientation) -> Floats:
        """Return an orientation's axes in the scene as the columns of a rotation (3, 3)."""
        if orientation == "world":
            return np.eye(3)
        if orientation == "parent":
            return self.parent_rotation
        return _axes(self.world[self.joint, :3, :3])


def _axes(linear: Floats) -> Floats:
    """Return the rotation nearest to a matrix, without its scale or reflection."""
    if abs(np.linalg.det(linear)) < 1e-300:
        return np.eye(3)
    return nearest_rotations(linear)[0]


def posed_joint(actor: Actor, joint: int, pose: Pose | None = None) -> PosedJoint | None:
    """Return a joint in an actor's pose or another one; None if there is no such joint."""
    pose = actor.own_pose if pose is None else pose
    if pose is None or joint < 0:
        return None
    if actor.figure.skeleton is None or joint >= actor.figure.skeleton.n_joints:
        return None
    skeleton = shaped_skeleton(actor.figure, pose.shape_weights)
    placement = actor.placement @ placement_matrix(pose)
    return PosedJoint(skeleton, joint, placement, placement @ posed_skeleton(skeleton, pose).world)
