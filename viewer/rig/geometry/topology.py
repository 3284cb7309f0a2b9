"""Topology of triangle meshes: welded vertices, shared edges, components, orientation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.rig.arrays import Bools, Floats, Ints

Indices = NDArray[np.int64]


def welded(positions: Floats, triangles: Ints) -> Indices:
    """Return triangles with coincident vertices merged, so that seams are closed.

    Parameters
    ----------
    positions : (V, 3)
        Vertices at exactly equal positions are represented by the first of them.
    triangles : (T, 3), or any other shape
        Vertex indices.
    """
    # Sorting rows as three keys is several times faster than np.unique over rows.
    order = np.lexsort(positions.T)
    ordered = positions[order]
    is_new = np.concatenate([[True], (ordered[1:] != ordered[:-1]).any(axis=1)])
    groups = np.cumsum(is_new) - 1
    first = np.full(int(groups[-1]) + 1 if len(groups) else 0, len(positions))
    np.minimum.at(first, groups, order)
    stands_for = np.empty(len(positions), dtype=np.int64)
    stands_for[order] = first[groups]
    return stands_for[triangles]


@dataclass(frozen=True, slots=True)
class Edges:
    """The edges of all triangles; corner k of a triangle is the start of its edge k.

    Attributes
    ----------
    keys : (3 T,)
        Equal for edges with the same two vertices.
    forward : (3 T,) bool
        Whether the edge runs from the smaller vertex index to the larger.
    counts : (3 T,)
        Number of triangles with this edge.
    pairs : (P, 2)
        Triangles on both sides of edges that belong to exactly two triangles.
    agree : (P,) bool
        Whether the two triangles traverse the edge in opposite directions, as consistent neighbours
        do.
    """

    keys: Indices
    forward: Bools
    counts: Indices
    pairs: Indices
    agree: Bools


def edges_of(corners: Indices) -> Edges:
    """Return the edges of triangles; those between equal vertices are excluded from the pairs.

    Parameters
    ----------
    corners : (T, 3)
        Vertex indices.
    """
    start = corners.ravel().astype(np.int64)
    end = np.roll(corners, -1, axis=1).ravel().astype(np.int64)
    base = int(start.max(initial=0)) + 1
    keys = np.minimum(start, end) * base + np.maximum(start, end)
    forward = start < end
    _, inverse, numbers = np.unique(keys, return_inverse=True, return_counts=True)
    counts = numbers[inverse]
    chosen = np.flatnonzero((counts == 2) & (start != end))
    order = chosen[np.argsort(keys[chosen], kind="stable")].reshape(-1, 2)
    agree = forward[order[:, 0]] != forward[order[:, 1]]
    return Edges(keys, forward, counts, order // 3, agree)


def components(count: int, pairs: Indices) -> Indices:
    """Return the smallest member of each node's component: (count,).

    In each round, every root takes the smallest label across its edges, and labels are followed
    until they refer to themselves, so the number of rounds is logarithmic in the number of nodes.

    Parameters
    ----------
    count : int
        Number of nodes.
    pairs : (P, 2)
        Pairs of connected nodes.
    """
    labels = np.arange(count)
    while True:
        a, b = labels[pairs[:, 0]], labels[pairs[:, 1]]
        apart = a != b
        if not apart.any():
            return labels
        low, high = np.minimum(a, b)[apart], np.maximum(a, b)[apart]
        np.minimum.at(labels, high, low)
        while (labels[labels] != labels).any():
            labels = labels[labels]


def orientations(count: int, edges: Edges) -> tuple[Indices, Bools, Bools]:
    """Return which triangles must be flipped to orient neighbours consistently.

    Every triangle is represented by two nodes, unflipped and flipped; edges connect consistent
    nodes. If both are in one component, the surface is non-orientable (Moebius).

    Parameters
    ----------
    count : int
        Number of triangles.
    edges : Edges
        Edges of these triangles.

    Returns
    -------
    component : (count,)
        Smallest triangle of each triangle's component.
    flipped : (count,) bool
        True for the smaller part of each component; of two equal parts, for the one without the
        first triangle.
    one_sided : (count,) bool
        Triangles of components that are not orientable.
    """
    a, b = edges.pairs[:, 0], edges.pairs[:, 1]
    flip = np.where(edges.agree, 0, count)
    nodes = np.concatenate(
        [np.stack([a, b + flip], axis=1), np.stack([a + count, b + count - flip], axis=1)]
    )
    labels = components(2 * count, nodes)
    plain, reverse = labels[:count], labels[count:]
    one_sided = plain == reverse
    # The smallest triangle of a component has the smaller label either unflipped or flipped.
    component = np.minimum(plain, reverse) % count if count else plain
    is_against = plain > reverse
    against = np.bincount(component, is_against, minlength=count)
    members = np.bincount(component, minlength=count)
    mostly = against * 2 > members
    flipped = (is_against != mostly[component]) & ~one_sided
    return component, flipped, one_sided
