"""Shape spaces: rest meshes and joints that are not weighted sums of offsets."""

from __future__ import annotations

from typing import Protocol

from viewer.rig.arrays import Floats

__all__ = ["ShapeSpace"]


class ShapeSpace(Protocol):
    """Displacement of the rest mesh and joints by weights; 0 for weights of 0. Immutable."""

    def displacement(self, weights: Floats) -> Floats:
        """Return the displacement of the rest vertices.

        Parameters
        ----------
        weights : (N,)
            N <= S; missing weights are treated as 0.

        Returns
        -------
        (V, 3)
            Figure units.
        """

    def joint_displacement(self, weights: Floats) -> Floats | None:
        """Return the displacement of the rest joints, (J, 3); None if a regressor moves them."""
