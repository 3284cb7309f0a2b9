"""Normals transformed by blended matrices that scale or shear."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats

# Smaller determinants, of matrices scaled to entries up to 1, have an unreliable sign.
_FLAT = 1e-5


def inverse_transposed(matrices: Floats, normals: Floats) -> Floats:
    """Multiply normals by the inverse transpose of matrices, n' = |det A| A^-T n.

    The columns a, b, c of A define the cofactor matrix [b x c, c x a, a x b] = det(A) A^-T, which
    stays finite if A is singular. Its sign is changed to the sign of the inverse transpose, so that
    outward normals stay outward under a reflected joint (likewise, glTF 2.0, section 3.7.4,
    reverses the winding, not the normals). Matrices (3, 3, N) and normals (N, 3) result in normals
    (N, 3) of any length.
    """
    largest = np.abs(matrices).max(axis=(0, 1))
    # Only directions matter, and products of entries near 1 do not overflow or underflow.
    a, b, c = np.swapaxes(matrices / np.where(largest > 0.0, largest, 1.0), 0, 1)
    cofactors = _cross(b, c), _cross(c, a), _cross(a, b)
    x, y, z = np.ascontiguousarray(normals.T)
    moved = cofactors[0] * x + cofactors[1] * y + cofactors[2] * z
    # a . (b x c) is the determinant.
    reflected = np.einsum("an,an->n", a, cofactors[0]) < -_FLAT
    return np.where(reflected, -moved, moved).T


def _cross(a: Floats, b: Floats) -> Floats:
    """Return cross products of (3, N) vectors; ``numpy.cross`` is slow along the first axis."""
    return np.stack(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )
