"""Detection and reversal of parts of a target whose triangles are wound the wrong way.

A part whose normals are opposite to the template's may be a lining, which is correct. It is an
error if it encloses a volume, or if it makes up most of the target.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from viewer.autorig.surface.welding import Welded
from viewer.rig.arrays import Bools, Ints
from viewer.rig.mesh import Mesh, vertex_normals

__all__ = ["with_reversed_winding", "wound_backwards"]

# Squared number of border edges per triangle, below which the volume's sign is reliable.
_CLOSED = 0.25
_MOST = 0.5  # fraction of the target's area above which an island is reversed


def wound_backwards(target: Welded, facing_away: Ints) -> Bools:
    """Return the vertices of parts whose triangles should be reversed.

    Parameters
    ----------
    target : Welded
        W welded vertices that represent V.
    facing_away : (I,)
        Islands that face away from the template's surface.

    Returns
    -------
    (V,) bool
        Vertices of islands with a negative volume, sum a . (b x c) / 6 about their middle, that
        are closed except for small holes, or have more than half of the area.
    """
    count = target.n_islands
    of = target.islands[target.triangles[:, 0]]
    corners = target.positions[target.triangles]
    members = np.bincount(of, minlength=count)
    sums = [np.bincount(of, corners[:, :, k].mean(axis=1), minlength=count) for k in range(3)]
    middle = np.stack(sums, axis=1) / np.maximum(members, 1)[:, None]
    a, b, c = (corners[:, k] - middle[of] for k in range(3))
    volumes = np.bincount(of, np.einsum("ta,ta->t", a, np.cross(b, c)), minlength=count)
    areas = np.bincount(of, np.linalg.norm(np.cross(b - a, c - a), axis=1), minlength=count)
    is_whole = _border_edges(target, of) ** 2 <= _CLOSED * members
    is_most = areas > _MOST * areas.sum()
    wrong = (volumes < 0.0) & (is_whole | is_most)
    chosen = np.isin(np.arange(count), facing_away) & wrong
    return chosen[target.islands][target.vertices]


def with_reversed_winding(mesh: Mesh, vertices: Bools) -> Mesh:
    """Return a mesh with the triangles at some vertices reversed, and with matching normals.

    Parameters
    ----------
    mesh : Mesh
        V vertices.
    vertices : (V,) bool
        Vertices of whole parts.
    """
    rows = np.logical_or.reduce(vertices[mesh.triangles], axis=1)
    if not rows.any():
        return mesh
    triangles = _reversed(mesh.triangles, rows)
    uvs = None if mesh.uv_triangles is None else _reversed(mesh.uv_triangles, rows)
    normals = vertex_normals(mesh.positions, triangles)
    return replace(mesh, triangles=triangles, uv_triangles=uvs, normals=normals)


def _reversed(triangles: Ints, rows: Bools) -> Ints:
    return np.where(rows[:, None], triangles[:, ::-1], triangles)


def _border_edges(target: Welded, of: Ints) -> Any:
    """Return the number of edges of each island that belong to only one triangle."""
    edges = target.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    low, high = edges.min(axis=1).astype(np.int64), edges.max(axis=1)
    _, first, counts = np.unique(
        low * len(target.positions) + high, return_index=True, return_counts=True
    )
    return np.bincount(of[first[counts == 1] // 3], minlength=target.n_islands)
