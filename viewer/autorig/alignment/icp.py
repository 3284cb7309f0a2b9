"""Iterative closest point: match what is near, fit, and match again.

Besl and McKay 1992, with pairs from both surfaces to the other, so that neither the scale nor
a part that is missing on one of them pulls all to one side. Near the end surfaces may slide along
each other (distances to planes, Chen and Medioni 1992), which needs far fewer rounds.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from viewer.autorig.alignment.similarity import Similarity, fit_similarity
from viewer.autorig.surface.samples import SurfaceSamples, sample_surface, triangle_normals
from viewer.rig._scipy import scipy_part
from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.geometry.closest_point import Surface
from viewer.rig.geometry.rotation import rotation_vector_to_matrix
from viewer.rig.geometry.vectors import unit

__all__ = [
    "FEWEST",
    "HOLD",
    "SETTLED",
    "Cloud",
    "Gaps",
    "Pairs",
    "Side",
    "Triangles",
    "capped_rms",
    "gaps_between",
    "iterate",
    "pairs_between",
    "slide",
    "trimmed_rms",
]

_FAR = 3.0  # medians: pairs farther apart than this are not used
_SAME_WAY = 0.5  # cosine of 60 degrees between the normals of a pair
SETTLED = 1e-5  # relative change of the error, or of scales, at which rounds end
_EXACT = 1e-12  # error over size at which there is nothing left to improve
_ON_EDGE = 1e-9  # barycentric coordinate of a point on an edge
HOLD = 3e-3  # weight of distances between points beside those to planes, before squaring
_PATIENCE = 3  # rounds without an improvement, as other pairs give another error
FEWEST = 8  # pairs that still tell seven numbers


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """The partners of N points: positions and normals (N, 3), and which are of use (N,)."""

    positions: Floats
    normals: Floats
    usable: Bools


class Side(Protocol):
    """One of the two meshes: points on it, and a search for the nearest of its points."""

    samples: SurfaceSamples
    size: float

    def find(self, points: Floats) -> _Found:
        """Return the nearest points of this mesh."""


class Cloud:
    """A mesh as many points: a quick search, off by up to half their spacing.

    Parameters
    ----------
    samples : SurfaceSamples
        What the other mesh is asked for.
    dense : SurfaceSamples
        What is searched.
    """

    def __init__(self, samples: SurfaceSamples, dense: SurfaceSamples) -> None:
        self.samples, self._dense = samples, dense
        self._tree: Any = scipy_part("spatial").cKDTree(dense.positions)
        self.size = _size(dense.positions)

    def with_samples(self, samples: SurfaceSamples) -> Cloud:
        """Return the same mesh with other points that the other mesh is asked for."""
        other = copy(self)
        other.samples = samples
        return other

    def find(self, points: Floats) -> _Found:
        """Return the nearest of the dense points."""
        found = self._tree.query(points)[1]
        usable = np.ones(len(points), dtype=np.bool_)
        return _Found(self._dense.positions[found], self._dense.normals[found], usable)


class Triangles:
    """A mesh as its triangles: exact, and without pairs on the borders of holes.

    Parameters
    ----------
    positions : (V, 3)
        Any unit.
    triangles : (T, 3)
        Vertex indices.
    count : int
        How many points the other mesh is asked for.
    """

    def __init__(self, positions: Floats, triangles: Ints, count: int) -> None:
        self.samples = sample_surface(positions, triangles, count)
        self._surface = Surface(positions, triangles)
        self._normals = triangle_normals(positions, triangles)
        self._border = _border_edges(positions, triangles)
        self.size = _size(positions[triangles].reshape(-1, 3))

    def find(self, points: Floats) -> _Found:
        """Return the nearest points of the surface."""
        found = self._surface.closest(points)
        # The corner with coordinate 0 lies opposite to the edge that the point is on.
        on_edge = found.barycentric < _ON_EDGE
        at_border = np.logical_or.reduce(on_edge & self._border[found.triangles], axis=1)
        return _Found(found.positions, self._normals[found.triangles], ~at_border)


def _size(points: Floats) -> float:
    return float(np.linalg.norm(points.max(axis=0) - points.min(axis=0)))


def _border_edges(positions: Floats, triangles: Ints) -> Bools:
    """Return for each corner whether the edge opposite to it belongs to one triangle: (T, 3).

    Vertices at one place count as one: a texture seam is no border.
    """
    _, place = np.unique(positions, axis=0, return_inverse=True)
    corners = place.reshape(-1)[triangles].astype(np.int64)
    edges = np.sort(corners[:, [[1, 2], [2, 0], [0, 1]]], axis=2)
    keys = edges[..., 0] * (int(place.max()) + 1) + edges[..., 1]
    _, inverse, counts = np.unique(keys, return_inverse=True, return_counts=True)
    return (counts[inverse.reshape(-1)] == 1).reshape(triangles.shape)


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Points of the template, where they should come to lie, and the normals there: (N, 3)."""

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
    """Improve an alignment until it settles.

    Pairs farther apart than three times the median, with normals more than 60 degrees apart
    (whichever way they point), or on the border of a hole are left out of each round.

    Parameters
    ----------
    template, target : Side
        What is moved, and what onto.
    start : Similarity
        Roughly right; its factors are kept.
    rounds : int
        At most; fewer if the error changes by less than 1e-5 of itself.
    scales : bool
        Whether the scale is found too, or kept.

    Returns
    -------
    Similarity
        The best so far where too few pairs are left to go on.
    """
    placed, before = start, np.inf
    for _ in range(rounds):
        pairs = pairs_between(template, target, placed)
        if len(pairs.points) < FEWEST:
            break
        # Factors belong to the target's axes: without them the rest is a similarity.
        fit = fit_similarity(
            pairs.points, pairs.targets / start.factors, None if scales else start.scale
        )
        placed = replace(fit, shift=fit.shift * start.factors, factors=start.factors)
        steps = placed.apply(pairs.points) - pairs.targets
        error = float(np.sqrt(np.einsum("na,na->", steps, steps) / len(steps)))
        if error <= _EXACT * target.size or abs(before - error) < SETTLED * error:
            break
        before = error
    return placed


def slide(
    template: Side,
    target: Side,
    start: Similarity,
    rounds: int,
    scales: bool,
) -> Similarity:
    """Improve a good alignment by distances to planes, which let surfaces slide along each other.

    Each round solves the linearised problem: with x = placed p, c the middle of all x and
    x' = x + w x (x - c) + u (x - c) + v, minimise sum (n . (x' - q))^2 + 1e-5 |x' - q|^2 over
    the turn w, the shift v and the relative change of scale u. The second term holds what could
    slide for ever.

    Parameters
    ----------
    template, target, start, rounds, scales
        As for ``iterate``; factors of the start must be 1.

    Returns
    -------
    Similarity
        The best so far where too few pairs are left to go on.
    """
    placed, best, lowest, idle = start, start, np.inf, 0
    for _ in range(rounds):
        pairs = pairs_between(template, target, placed)
        if len(pairs.points) < FEWEST:
            break
        moved = placed.apply(pairs.points)
        gaps = np.einsum("na,na->n", pairs.normals, moved - pairs.targets)
        error = float(np.sqrt(np.mean(gaps**2)))
        idle = 0 if error < lowest * (1.0 - SETTLED) else idle + 1
        if error < lowest:
            best, lowest = placed, error
        if idle == _PATIENCE or error <= _EXACT * target.size:
            break
        placed = _step(placed, moved, pairs, scales)
    return best


def _step(placed: Similarity, moved: Floats, pairs: Pairs, scales: bool) -> Similarity:
    """Solve one linearised round of ``slide``."""
    center = moved.mean(axis=0)
    arms = moved - center
    size = float(np.sqrt(np.einsum("na,na->", arms, arms) / len(arms)))
    arms = arms / size  # makes all unknowns of one magnitude
    gaps = (pairs.targets - moved) / size
    # Columns: turn, shift, scale; rows: along the normal, then along x, y and z.
    x, y, z = arms.T
    null = np.zeros_like(x)
    turns = np.stack([null, z, -y, -z, null, x, y, -x, null], axis=1).reshape(-1, 3, 3)
    shifts = np.broadcast_to(np.eye(3), turns.shape)
    whole = np.concatenate([turns, shifts, arms[:, :, None]], axis=2)[:, :, : 7 if scales else 6]
    along = np.einsum("na,nak->nk", pairs.normals, whole)
    rows = np.concatenate([along, HOLD * whole.reshape(-1, whole.shape[2])])
    values = np.einsum("na,na->n", pairs.normals, gaps)
    solved = np.linalg.lstsq(rows, np.concatenate([values, HOLD * gaps.ravel()]))[0]
    turn = rotation_vector_to_matrix(solved[:3])
    grow = 1.0 + (float(solved[6]) if scales else 0.0)
    grow = min(max(grow, 0.5), 2.0)  # a linear step knows nothing of what lies beyond
    shift = grow * turn @ (placed.shift - center) + center + size * solved[3:6]
    return Similarity(grow * placed.scale, turn @ placed.rotation, shift, placed.factors)


