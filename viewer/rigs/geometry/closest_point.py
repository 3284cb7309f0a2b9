"""Exact search for the closest points of a triangle mesh to many points.

A k-d tree finds the triangles whose centroids are near. A triangle within distance u of a point
has its centroid within u + r, where r is the distance from the centroid to the farthest corner,
so all triangles inside that bound are examined. Long triangles are split into pieces first, and
pieces of different sizes go into different trees, as one large r would slow every search down.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain, pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Bools, Floats, Ints, freeze_fields, frozen

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

Indices = NDArray[np.intp]
_PAIRS = 1 << 19  # point-piece pairs per batch, about 150 bytes each
_LONG = 3.0  # multiple of the median radius above which pieces are split
# Pieces in the first query; if more pieces may lie within the bound, a second query finds all of
# them.
_NEAREST = 8
_POINTS = 1 << 16  # number of query points per batch
_FLAT = 1e-20  # sin^2 of the angle below which a triangle is treated as a segment
# Bounds are rounded up by this factor, so that rounding never excludes a triangle.
_SLACK = 1.0 + 1e-9
_ROUNDED = 1e-12  # rounding error of a difference of squared distances, relative to the larger one
_FEW = 10_000  # number of points below which starting threads costs more time than it saves


@dataclass(frozen=True, slots=True, eq=False)
class SurfacePoints:
    """Points on the triangles of a mesh."""

    triangles: Ints
    """(N,) int32. Triangle on which each point lies; any one of several equally close triangles."""
    barycentric: Floats
    """(N, 3). Weights of its corners, from 0 to 1, with a sum of 1."""
    positions: Floats
    """(N, 3). Positions in the mesh's space."""
    distances: Floats
    """(N,). Distances from the query points, in the mesh's unit."""

    def __post_init__(self) -> None:
        freeze_fields(self, np.int32, triangles=(None,))
        count = len(self.triangles)
        freeze_fields(self, barycentric=(count, 3), positions=(count, 3), distances=(count,))


class Surface:
    """A mesh prepared for closest-point queries; degenerate triangles are segments or points."""

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
        # Far from the origin, float64 leaves fewer digits for small distances.
        self._center = positions.mean(axis=0)
        self._corners = (positions - self._center)[triangles]
        self._all, self._levels = _levels(self._corners)

    def closest(self, points: Floats) -> SurfacePoints:
        """Return the closest surface points of (N, 3) points; ``RigError`` if one is not finite."""
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
        # An initial candidate tightens the bounds below. The search finds that triangle again, so
        # that ties between equally close triangles are always resolved in the same way.
        pieces = self._all.tree.query(points, workers=_workers(len(points)))[1]
        self._keep_nearer(self._all, points, np.arange(len(points)), pieces, best, nearest)
        nearest = np.nextafter(nearest, np.inf)
        for level in self._levels:
            self._examine(level, points, best, nearest)
        return best

    def _examine(self, level: _Level, points: Floats, best: Ints, nearest: Floats) -> None:
        """Examine all pieces of a level that may be closer than the closest found so far."""
        count = min(_NEAREST, len(level.triangles))
        workers = _workers(len(points))
        reach = float(nearest.max(initial=0.0) + level.radius) * _SLACK
        # A ``range`` for k keeps the second axis even if only one piece is requested.
        distances, pieces = level.tree.query(
            points, k=range(1, count + 1), distance_upper_bound=reach, workers=workers
        )
        # For neighbours beyond the maximum distance, the tree returns the number of pieces as their
        # index.
        near = (pieces < len(level.triangles)) & (
            distances - _SLACK * level.radii[pieces % len(level.triangles)] < nearest[:, None]
        )
        rows, columns = np.nonzero(near)
        self._keep_nearer(level, points, rows, pieces[rows, columns], best, nearest)
        if count == len(level.triangles):
            return
        farthest = distances[:, -1]  # infinite beyond the maximum distance
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
        self,
        level: _Level,
        points: Floats,
        rows: Indices,
        pieces: Indices,
        best: Ints,
        nearest: Floats,
    ) -> None:
        """Update best and nearest with the closest of pieces, each tested for a row of points."""
        offsets = points[rows] - level.centers[pieces]
        apart = _dot(offsets, offsets)
        kept = np.flatnonzero(_may_be_nearer(level, pieces, offsets, apart, nearest[rows]))
        rows, apart, triangles = rows[kept], apart[kept], level.triangles[pieces[kept]]
        corners, offsets = self._corners[triangles], points[rows]
        offsets -= np.einsum("nk,nka->na", _barycentric(offsets, corners), corners)
        distances = np.sqrt(_dot(offsets, offsets))
        # Each point takes the closest piece; of equally close ones, that with the closest centroid.
        order = np.lexsort((apart, distances, rows))
        found, first = np.unique(rows[order], return_index=True)
        winners = order[first]
        nearer = distances[winners] < nearest[found]
        best[found[nearer]] = triangles[winners[nearer]]
        nearest[found[nearer]] = distances[winners[nearer]]


