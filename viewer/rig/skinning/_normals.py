"""Normals of vertices, by blended matrices or by their inverse transposes."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Bools, Floats
from viewer.rig.kinematics import are_alike, rigid_sizes
from viewer.rig.skin import Skin

# Smaller determinants, of matrices scaled to entries up to 1, have an unreliable sign.
_FLAT = 1e-5


def rigid_vertices(skin: Skin, palette: Floats) -> Bools:
    """Return which vertices have only joints that rotate, up to one common scale: (V,).

    Their normals follow the blended matrix. Those of all others, whose joints scale or shear,
    follow its inverse transpose. A joint has no effect on normals of vertices that it does not
    influence.
    """
    sizes = rigid_sizes(palette)
    rigid = np.ones(skin.n_vertices, dtype=np.bool_)
    if len(sizes) == 0 or are_alike(sizes.min(), sizes.max()):
        return rigid
    moving = np.flatnonzero(np.diff(skin.starts) > 0)
    if len(moving):
        own, is_used = sizes[skin.joints], skin.weights != 0.0
        edges = skin.starts[moving]
        lowest = np.minimum.reduceat(np.where(is_used, own, np.inf), edges)
        highest = np.maximum.reduceat(np.where(is_used, own, -np.inf), edges)
        with np.errstate(invalid="ignore"):
            rigid[moving] = are_alike(lowest, highest) | (lowest > highest)
    return rigid


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
