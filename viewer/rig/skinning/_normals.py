"""Normals under blended matrices that scale or shear."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats

_FLAT = 1e-5  # determinant, with entries scaled to at most 1, that rounding may have given its sign


def inverse_transposed(matrices: Floats, normals: Floats) -> Floats:
    """Multiply normals by the inverse transpose of matrices, n' = |det A| A^-T n.

    Formed from the columns a, b, c of A as the cofactor matrix [b x c, c x a, a x b], which is
    det(A) A^-T and stays finite where A is singular. Its sign is that of the inverse transpose:
    outward normals stay outward where a joint mirrors (glTF 2.0, section 3.7.4, likewise turns
    the winding and not the normals).

    ``matrices`` (3, 3, N): one matrix for each normal, with the normals' index last.
    ``normals`` (N, 3): binding space, any length.
    Returns (N, 3): posed, any length.
    """
    largest = np.abs(matrices).max(axis=(0, 1))
    # Only directions count, and entries near 1 neither overflow nor underflow when multiplied.
    a, b, c = np.swapaxes(matrices / np.where(largest > 0.0, largest, 1.0), 0, 1)
    cofactors = _cross(b, c), _cross(c, a), _cross(a, b)
    x, y, z = np.ascontiguousarray(normals.T)
    moved = cofactors[0] * x + cofactors[1] * y + cofactors[2] * z
    mirrored = np.einsum("an,an->n", a, cofactors[0]) < -_FLAT
    return np.where(mirrored, -moved, moved).T


def _cross(a: Floats, b: Floats) -> Floats:
    """Return cross products of (3, N) vectors: numpy's own is slow along the first axis."""
    return np.stack(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )
