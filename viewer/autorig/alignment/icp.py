"""Iterative closest point: match nearby points, fit, and match again.

Besl and McKay 1992, with pairs from both surfaces, so that neither the scale nor a part
missing from one of them biases the result. Near convergence, surfaces may slide along each other
(point-to-plane distances, Chen and Medioni 1992), which requires far fewer iterations.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from viewer.autorig.alignment.similarity import Similarity, fit_similarity
from viewer.data_classes import dataclass
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.geometry.closest_point import Surface
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix
from viewer.rigs.geometry.samples import SurfaceSamples, sample_surface, triangle_normals
from viewer.rigs.geometry.topology import edges_of, welded
from viewer.rigs.geometry.vectors import unit

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

_FAR = 3.0  # multiple of the median distance, above which pairs are rejected
_SAME_WAY = 0.5  # cosine of 60 degrees between the normals of a pair
SETTLED = 1e-5  # relative change of the error, or of scales, at which iterations end
_EXACT = 1e-12  # ratio of error to size below which an alignment is exact
_ON_EDGE = 1e-9  # barycentric coordinate below which a point is on an edge
_HOLD = 3e-3  # weight of point-to-point relative to point-to-plane distances, before squaring
_PATIENCE = 3  # iterations without improvement; new pairs may raise the error for a while
FEWEST = 8  # minimum number of pairs for seven unknowns


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """Correspondences of N points: positions and normals (N, 3), and a mask of usable ones (N,)."""

    positions: Floats
    normals: Floats
    usable: Bools


class Side(Protocol):
    """One of the two meshes: points on it, and a nearest-point search."""

    samples: SurfaceSamples
    size: float

    def find(self, points: Floats) -> _Found:
        """Return the nearest points of this mesh."""


class Cloud:
    """A mesh as a dense point cloud: a fast search, accurate to half the point spacing."""

    def __init__(self, samples: SurfaceSamples, dense: SurfaceSamples) -> None:
        self.samples, self._dense = samples, dense
        from scipy import spatial

        self._tree: cKDTree = spatial.cKDTree(dense.positions)
        self.size = _size(dense.positions)

    def with_samples(self, samples: SurfaceSamples) -> Cloud:
        """Return the same mesh with different sample points."""
        other = copy(self)
        other.samples = samples
        return other

    def find(self, points: Floats) -> _Found:
        """Return the nearest of the dense points."""
        found = self._tree.query(points)[1]
        usable = np.ones(len(points), dtype=np.bool_)
        return _Found(self._dense.positions[found], self._dense.normals[found], usable)


class Triangles:
    """A mesh as its triangles: an exact search, without pairs on the borders of holes."""

    def __init__(self, positions: Floats, triangles: Ints, count: int) -> None:
        self.samples = sample_surface(positions, triangles, count)
        self._surface = Surface(positions, triangles)
        self._normals = triangle_normals(positions, triangles)
        # Corner k is opposite the edge that starts at the next corner. Coincident vertices are
        # treated as one: a texture seam is not a border.
        counts = edges_of(welded(positions, triangles)).counts.reshape(-1, 3)
        self._border = np.roll(counts, -1, axis=1) == 1
        self.size = _size(positions[triangles].reshape(-1, 3))

    def find(self, points: Floats) -> _Found:
        """Return the nearest points of the surface."""
        found = self._surface.closest(points)
        # The corner with coordinate 0 is opposite the edge on which the point lies.
        on_edge = found.barycentric < _ON_EDGE
        at_border = np.logical_or.reduce(on_edge & self._border[found.triangles], axis=1)
        return _Found(found.positions, self._normals[found.triangles], ~at_border)


def _size(points: Floats) -> float:
    return float(np.linalg.norm(points.max(axis=0) - points.min(axis=0)))


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Points of the template, their target positions, and the normals there: (N, 3)."""

    points: Floats
    targets: Floats
    normals: Floats


def iterate(
    template: Side,
    target: Side,
    start: Similarity,
    rounds: int,
    scales: bool,
) -> Similarity:
    """Improve an alignment in at most ``rounds`` iterations, until its error hardly changes."""
    similarity, before = start, np.inf
    for _ in range(rounds):
        pairs = pairs_between(template, target, similarity)
        if len(pairs.points) < FEWEST:
            break
        # Factors apply along the target's axes: dividing by them leaves a plain similarity to fit.
        fit = fit_similarity(
            pairs.points, pairs.targets / start.factors, None if scales else start.scale
        )
        similarity = replace(fit, shift=fit.shift * start.factors, factors=start.factors)
        steps = similarity.apply(pairs.points) - pairs.targets
        error = float(np.sqrt(np.einsum("na,na->", steps, steps) / len(steps)))
        if error <= _EXACT * target.size or abs(before - error) < SETTLED * error:
            break
        before = error
    return similarity


def slide(
    template: Side,
    target: Side,
    start: Similarity,
    rounds: int,
    scales: bool,
) -> Similarity:
    """Improve a good alignment by point-to-plane distances, which let surfaces slide."""
    similarity, best, lowest, idle = start, start, np.inf, 0
    for _ in range(rounds):
        pairs = pairs_between(template, target, similarity)
        if len(pairs.points) < FEWEST:
            break
        moved = similarity.apply(pairs.points)
        gaps = np.einsum("na,na->n", pairs.normals, moved - pairs.targets)
        error = float(np.sqrt(np.mean(gaps**2)))
        idle = 0 if error < lowest * (1.0 - SETTLED) else idle + 1
        if error < lowest:
            best, lowest = similarity, error
        if idle == _PATIENCE or error <= _EXACT * target.size:
            break
        similarity = _step(similarity, moved, pairs, scales)
    return best


def _step(similarity: Similarity, moved: Floats, pairs: Pairs, scales: bool) -> Similarity:
    """Solve one linearised iteration of ``slide``."""
    # With x = aligned p, c the mean of all x and x' = x + w x (x - c) + u (x - c) + v, minimise sum
    # (n . (x' - q))^2 + 1e-5 |x' - q|^2 over the rotation w, the shift v and the relative change of
    # scale u. The first sum alone would let surfaces slide without bound, as along a plane.
    center = moved.mean(axis=0)
    arms = moved - center
    size = float(np.sqrt(np.einsum("na,na->", arms, arms) / len(arms)))
    # Dividing by the size gives all unknowns the same magnitude.
    arms = arms / size
    gaps = (pairs.targets - moved) / size
    # Columns: rotation, shift, scale.
    rotations = rotation_columns(arms)
    shifts = np.broadcast_to(np.eye(3), rotations.shape)
    whole = np.concatenate([rotations, shifts, arms[:, :, None]], axis=2)[
        :, :, : 7 if scales else 6
    ]
    solved = solved_along(pairs.normals, whole, gaps)
    rotation = rotation_vector_to_matrix(solved[:3])
    grow = 1.0 + (float(solved[6]) if scales else 0.0)
    grow = min(max(grow, 0.5), 2.0)  # the linearisation is invalid beyond these limits
    # The step rotates and scales about the centre: p' = g R (p - c) + c + v.
    shift = grow * rotation @ (similarity.shift - center) + center + size * solved[3:6]
    return Similarity(
        grow * similarity.scale, rotation @ similarity.rotation, shift, similarity.factors
    )


def rotation_columns(arms: Floats) -> Floats:
    """Return the Jacobian of points by a small rotation about the origin of arms (N, 3)."""
    # Each column is a coordinate axis crossed with the lever arm.
    x, y, z = arms.T
    null = np.zeros_like(x)
    return np.stack([null, z, -y, -z, null, x, y, -x, null], axis=1).reshape(-1, 3, 3)


