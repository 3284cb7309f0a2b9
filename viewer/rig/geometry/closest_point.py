"""The closest point of a triangle mesh to each of many points, exactly.

A k-d tree finds the triangles whose centroids are near. A triangle within distance u of a point
has its centroid within u + r, r being the centroid's distance to the farthest corner; so all
triangles inside that bound are looked at. Long triangles are cut into pieces first, and pieces
of different size go into different trees: one large r would make every search a long one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from viewer.errors import RigError
from viewer.rig._scipy import scipy_part
from viewer.rig.arrays import Bools, Floats, Ints, frozen

__all__ = ["Surface", "SurfacePoints", "interpolate"]

_PAIRS = 1 << 19  # pairs of point and piece looked at together; some 150 bytes each
_LONG = 3.0  # pieces are cut above this many times the median radius
_NEAREST = 8  # pieces asked for at first; four times as many where the bound is not reached
_FLAT = 1e-20  # sin^2 of an angle below which a triangle counts as a segment
# Bounds of radii are rounded up by this much, so that no triangle is missed by a last digit.
_SLACK = 1.0 + 1e-9
_FEW = 10_000  # points for which starting threads takes longer than it saves


@dataclass(frozen=True, slots=True, eq=False)
class SurfacePoints:
    """Points on the triangles of a mesh.

    Attributes
    ----------
    triangles : (N,) int32
        Which triangle each point lies on; of several equally near, any.
    barycentric : (N, 3)
        Weights of its corners, from 0 to 1, adding up to 1.
    positions : (N, 3)
        The points, in the mesh's space.
    distances : (N,)
        From the points asked for, in the mesh's unit.
    """

    triangles: Ints
    barycentric: Floats
    positions: Floats
    distances: Floats

    def __post_init__(self) -> None:
        def put(name: str, shape: tuple[int | None, ...], dtype: type = np.float64) -> None:
            object.__setattr__(self, name, frozen(name, getattr(self, name), shape, dtype))

        put("triangles", (None,), np.int32)
        put("barycentric", (len(self.triangles), 3))
        put("positions", (len(self.triangles), 3))
        put("distances", (len(self.triangles),))


class Surface:
    """A mesh prepared for searches of closest points.

    Parameters
    ----------
    positions : (V, 3)
        Any unit.
    triangles : (T, 3)
        Vertex indices. Triangles without area count as the segment or point they are.

    Raises
    ------
    RigError
        If there is no triangle, an index is out of range, or SciPy is missing.
    """

    def __init__(self, positions: Floats, triangles: Ints) -> None:
        positions = frozen("positions", positions, (None, 3))
        triangles = frozen("triangles", triangles, (None, 3), np.int32)
        if len(triangles) == 0:
            raise RigError("expected a mesh with triangles, found none")
        if triangles.min() < 0 or triangles.max() >= len(positions):
            raise RigError(
                f"triangles: expected vertex indices 0 to {len(positions) - 1}, "
                f"found {triangles.min()} to {triangles.max()}"
            )
        # Far from the origin float64 has fewer digits left for what is near.
        self._center = positions.mean(axis=0)
        self._corners = (positions - self._center)[triangles]
        self._levels = _levels(self._corners)

    def closest(self, points: Floats) -> SurfacePoints:
        """Find the closest point of the surface to each point.

        Parameters
        ----------
        points : (N, 3)
            In the mesh's space.

        Returns
        -------
        SurfacePoints
            One for each point.

        Raises
        ------
        RigError
            If a coordinate is not finite.
        """
        points = frozen("points", points, (None, 3)) - self._center
        found = np.zeros(len(points), dtype=np.int32)
        block = _PAIRS // _NEAREST
        for start in range(0, len(points), block):
            part = slice(start, start + block)
            found[part] = self._search(points[part])
        corners = self._corners[found]
        barycentric = _barycentric(points, corners)
        positions = np.einsum("nk,nka->na", barycentric, corners)
        distances = np.linalg.norm(positions - points, axis=1)
        return SurfacePoints(found, barycentric, positions + self._center, distances)

    def _search(self, points: Floats) -> Ints:
        """Return the closest triangle of each point."""
        best = np.zeros(len(points), dtype=np.int32)
        nearest = np.full(len(points), np.inf)
        for level in self._levels:  # a first guess, which makes the bounds below short
            pieces = level.tree.query(points, workers=_workers(len(points)))[1]
            self._keep_nearer(points, level.triangles[pieces][:, None], best, nearest)
        for level in self._levels:
            pending = np.arange(len(points))
            count = min(_NEAREST, len(level.triangles))
            while len(pending):
                pending = self._look(level, count, points, pending, best, nearest)
                count = min(4 * count, len(level.triangles))
        return best

    def _look(
        self, level: _Level, count: int, points: Floats, pending: Any, best: Ints, nearest: Floats
    ) -> Any:
        """Look at the nearest pieces of some points; return the points that need more."""
        left = []
        block = max(1, _PAIRS // count)
        for start in range(0, len(pending), block):
            part = pending[start : start + block]
            reach = float(nearest[part].max() + level.radius) * _SLACK
            # ``range`` as k keeps the second axis where only one piece is asked for.
            distances, pieces = level.tree.query(
                points[part],
                k=range(1, count + 1),
                distance_upper_bound=reach,
                workers=_workers(len(part)),
            )
            is_piece = pieces < len(level.triangles)  # beyond the reach the tree gives none
            pieces[~is_piece] = 0
            lowest = distances - _SLACK * level.radii[pieces]
            near = is_piece & (lowest < nearest[part, None])
            candidates = np.where(near, level.triangles[pieces], np.int32(-1))
            guess, found = best[part], nearest[part]
            self._keep_nearer(points[part], candidates, guess, found)
            best[part], nearest[part] = guess, found
            reached = ~is_piece[:, -1] | (distances[:, -1] - _SLACK * level.radius > found)
            left.append(part[~reached])
        if count == len(level.triangles):
            return pending[:0]
        return np.concatenate(left)

    def _keep_nearer(self, points: Floats, candidates: Ints, best: Ints, nearest: Floats) -> None:
        """Put the nearest of some candidates (N, K), -1 for none, into best and nearest."""
        rows, columns = np.nonzero(candidates >= 0)
        corners = self._corners[candidates[rows, columns]]
        offsets = points[rows]
        barycentric = _barycentric(offsets, corners)
        offsets -= np.einsum("nk,nka->na", barycentric, corners)
        distances = np.full(candidates.shape, np.inf)
        distances[rows, columns] = np.sqrt(np.einsum("na,na->n", offsets, offsets))
        column = distances.argmin(axis=1)
        every = np.arange(len(points))
        lowest = distances[every, column]
        nearer = lowest < nearest
        best[nearer] = candidates[every, column][nearer]
        nearest[nearer] = lowest[nearer]


def interpolate(found: SurfacePoints, triangles: Ints, values: Any) -> Any:
    """Return values of vertices at points of the surface: x = b0 x_a + b1 x_b + b2 x_c.

    Parameters
    ----------
    found : SurfacePoints
        N points.
    triangles : (T, 3)
        Vertex indices of the same mesh.
    values : (V, ...) array or (V, J) sparse matrix
        Of the mesh's vertices.

    Returns
    -------
    (N, ...) array or (N, J) sparse matrix in rows
        Sparse if ``values`` are.
    """
    corners = triangles[found.triangles]
    if not isinstance(values, np.ndarray):
        sparse = scipy_part("sparse")
        starts = np.arange(len(corners) + 1) * 3
        matrix = sparse.csr_array(
            (found.barycentric.ravel(), corners.ravel(), starts),
            shape=(len(corners), values.shape[0]),
        )
        return sparse.csr_array(matrix @ values)
    shape = (-1,) + (1,) * (values.ndim - 1)
    result = np.zeros((len(corners), *values.shape[1:]))
    for corner in range(3):
        result += found.barycentric[:, corner].reshape(shape) * values[corners[:, corner]]
    return result


@dataclass(frozen=True, slots=True, eq=False)
class _Level:
    """Pieces of similar size: a tree of their centroids, their radii and triangles."""

    tree: Any
    radii: Floats
    triangles: Ints
    radius: float


def _levels(corners: Floats) -> list[_Level]:
    """Sort pieces of triangles (T, 3, 3) into trees by size, each up to twice the last one's."""
    pieces, triangles = _pieces(corners)
    centroids = pieces.mean(axis=1)
    radii = _radii(pieces)
    smallest = float(np.median(radii)) / 2.0
    if smallest > 0.0:
        size = np.ceil(np.log2(np.maximum(radii / smallest, 1.0))).astype(int)
    else:
        size = np.zeros(len(radii), dtype=int)
    spatial = scipy_part("spatial")
    levels = []
    for value in np.unique(size):
        inside = np.nonzero(size == value)[0]
        tree = spatial.cKDTree(centroids[inside])
        largest = float(radii[inside].max())
        levels.append(_Level(tree, radii[inside], triangles[inside], largest))
    return levels


