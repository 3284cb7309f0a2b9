"""Topology of triangle meshes: welded vertices, shared edges, components, orientation, shells.

A shell is a closed surface, up to small openings, whose inside is hidden. A ray from outside hits
the front of such a surface before its back, unless it enters through an opening. It hits the back
first only if skinning turns the surface inside out.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Bools, Floats, Ints, Item
from viewer.rigs.mesh import Mesh
from viewer.rigs.skin import Skin, skin_rows

Indices = NDArray[np.int64]

# Maximum number of triangles, above which the check takes longer than it saves.
_MOST_TRIANGLES = 500_000
_MOST_OPEN = 256  # maximum number of edges of openings, which are projected in every image

CLOSED = 0.25
"""Squared number of border edges per triangle of a part, up to which its volume's sign is reliable:
the area of a hole grows with the square of its border."""
HOLLOW = 1e-6
"""Volume relative to area^1.5 below which it is rounding, as for two coincident sheets."""


def welded(positions: Floats, triangles: Ints) -> Indices:
    """Replace each vertex index, in any shape, by the first one at the same position: no seams."""
    # Sorting rows as three keys is several times faster than np.unique over rows.
    order = np.lexsort(positions.T)
    ordered = positions[order]
    is_new = np.ones(len(order), dtype=np.bool_)
    is_new[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    groups = np.cumsum(is_new) - 1
    first = np.full(int(groups[-1]) + 1 if len(groups) else 0, len(positions))
    np.minimum.at(first, groups, order)
    stands_for = np.empty(len(positions), dtype=np.int64)
    stands_for[order] = first[groups]
    return stands_for[triangles]


@dataclass(frozen=True, slots=True)
class Edges:
    """The edges of all triangles; corner k of a triangle is the start of its edge k."""

    keys: Indices
    """(3 T,). Equal for edges with the same two vertices."""
    forward: Bools
    """(3 T,) bool. Whether the edge runs from the smaller vertex index to the larger."""
    counts: Indices
    """(3 T,). Number of triangles with this edge."""
    pairs: Indices
    """(P, 2). Triangles on both sides of edges that belong to exactly two triangles."""
    agree: Bools
    """(P,) bool. Whether the two triangles traverse the edge in opposite directions, as consistent
    neighbours do."""


def sides_of(corners: NDArray[Item]) -> NDArray[Item]:
    """Return the two ends of each side of triangles (T, 3, ...), in order: (T, 3, 2, ...)."""
    return np.stack([corners, np.roll(corners, -1, axis=1)], axis=2)


def edges_of(corners: Ints | Indices) -> Edges:
    """Return the edges of triangles (T, 3); pairs exclude those between equal vertices."""
    start, end = sides_of(corners).reshape(-1, 2).T.astype(np.int64)
    base = int(start.max(initial=0)) + 1
    keys = np.minimum(start, end) * base + np.maximum(start, end)
    forward = start < end
    # One sort shows the rows of each edge, which are next to each other in its order.
    order = np.argsort(keys)
    ordered = keys[order]
    first = np.flatnonzero(np.diff(ordered, prepend=-1))
    numbers = np.diff(first, append=len(keys))
    counts = np.empty(len(keys), dtype=np.int64)
    counts[order] = np.repeat(numbers, numbers)
    first = first[numbers == 2]
    order = np.sort(np.stack([order[first], order[first + 1]], axis=1), axis=1)
    order = order[start[order[:, 0]] != end[order[:, 0]]]
    agree = forward[order[:, 0]] != forward[order[:, 1]]
    return Edges(keys, forward, counts, order // 3, agree)


def components(count: int, pairs: Ints | Indices) -> Indices:
    """Return the smallest member of each node's component: (count,); ``pairs``: (P, 2)."""
    # Scipy takes 1.2 times as long for 180,000 pairs, and loads for 0.3 s, which every picture of a
    # closed mesh would wait for.
    # In each round, every root takes the smallest label across its edges, and labels are followed
    # until they refer to themselves, so the number of rounds is logarithmic in the number of nodes.
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
    """Return component, flips that orient it consistently, and whether it is not orientable.

    ``component``: smallest triangle of each triangle's component. ``flipped``: true for the smaller
    part; of two equal parts, for the one without the first triangle. All have one entry per
    triangle.
    """
    a, b = edges.pairs[:, 0], edges.pairs[:, 1]
    # Every triangle is represented by two nodes, unflipped and flipped; edges connect consistent
    # nodes. If both are in one component, the surface is non-orientable (Moebius).
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


