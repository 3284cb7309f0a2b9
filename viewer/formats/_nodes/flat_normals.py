"""Normals of primitives that have none: flat shading, as glTF prescribes."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from viewer.rig.arrays import Floats, Ints
from viewer.rig.mesh import triangle_areas, vertex_normals

__all__ = ["Shading", "flat_shaded"]

Shading: TypeAlias = tuple[Ints, Ints, Floats, bool]
"""Result of ``flat_shaded``."""

_MOST_TRIANGLES = 200_000
# Grid cells per unit of normal components: faces within half a degree share a normal.
_CELLS = 128


def flat_shaded(positions: Floats, triangles: Ints) -> Shading:
    """Split vertices between faces with different normals.

    Coplanar faces keep a common vertex, so a cube has 24 vertices. Large primitives are shaded
    smoothly instead, because they could become six times as large.

    Parameters
    ----------
    positions : (V, 3)
        Any unit.
    triangles : (T, 3)
        Vertex indices, counter-clockwise from outside.

    Returns
    -------
    sources : (R,) int32
        Original of each split vertex; vertices without triangles are included.
    triangles : (T, 3) int32
        Indices into the split vertices.
    normals : (R, 3)
        Unit normals.
    is_flat : bool
        Whether the vertices were split.
    """
    if len(triangles) > _MOST_TRIANGLES:
        sources = np.arange(len(positions), dtype=np.int32)
        return sources, triangles, vertex_normals(positions, triangles), False
    a, b, c = (positions[triangles[:, corner]] for corner in range(3))
    normals = np.cross(b - a, c - a)
    doubled = 2.0 * triangle_areas(positions, triangles)
    normals /= np.where(doubled == 0.0, 1.0, doubled)[:, None]
    cells = np.rint(normals * _CELLS).astype(np.int64) + _CELLS
    side = 2 * _CELLS + 1
    directions = (cells[:, 0] * side + cells[:, 1]) * side + cells[:, 2]
    corners = triangles.ravel().astype(np.int64)
    pairs = corners * side**3 + np.repeat(directions, 3)
    unique, inverse = np.unique(pairs, return_inverse=True)
    unused = np.setdiff1d(np.arange(len(positions)), corners)
    sources = np.concatenate([unique // side**3, unused]).astype(np.int32)
    split = inverse.reshape(-1, 3).astype(np.int32)
    return sources, split, vertex_normals(positions[sources], split), True