def pairs_between(template: Side, target: Side, placed: Similarity) -> Pairs:
    """Match samples of both sides with the other, and leave out what does not go together."""
    ours, theirs = template.samples, target.samples
    found = template.find(placed.undo(theirs.positions))
    towards = _kept(placed, found.positions, found.normals, theirs.positions, theirs.normals)
    towards &= found.usable
    reached = target.find(placed.apply(ours.positions))
    away = _kept(placed, ours.positions, ours.normals, reached.positions, reached.normals)
    away &= reached.usable
    return Pairs(
        np.concatenate([found.positions[towards], ours.positions[away]]),
        np.concatenate([theirs.positions[towards], reached.positions[away]]),
        np.concatenate([_turned(placed, found.normals[towards]), reached.normals[away]]),
    )


def _kept(
    placed: Similarity, points: Floats, normals: Floats, targets: Floats, target_normals: Floats
) -> Bools:
    distances = np.linalg.norm(placed.apply(points) - targets, axis=1)
    cosines = np.abs(np.einsum("na,na->n", _turned(placed, normals), target_normals))
    return (distances <= _FAR * np.median(distances)) & (cosines >= _SAME_WAY)


def _turned(placed: Similarity, normals: Floats) -> Floats:
    # Normals turn by the inverse transpose.
    return unit(((normals / placed.own_factors) @ placed.rotation.T) / placed.factors)


def trimmed_rms(distances: Floats, share: float = 0.9) -> float:
    """Return the root mean square of the smallest ``share`` of some distances."""
    count = max(1, int(np.ceil(share * len(distances))))
    smallest = np.partition(distances, count - 1)[:count]
    return float(np.sqrt(np.mean(smallest**2)))


def capped_rms(distances: Floats, cap: float) -> float:
    """Return the root mean square of some distances, each counted as ``cap`` at most."""
    return float(np.sqrt(np.mean(np.minimum(distances, cap) ** 2)))


@dataclass(frozen=True, slots=True, eq=False)
class Gaps:
    """How far samples lie from the other side's surface, in the target's unit.

    Attributes
    ----------
    towards : (N,)
        Of the target's samples to the template.
    away : (M,)
        Of the template's samples to the target.
    uneven_towards, uneven_away : (N,), (M,)
        The same with what the surface stands off everywhere taken off, along the normals: a
        jacket that is two centimetres from the skin fits it well.
    """

    towards: Floats
    away: Floats
    uneven_towards: Floats
    uneven_away: Floats


def gaps_between(template: Side, target: Side, placed: Similarity) -> Gaps:
    """Return how far samples lie from the other side's surface.

    Parameters
    ----------
    template, target : Side
        As for ``iterate``.
    placed : Similarity
        The alignment to judge.
    """
    ours, theirs = template.samples.positions, target.samples.positions
    near = template.find(placed.undo(theirs))
    towards = theirs - placed.apply(near.positions)
    moved = placed.apply(ours)
    reached = target.find(moved)
    away = moved - reached.positions
    lengths = (np.linalg.norm(towards, axis=1), np.linalg.norm(away, axis=1))
    uneven = (_uneven(towards, _turned(placed, near.normals)), _uneven(away, reached.normals))
    return Gaps(*lengths, *uneven)


def _uneven(ways: Floats, normals: Floats) -> Floats:
    """Return the lengths of ways (N, 3) without the median of their parts along the normals."""
    along = np.median(np.einsum("na,na->n", ways, normals))
    return np.linalg.norm(ways - along * normals, axis=1)
