"""Products of rotations about coordinate axes, several per joint, in a fixed order."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats, Ints

__all__ = ["AxisProducts", "axis_products"]

Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class _Factor:
    """One rotation of each of N joints: R = C + cos(a) D + sin(a) E, nine entries row by row.

    Joints with fewer rotations than others do not appear in the later factors.
    """

    joints: Indices | None  # None for all joints in order
    rows: Indices
    constant: Floats
    cosines: Floats
    sines: Floats

    def at(self, dofs: Floats) -> Floats:
        """Return the rotations at DOFs (..., D): (..., N, 3, 3)."""
        angles = dofs[..., self.rows, None]
        entries = self.constant + np.cos(angles) * self.cosines
        entries += np.sin(angles) * self.sines
        return entries.reshape(*entries.shape[:-1], 3, 3)


class AxisProducts:
    """Order in which the rotation DOFs of each joint are multiplied.

    Parameters
    ----------
    n_joints : int
        J.
    factors : sequence of _Factor
        The first is applied first.
    """

    def __init__(self, n_joints: int, factors: list[_Factor]) -> None:
        self._n_joints, self._factors = n_joints, factors

    def at(self, dofs: Floats) -> Floats:
        """Return the product of each joint's rotations.

        Parameters
        ----------
        dofs : (..., D)
            Rotations in radians; other DOFs are not used.

        Returns
        -------
        (..., J, 3, 3)
            Matrices for column vectors; the identity for joints without rotations.
        """
        result: Floats | None = None
        for factor in self._factors:
            rotations = factor.at(dofs)
            if factor.joints is None:
                result = rotations if result is None else rotations @ result
                continue
            result = self._identities(dofs) if result is None else result
            result[..., factor.joints, :, :] = rotations @ result[..., factor.joints, :, :]
        return self._identities(dofs) if result is None else result

    def _identities(self, dofs: Floats) -> Floats:
        return np.broadcast_to(np.eye(3), (*dofs.shape[:-1], self._n_joints, 3, 3)).copy()


def axis_products(n_joints: int, joints: Ints, axes: Ints, rows: Indices) -> AxisProducts:
    """Return the order of multiplication of rotation DOFs.

    Parameters
    ----------
    n_joints : int
        J.
    joints, axes : (N,)
        Joint and axis (0, 1, 2 for x, y, z) of each rotation; the first one of a joint is applied
        first.
    rows : (N,)
        Index of each rotation in the DOFs.
    """
    factors = []
    for chosen in _by_rank(joints):
        matrices = np.zeros((3, len(chosen), 9))  # constant, cosines, sines
        number, axis = np.arange(len(chosen)), axes[chosen]
        first, second = (axis + 1) % 3, (axis + 2) % 3
        matrices[0, number, 4 * axis] = 1.0
        matrices[1, number, 4 * first] = matrices[1, number, 4 * second] = 1.0
        matrices[2, number, 3 * second + first] = 1.0
        matrices[2, number, 3 * first + second] = -1.0
        of_rank = joints[chosen].astype(np.intp)
        every = np.array_equal(of_rank, np.arange(n_joints))
        factors.append(_Factor(None if every else of_rank, rows[chosen], *matrices))
    return AxisProducts(n_joints, factors)


def _by_rank(joints: Ints) -> list[Indices]:
    """Return the indices of the first entries of all joints, of the second entries, and so on."""
    order = np.argsort(joints, kind="stable")
    ordered = joints[order]
    is_first = np.concatenate([[True], ordered[1:] != ordered[:-1]])[: len(ordered)]
    starts = np.maximum.accumulate(np.where(is_first, np.arange(len(ordered)), 0))
    rank = np.arange(len(ordered)) - starts
    return [order[rank == number] for number in range(int(rank.max(initial=-1)) + 1)]