def part_volumes(
    corners: Floats, parts: Ints | Indices, count: int, signs: Floats | None = None
) -> tuple[Floats, Floats, Floats]:
    """Return the volume, area and number of triangles of each part of a surface: (count,) each.

    ``corners``: (T, 3, 3). ``parts``: (T,), part of each triangle. ``signs``: (T,), -1 for
    triangles that count as flipped, 0 for those whose volume is unknown. The volume is negative if
    a part is inside out.
    """
    signs = np.ones(len(corners)) if signs is None else signs
    is_known = (signs != 0.0).astype(np.float64)
    members = np.bincount(parts, is_known, count).astype(np.float64)
    # All tetrahedra of a part, with the volume a . (b x c) / 6, share its middle as a corner, so
    # that a small hole hardly changes the sum.
    centers = corners.mean(axis=1) * is_known[:, None]
    sums = [np.bincount(parts, centers[:, axis], count) for axis in range(3)]
    middle = np.stack(sums, axis=1) / np.maximum(members, 1.0)[:, None]
    a, b, c = np.moveaxis(corners - middle[parts][:, None], 1, 0)
    volumes = np.bincount(parts, signs * np.einsum("ta,ta->t", a, np.cross(b, c)), count) / 6.0
    areas = np.bincount(parts, np.linalg.norm(np.cross(b - a, c - a), axis=1), count) / 2.0
    return volumes, areas, members


@dataclass(frozen=True, slots=True, eq=False)
class Shell:
    """A closed surface whose triangles are counter-clockwise from outside."""

    borders: Ints
    """(B,) int32. Vertices around its openings."""
    copies: Ints
    originals: Ints
    """(N,) int32. Pairs of vertices at the same position; the surface is closed while these
    coincide."""

    def is_closed(self, positions: Floats) -> bool:
        """Return whether coincident vertices still coincide at positions (V, 3)."""
        return np.array_equal(positions[self.copies], positions[self.originals])


def shell_of(mesh: Mesh, skin: Skin | None) -> Shell | None:
    """Return a mesh as a shell; None if its surface is not closed, or has over 500,000 triangles.

    Vertices at the same position must have the same influences. A shell has no edge of more than
    two triangles, no neighbours of opposite orientation, and no part that is clockwise or open.
    """
    if not 0 < mesh.n_triangles <= _MOST_TRIANGLES:
        return None
    every = np.arange(mesh.n_vertices, dtype=np.int32)
    same = welded(mesh.positions, every)
    copies = np.flatnonzero(same != every).astype(np.int32)
    originals = same[copies].astype(np.int32)
    if skin is not None and not _move_together(skin, copies, originals):
        return None
    corners = same[mesh.triangles]
    a, b, c = corners.T
    corners = corners[(a != b) & (b != c) & (c != a)]
    if _has_long_borders(corners, mesh.n_vertices):
        return None
    edges = edges_of(corners)
    is_open = edges.counts == 1
    if (edges.counts > 2).any() or not edges.agree.all() or is_open.sum() > _MOST_OPEN:
        return None
    count = len(corners)
    labels = components(count, edges.pairs)
    volumes, areas, members = part_volumes(mesh.positions[corners], labels, count)
    open_edges = np.bincount(np.repeat(labels, 3)[is_open], minlength=count)
    is_outward = volumes > HOLLOW * areas**1.5
    if not (is_outward & (open_edges**2 <= CLOSED * members))[members > 0].all():
        return None
    is_border = np.zeros(mesh.n_vertices, dtype=np.bool_)
    is_border[corners.ravel()[is_open]] = True
    borders = np.flatnonzero(is_border).astype(np.int32)
    return Shell(borders, copies, originals)


def _move_together(skin: Skin, copies: Ints, originals: Ints) -> bool:
    first, second = skin_rows(skin, copies), skin_rows(skin, originals)
    return (
        np.array_equal(first.starts, second.starts)
        and np.array_equal(first.joints, second.joints)
        and np.array_equal(first.weights, second.weights)
    )


def _has_long_borders(corners: NDArray[np.int64], n_vertices: int) -> bool:
    """Return whether more than ``_MOST_OPEN`` vertices certainly lie on openings; avoids a sort."""
    # Around a vertex in the interior, each neighbour follows it in one triangle and precedes it in
    # another, so any numbers of the neighbours cancel out. As many unpaired edges begin as end at a
    # vertex, so at least one begins at each vertex where the numbers do not cancel out. Random
    # numbers make it unlikely that those of different neighbours cancel; integers below 2**30 have
    # exact sums for up to 2**23 of them.
    numbers = _scattered(n_vertices)
    sums = np.zeros(n_vertices)
    for start, end in ((0, 1), (1, 2), (2, 0)):
        first, second = corners[:, start], corners[:, end]
        sums += np.bincount(first, numbers[second], n_vertices)
        sums -= np.bincount(second, numbers[first], n_vertices)
    return bool(np.count_nonzero(sums) > _MOST_OPEN)


def _scattered(count: int) -> Floats:
    """Return pseudo-random integers below 2**30 (splitmix64, Steele et al. 2014)."""
    # ``numpy.random`` would take longer to import than the rest of this module.
    values = np.arange(1, count + 1, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    values = (values ^ values >> np.uint64(30)) * np.uint64(0xBF58476D1CE4E5B9)
    values = (values ^ values >> np.uint64(27)) * np.uint64(0x94D049BB133111EB)
    return ((values ^ values >> np.uint64(31)) >> np.uint64(34)).astype(np.float64)
