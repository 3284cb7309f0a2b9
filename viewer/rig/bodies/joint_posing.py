"""Joints whose DOFs are not Euler angles but parameters of other rules."""

from __future__ import annotations

from typing import Protocol

from viewer.rig.arrays import Floats

__all__ = ["JointPosing"]


class JointPosing(Protocol):
    """Rules that replace the rotation DOFs of a skeleton about x, y and z; immutable."""

    def rotations(self, dofs: Floats) -> Floats:
        """Return each joint's rotation relative to its rest: (..., J, 3, 3) for (..., D)."""

    def translations(self, dofs: Floats) -> Floats:
        """Return the translation of each joint relative to its parent: (..., J, 3)."""

    def with_joints(self, joints: Floats) -> JointPosing:
        """Return the rules for other rest joints, (J, 3), figure units."""