def _pieces(corners: Floats) -> tuple[Floats, Ints]:
    """Halve long triangles across their longest edge; at most double the number, and 1000."""
    pieces, triangles = corners, np.arange(len(corners), dtype=np.int32)
    radii = _radii(pieces)
    limit = _LONG * float(np.median(radii))
    room = len(corners) + 1000
    while room > 0:
        is_long = np.nonzero(radii > limit)[0]
        if len(is_long) == 0:
            break
        if len(is_long) > room:
            is_long = is_long[np.argsort(-radii[is_long], kind="stable")[:room]]
        halves = _halves(pieces[is_long])
        kept = np.delete(np.arange(len(pieces)), is_long)
        pieces = np.concatenate([pieces[kept], *halves])
        triangles = np.concatenate([triangles[kept], triangles[is_long], triangles[is_long]])
        radii = np.concatenate([radii[kept], *map(_radii, halves)])
        room -= len(is_long)
    return pieces, triangles


def _workers(n_points: int) -> int:
    """Return how many threads a tree should be asked with: one, or -1 for all there are."""
    return 1 if n_points < _FEW else -1


def _halves(pieces: Floats) -> tuple[Floats, Floats]:
    edges = np.roll(pieces, -1, axis=1) - pieces  # edge k leads from corner k to the next one
    longest = np.einsum("tka,tka->tk", edges, edges).argmax(axis=1)
    order = (longest[:, None] + np.arange(3)) % 3
    a, b, c = np.moveaxis(np.take_along_axis(pieces, order[:, :, None], axis=1), 1, 0)
    middle = 0.5 * (a + b)
    return np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)


