"""The closest point of a triangle mesh to each of many points, exactly.

A k-d tree finds the triangles whose centroids are near. A triangle within distance u of a point
has its centroid within u + r, r being the centroid's distance to the farthest corner; so all
triangles inside that bound are looked at. Long triangles are cut into pieces first, and pieces
of different size go into different trees: one large r would make every search a long one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain, pairwise
from typing import Any

import numpy as np

from viewer.errors import RigError
from viewer.rig._scipy import scipy_part
from viewer.rig.arrays import Bools, Floats, Ints, frozen

__all__ = ["Surface", "SurfacePoints", "interpolate"]

_PAIRS = 1 << 19  # pairs of point and piece looked at together; some 150 bytes each
_LONG = 3.0  # pieces are cut above this many times the median radius
_NEAREST = 8  # pieces asked for at first; where that is not all, all within the bound
_POINTS = 1 << 16  # points looked at together
_FLAT = 1e-20  # sin^2 of an angle below which a triangle counts as a segment
# Bounds of radii are rounded up by this much, so that no triangle is missed by a last digit.
_SLACK = 1.0 + 1e-9
_ROUNDED = 1e-12  # and squared distances by this share of the larger ones they are the rest of
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
        self._all, self._levels = _levels(self._corners)

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
        for start in range(0, len(points), _POINTS):
            part = slice(start, start + _POINTS)
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
        # A first guess makes the bounds below short. It is found again there, so that of equally
        # near triangles always the same one is taken.
        pieces = self._all.tree.query(points, workers=_workers(len(points)))[1]
        self._keep_nearer(self._all, points, np.arange(len(points)), pieces, best, nearest)
        nearest = np.nextafter(nearest, np.inf)
        for level in self._levels:
            self._look(level, points, best, nearest)
        return best

    def _look(self, level: _Level, points: Floats, best: Ints, nearest: Floats) -> None:
        """Look at all pieces of a level that may be nearer than what has been found."""
        count = min(_NEAREST, len(level.triangles))
        workers = _workers(len(points))
        reach = float(nearest.max(initial=0.0) + level.radius) * _SLACK
        # ``range`` as k keeps the second axis where only one piece is asked for.
        distances, pieces = level.tree.query(
            points, k=range(1, count + 1), distance_upper_bound=reach, workers=workers
        )
        # Beyond the reach the tree gives none.
        near = (pieces < len(level.triangles)) & (
            distances - _SLACK * level.radii[pieces % len(level.triangles)] < nearest[:, None]
        )
        rows, columns = np.nonzero(near)
        self._keep_nearer(level, points, rows, pieces[rows, columns], best, nearest)
        if count == len(level.triangles):
            return
        farthest = distances[:, -1]  # infinite beyond the reach
        more = np.flatnonzero(farthest - _SLACK * level.radius <= nearest)
        reaches = (nearest[more] + level.radius) * _SLACK
        counts = level.tree.query_ball_point(
            points[more], reaches, return_length=True, workers=workers
        )
        for part in _blocks(counts):
            lists = level.tree.query_ball_point(
                points[more[part]], reaches[part], return_sorted=False, workers=workers
            )
            total = int(counts[part].sum())
            found = np.fromiter(chain.from_iterable(lists), dtype=np.intp, count=total)
            self._keep_nearer(
                level, points, np.repeat(more[part], counts[part]), found, best, nearest
            )

    def _keep_nearer(
        self, level: _Level, points: Floats, rows: Any, pieces: Any, best: Ints, nearest: Floats
    ) -> None:
        """Put the nearest of some pieces, each for a row of points, into best and nearest.

        Of equally near ones that whose centroid is nearest is taken.
        """
        offsets = points[rows] - level.centers[pieces]
        apart = _dot(offsets, offsets)
        kept = np.flatnonzero(_may_be_nearer(level, pieces, offsets, apart, nearest[rows]))
        rows, apart, triangles = rows[kept], apart[kept], level.triangles[pieces[kept]]
        corners, offsets = self._corners[triangles], points[rows]
        offsets -= np.einsum("nk,nka->na", _barycentric(offsets, corners), corners)
        distances = np.sqrt(_dot(offsets, offsets))
        order = np.lexsort((apart, distances, rows))
        found, first = np.unique(rows[order], return_index=True)
        winners = order[first]
        nearer = distances[winners] < nearest[found]
        best[found[nearer]] = triangles[winners[nearer]]
        nearest[found[nearer]] = distances[winners[nearer]]


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
    """Pieces of similar size: a tree of their centroids, their normals, radii and triangles."""

    tree: Any
    centers: Floats
    normals: Floats
    radii: Floats
    triangles: Ints
    radius: float

    @classmethod
    def of(cls, pieces: Floats, triangles: Ints) -> _Level:
        """Return pieces (P, 3, 3) of triangles (P,) ready to be searched."""
        centers, radii = pieces.mean(axis=1), _radii(pieces)
        tree = scipy_part("spatial").cKDTree(centers)
        return cls(tree, centers, _normals(pieces), radii, triangles, float(radii.max()))


def _levels(corners: Floats) -> tuple[_Level, list[_Level]]:
    """Cut triangles (T, 3, 3) into pieces: all of them, and by size, up to twice the last one's."""
    pieces, triangles = _pieces(corners)
    radii = _radii(pieces)
    smallest = float(np.median(radii)) / 2.0
    if smallest > 0.0:
        size = np.ceil(np.log2(np.maximum(radii / smallest, 1.0))).astype(int)
    else:
        size = np.zeros(len(radii), dtype=int)
    parts = (np.nonzero(size == value)[0] for value in np.unique(size))
    levels = [_Level.of(pieces[part], triangles[part]) for part in parts]
    return (levels[0] if len(levels) == 1 else _Level.of(pieces, triangles)), levels


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


def _normals(pieces: Floats) -> Floats:
    """Return the unit normals of pieces (T, 3, 3), 0 for those without area: (T, 3)."""
    normals = np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals /= np.where(lengths > 0.0, lengths, 1.0)
    return normals


def _may_be_nearer(
    level: _Level, pieces: Any, offsets: Floats, apart: Floats, nearest: Floats
) -> Bools:
    """Tell which pieces may be nearer than the nearest so far: all that are, and few others.

    A piece lies in a disc of its radius r around its centroid. With h the height of the point
    above the disc's plane, a the distance from the centroid and s = sqrt(a^2 - h^2), the disc is
    sqrt(h^2 + max(0, s - r)^2) away. From afar that rules out all but the pieces below the point,
    where a - r, the distance from the sphere of that radius, leaves a wide circle of them.
    """
    squared_heights = _dot(offsets, level.normals[pieces]) ** 2
    beside = np.sqrt(np.maximum(apart - squared_heights, 0.0))
    beyond = np.maximum(beside - level.radii[pieces] * _SLACK, 0.0)
    # a^2 is far larger than what is compared where a large triangle is almost touched.
    bound = nearest**2 * _SLACK + _ROUNDED * apart
    result: Bools = squared_heights + beyond**2 <= bound
    return result


def _blocks(counts: Ints) -> Iterator[slice]:
    """Yield slices of points with about as many pairs as may be looked at together."""
    block = np.cumsum(counts) // _PAIRS
    starts = np.flatnonzero(np.diff(block, prepend=-1))
    for start, stop in pairwise([*starts, len(counts)]):
        yield slice(int(start), int(stop))


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