def interpolate(found: SurfacePoints, triangles: Ints, values: Any) -> Any:
    """Return rows x = b0 x_a + b1 x_b + b2 x_c of values (V, ...), or sparse (V, J), at points."""
    corners = triangles[found.triangles]
    if not isinstance(values, np.ndarray):
        from scipy import sparse

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
    """Pieces of similar size: k-d tree of their centroids, normals, radii and triangles."""

    tree: cKDTree
    centers: Floats
    normals: Floats
    radii: Floats
    triangles: Ints
    radius: float

    @classmethod
    def of(cls, pieces: Floats, triangles: Ints) -> _Level:
        """Return a searchable level of pieces (P, 3, 3) of triangles (P,)."""
        centers, radii = pieces.mean(axis=1), _radii(pieces)
        from scipy import spatial

        tree = spatial.cKDTree(centers)
        return cls(tree, centers, _normals(pieces), radii, triangles, float(radii.max()))


def _levels(corners: Floats) -> tuple[_Level, list[_Level]]:
    """Split triangles (T, 3, 3) into pieces: one level of all, or one per doubling of size."""
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
    """Halve long triangles across their longest edge, at most T + 1000 times."""
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
    """Return the number of threads for a query: 1, or -1 for all processors."""
    return 1 if n_points < _FEW else -1


def _halves(pieces: Floats) -> tuple[Floats, Floats]:
    """Split pieces at the middle of their longest edge."""
    edges = np.roll(pieces, -1, axis=1) - pieces  # edge k leads from corner k to the next one
    longest = np.einsum("tka,tka->tk", edges, edges).argmax(axis=1)
    order = (longest[:, None] + np.arange(3)) % 3
    a, b, c = np.moveaxis(np.take_along_axis(pieces, order[:, :, None], axis=1), 1, 0)
    middle = 0.5 * (a + b)
    return np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)


def _normals(pieces: Floats) -> Floats:
    """Return the unit normals of pieces (T, 3, 3), 0 for degenerate ones: (T, 3)."""
    normals = np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals /= np.where(lengths > 0.0, lengths, 1.0)
    return normals


def _may_be_nearer(
    level: _Level, pieces: Indices, offsets: Floats, apart: Floats, nearest: Floats
) -> Bools:
    """Return a conservative mask of the pieces that may be closer than the closest found so far."""
    # A piece lies in a disc of radius r around its centroid. With the height h of the point above
    # the disc's plane, the distance a from the centroid and s = sqrt(a^2 - h^2), the distance from
    # the disc is sqrt(h^2 + max(0, s - r)^2). For distant points, this excludes all pieces except
    # those below the point, whereas the bounding sphere, a - r, would leave a large circle of
    # candidates.
    squared_heights = _dot(offsets, level.normals[pieces]) ** 2
    beside = np.sqrt(np.maximum(apart - squared_heights, 0.0))
    beyond = np.maximum(beside - level.radii[pieces] * _SLACK, 0.0)
    # Close to a large triangle the difference a^2 - h^2 loses digits relative to a^2.
    bound = nearest**2 * _SLACK + _ROUNDED * apart
    result: Bools = squared_heights + beyond**2 <= bound
    return result


def _blocks(counts: Ints) -> Iterator[slice]:
    """Yield slices of points with about ``_PAIRS`` pairs each."""
    block = np.cumsum(counts) // _PAIRS
    starts = np.flatnonzero(np.diff(block, prepend=-1))
    for start, stop in pairwise([*starts, len(counts)]):
        yield slice(int(start), int(stop))


def _radii(pieces: Floats) -> Floats:
    """Return the distance from each piece's centroid to its farthest corner."""
    offsets = pieces - pieces.mean(axis=1, keepdims=True)
    return np.sqrt(np.einsum("tka,tka->tk", offsets, offsets).max(axis=1))


def _barycentric(points: Floats, corners: Floats) -> Floats:
    """Return the barycentric coordinates of the closest point of each triangle to a query point."""
    ab, ac = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    ap = points - corners[:, 0]
    bb, bc, cc = _dot(ab, ab), _dot(ab, ac), _dot(ac, ac)
    pb, pc = _dot(ab, ap), _dot(ac, ap)
    # The projection a + s ab + t ac minimises |a + s ab + t ac - p|^2: the normal equations are
    # [bb bc; bc cc] (s, t) = (pb, pc), here with s and t times the determinant. If it lies outside
    # the triangle, the closest point is on one of the three edges. A triangle so narrow that the
    # determinant is rounding error, bb cc sin^2 of its angle, has only edges.
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
    """Return the barycentric coordinates of the closest point of the three edges."""
    best = np.full(len(points), np.inf)
    weights = np.zeros_like(points)
    for start in range(3):
        end = (start + 1) % 3
        edge, offset = corners[:, end] - corners[:, start], points - corners[:, start]
        length = _dot(edge, edge)
        # A degenerate edge is treated as its first corner.
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