def solved_along(normals: Floats, columns: Floats, gaps: Floats) -> Floats:
    """Return the unknowns (K,) that close gaps (N, 3) along normals, and slightly on all axes.

    ``columns``: (N, 3, K), the Jacobian of the points.
    """
    along = np.einsum("na,nak->nk", normals, columns)
    rows = np.concatenate([along, _HOLD * columns.reshape(-1, columns.shape[2])])
    values = np.einsum("na,na->n", normals, gaps)
    return np.linalg.lstsq(rows, np.concatenate([values, _HOLD * gaps.ravel()]))[0]


def pairs_between(template: Side, target: Side, similarity: Similarity) -> Pairs:
    """Match samples of each mesh with the other mesh, and reject incompatible pairs."""
    ours, theirs = template.samples, target.samples
    found = template.find(similarity.undo(theirs.positions))
    towards = _kept(similarity, found.positions, found.normals, theirs.positions, theirs.normals)
    towards &= found.usable
    reached = target.find(similarity.apply(ours.positions))
    away = _kept(similarity, ours.positions, ours.normals, reached.positions, reached.normals)
    away &= reached.usable
    return Pairs(
        np.concatenate([found.positions[towards], ours.positions[away]]),
        np.concatenate([theirs.positions[towards], reached.positions[away]]),
        np.concatenate([_rotated(similarity, found.normals[towards]), reached.normals[away]]),
    )


def _kept(
    similarity: Similarity, points: Floats, normals: Floats, targets: Floats, target_normals: Floats
) -> Bools:
    # Pairs of a part that the other mesh lacks are far apart or on surfaces at an angle. Normals
    # may point inwards in one of the meshes, so their signs do not count.
    distances = np.linalg.norm(similarity.apply(points) - targets, axis=1)
    cosines = np.abs(np.einsum("na,na->n", _rotated(similarity, normals), target_normals))
    return (distances <= _FAR * np.median(distances)) & (cosines >= _SAME_WAY)


def _rotated(similarity: Similarity, normals: Floats) -> Floats:
    # Normals are transformed by the inverse transpose.
    return unit(((normals / similarity.own_factors) @ similarity.rotation.T) / similarity.factors)


def trimmed_rms(distances: Floats) -> float:
    """Return the root mean square of the smallest nine tenths of the distances."""
    count = max(1, int(np.ceil(0.9 * len(distances))))
    smallest = np.partition(distances, count - 1)[:count]
    return float(np.sqrt(np.mean(smallest**2)))


def capped_rms(distances: Floats, cap: float) -> float:
    """Return the root mean square of distances, each clamped to ``cap``."""
    return float(np.sqrt(np.mean(np.minimum(distances, cap) ** 2)))


@dataclass(frozen=True, slots=True, eq=False)
class Gaps:
    """Distances of samples from the surface of the other mesh, in the target's unit."""

    towards: Floats
    """(N,). From the target's samples to the template."""
    away: Floats
    """(M,). From the template's samples to the target."""
    uneven_towards: Floats
    uneven_away: Floats
    """(N,), (M,). The same distances without the median offset along the normals, so that a jacket
    at a constant distance of two centimetres from the skin has a small error."""


def gaps_between(template: Side, target: Side, similarity: Similarity) -> Gaps:
    """Return the distances of samples from the surface of the other mesh."""
    ours, theirs = template.samples.positions, target.samples.positions
    near = template.find(similarity.undo(theirs))
    towards = theirs - similarity.apply(near.positions)
    moved = similarity.apply(ours)
    reached = target.find(moved)
    away = moved - reached.positions
    lengths = (np.linalg.norm(towards, axis=1), np.linalg.norm(away, axis=1))
    uneven = (_uneven(towards, _rotated(similarity, near.normals)), _uneven(away, reached.normals))
    return Gaps(*lengths, *uneven)


def _uneven(ways: Floats, normals: Floats) -> Floats:
    """Return the lengths of vectors (N, 3) minus the median of their normal components."""
    along = np.median(np.einsum("na,na->n", ways, normals))
    return np.linalg.norm(ways - along * normals, axis=1)
