"""Winding numbers of a surface around points: 1 inside a closed mesh, 0 outside."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats, Ints

__all__ = ["winding_numbers"]

_BLOCK = 1 << 20  # point-triangle pairs per batch, about 200 bytes each


def winding_numbers(positions: Floats, triangles: Ints, points: Floats) -> Floats:
    """Return the solid angle of a mesh seen from points, over 4 pi.

    A triangle a, b, c seen from the origin covers the angle W with tan(W / 2) = a . (b x c) /
    (|a||b||c| + (a . b)|c| + (b . c)|a| + (c . a)|b|) (Van Oosterom and Strackee 1983). Holes
    make the sum a fraction (Jacobson, Kavan, Sorkine-Hornung 2013), negative if the mesh is
    inside out: compare the absolute value with one half to test for the inside.

    Parameters
    ----------
    positions : (V, 3)
        Any unit.
    triangles : (T, 3)
        Vertex indices, counter-clockwise from outside.
    points : (N, 3)
        Points to test, none of them on the surface.

    Returns
    -------
    (N,)
        Unitless.
    """
    total = np.zeros(len(points))
    step = max(1, _BLOCK // max(1, len(points)))
    for first in range(0, len(triangles), step):
        corners = positions[triangles[first : first + step]]
        a, b, c = (corners[None, :, k] - points[:, None] for k in range(3))
        la, lb, lc = (np.linalg.norm(side, axis=2) for side in (a, b, c))
        above = np.einsum("nta,nta->nt", a, np.cross(b, c))
        below = la * lb * lc + _dot(a, b) * lc + _dot(b, c) * la + _dot(c, a) * lb
        total += np.arctan2(above, below).sum(axis=1)
    return total / (2.0 * np.pi)


def _dot(a: Floats, b: Floats) -> Floats:
    return np.einsum("nta,nta->nt", a, b)