def _radii(pieces: Floats) -> Floats:
    offsets = pieces - pieces.mean(axis=1, keepdims=True)
    return np.sqrt(np.einsum("tka,tka->tk", offsets, offsets).max(axis=1))


def _barycentric(points: Floats, corners: Floats) -> Floats:
    """Return the weights of each triangle's corners (N, 3, 3) at its point closest to a point.

    Inside, the projection onto the plane solves the 2 x 2 normal equations of
    |a + s ab + t ac - p|^2; otherwise the nearest of the three edges has the closest point.
    """
    ab, ac = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    ap = points - corners[:, 0]
    bb, bc, cc = _dot(ab, ab), _dot(ab, ac), _dot(ac, ac)
    pb, pc = _dot(ab, ap), _dot(ac, ap)
    determinant = bb * cc - bc * bc
    s, t = cc * pb - bc * pc, bb * pc - bc * pb
    inside: Bools = (s >= 0.0) & (t >= 0.0) & (s + t <= determinant)
    inside &= determinant > _FLAT * bb * cc
    weights = np.empty_like(points)
    scale = 1.0 / np.where(inside, determinant, 1.0)
    weights[:, 1], weights[:, 2] = s * scale, t * scale
    weights[:, 0] = np.maximum(0.0, 1.0 - weights[:, 1] - weights[:, 2])
    outside = np.nonzero(~inside)[0]
    weights[outside] = _on_edges(points[outside], corners[outside])
    return weights


def _on_edges(points: Floats, corners: Floats) -> Floats:
    """Return the weights of the corners at the closest point of the three edges."""
    best = np.full(len(points), np.inf)
    weights = np.zeros_like(points)
    for start in range(3):
        end = (start + 1) % 3
        edge, offset = corners[:, end] - corners[:, start], points - corners[:, start]
        length = _dot(edge, edge)
        # An edge of length 0 is its first corner.
        along = np.clip(_dot(edge, offset) / np.where(length > 0.0, length, 1.0), 0.0, 1.0)
        offset -= along[:, None] * edge
        distance = _dot(offset, offset)
        nearer = np.nonzero(distance < best)[0]
        best[nearer] = distance[nearer]
        weights[nearer] = 0.0
        weights[nearer, end] = along[nearer]
        weights[nearer, start] = 1.0 - along[nearer]
    return weights


def _dot(a: Floats, b: Floats) -> Floats:
    return np.einsum("na,na->n", a, b)
