"""Vertices common to target and template: a mesh that was edited or sculpted, not remeshed.

If a vertex was moved along the surface, its closest point has interpolated weights, whereas the
original vertex has the exact ones. A target's vertex is identified with a vertex of the template if
each is the nearest vertex to the other, it moved along the surface by less than half the length of
its edges, and nearly all of its edges correspond to edges of the template. A different tessellation
of the same surface has very few such vertices.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from viewer.autorig.surface.welding import Welded, edges
from viewer.rig._scipy import scipy_part
from viewer.rig.arrays import Floats, Ints
from viewer.rig.geometry.closest_point import SurfacePoints

__all__ = ["at_vertices", "same_vertices"]

_EDGES = 0.8  # minimum fraction of a vertex's edges that are also edges of the template
_SLID = 0.5  # maximum shift along the surface, relative to the mean length of a vertex's edges
_FEW = 10_000  # number of points below which starting threads costs more time than it saves


def same_vertices(template: Welded, target: Welded, distances: Floats) -> Ints:
    """Return the template's vertex that corresponds to each vertex of the target, -1 for none.

    Parameters
    ----------
    template, target : Welded
        Meshes in the same space, with U and W vertices.
    distances : (W,)
        Distances of the target's vertices from the template's surface.

    Returns
    -------
    (W,) int64
        Indices; no vertex of the template occurs twice.
    """
    there, far = _nearest(template.positions, target.positions)
    back, _ = _nearest(target.positions, template.positions)
    links, count = edges(target.triangles), len(there)
    degree = np.maximum(np.bincount(links.ravel(), minlength=count), 1)
    lengths = np.linalg.norm(np.diff(target.positions[links], axis=1)[:, 0], axis=1)
    around = np.bincount(links.ravel(), np.repeat(lengths, 2), minlength=count) / degree
    slid = np.sqrt(np.maximum(far**2 - distances**2, 0.0))
    is_near = (back[there] == np.arange(count)) & (slid < _SLID * around)
    same = np.where(is_near, there, -1)
    ends = same[links]
    known = np.isin(_keys(ends, template), _keys(edges(template.triangles), template))
    kept = (ends >= 0).all(axis=1) & known
    found = np.bincount(links[kept].ravel(), minlength=count)
    return np.where(found >= _EDGES * degree, same, -1)


def at_vertices(
    points: SurfacePoints, positions: Floats, corners: Ints, places: Floats, same: Ints
) -> SurfacePoints:
    """Return points of a surface, some of them snapped to vertices.

    Parameters
    ----------
    points : SurfacePoints
        W closest points.
    positions : (W, 3)
        The query points.
    corners : (T, 3)
        The surface's triangles, as indices of its U vertices.
    places : (U, 3)
        Positions of the U vertices.
    same : (W,)
        The vertex to which a point is snapped, or -1.
    """
    rows = np.flatnonzero(same >= 0)
    used, first = np.unique(corners, return_index=True)
    place = np.full(len(places), -1)
    place[used] = first
    rows = rows[place[same[rows]] >= 0]  # a vertex without triangles is not on the surface
    at = place[same[rows]]
    triangles, barycentric = points.triangles.copy(), points.barycentric.copy()
    found, distances = points.positions.copy(), points.distances.copy()
    triangles[rows] = at // 3
    barycentric[rows] = np.eye(3)[at % 3]
    found[rows] = places[same[rows]]
    distances[rows] = np.linalg.norm(found[rows] - positions[rows], axis=1)
    return SurfacePoints(triangles, barycentric, found, distances)


def _nearest(points: Floats, asked: Floats) -> tuple[Any, Floats]:
    tree = scipy_part("spatial").cKDTree(points)
    distances, found = tree.query(asked, workers=1 if len(asked) < _FEW else -1)
    return found, distances


def _keys(pairs: Ints, template: Welded) -> Ints:
    """Return a unique integer for each undirected pair of the template's vertices."""
    low, high = pairs.min(axis=1).astype(np.int64), pairs.max(axis=1)
    keys: Ints = low * len(template.positions) + high
    return keys
