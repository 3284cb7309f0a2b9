"""Closed surfaces, up to small openings: their inside is hidden.

A ray from outside hits the front of such a surface before its back, unless it enters through an
opening. It hits the back first only if skinning turns the surface inside out.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.geometry.topology import components, welded
from viewer.rig.mesh import Mesh, area_vectors
from viewer.rig.skin import Skin, skin_rows

# Maximum number of triangles, above which the check takes longer than it saves.
_MOST_TRIANGLES = 500_000
_MOST_OPEN = 256  # maximum number of edges of openings, which are projected in every image
# Maximum squared number of edges of openings per triangle for which the volume's sign is reliable.
_CLOSED = 0.25
_HOLLOW = 1e-6  # volume relative to area^1.5 below which it is 0, as for two coincident sheets


@dataclass(frozen=True, slots=True, eq=False)
class Shell:
    """A closed surface whose triangles are counter-clockwise from outside.

    Attributes
    ----------
    borders : (B,) int32
        Vertices around its openings.
    copies, originals : (N,) int32
        Pairs of vertices at the same position; the surface is closed while these coincide.
    """

    borders: Ints
    copies: Ints
    originals: Ints

    def is_closed(self, positions: Floats) -> bool:
        """Return whether coincident vertices still coincide at positions (V, 3)."""
        return np.array_equal(positions[self.copies], positions[self.originals])


def shell_of(mesh: Mesh, skin: Skin | None) -> Shell | None:
    """Return a mesh as a shell; None if its surface is not closed.

    Parameters
    ----------
    mesh : Mesh
        In the bind pose.
    skin : Skin or None
        Vertices at the same position must have the same influences.

    Returns
    -------
    Shell or None
        None if edges belong to more than two triangles, if neighbours have opposite orientations,
        if a connected part is clockwise or open, or if the mesh has more than 500,000 triangles.
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
    found = _neighbours(corners)
    if found is None:
        return None
    pairs, is_open = found
    if is_open.sum() > _MOST_OPEN or not _face_outwards(mesh.positions, corners, pairs, is_open):
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
    """Return whether more than ``_MOST_OPEN`` vertices certainly lie on openings; avoids a sort.

    Around a vertex in the interior, each neighbour follows it in one triangle and precedes it in
    another, so any numbers of the neighbours cancel out. As many unpaired edges begin as end at a
    vertex, so at least one begins at each vertex where the numbers do not cancel out.
    """
    numbers = _scattered(n_vertices)
    sums = np.zeros(n_vertices)
    for start, end in ((0, 1), (1, 2), (2, 0)):
        first, second = corners[:, start], corners[:, end]
        sums += np.bincount(first, numbers[second], n_vertices)
        sums -= np.bincount(second, numbers[first], n_vertices)
    return bool(np.count_nonzero(sums) > _MOST_OPEN)


def _scattered(count: int) -> Floats:
    """Return pseudo-random integers below 2**30 (splitmix64, Steele et al. 2014).

    Their sums are exact for up to 2**23 numbers. ``numpy.random`` would take longer to import.
    """
    values = np.arange(1, count + 1, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    values = (values ^ values >> np.uint64(30)) * np.uint64(0xBF58476D1CE4E5B9)
    values = (values ^ values >> np.uint64(27)) * np.uint64(0x94D049BB133111EB)
    return ((values ^ values >> np.uint64(31)) >> np.uint64(34)).astype(np.float64)


def _neighbours(corners: NDArray[np.int64]) -> tuple[NDArray[np.int64], Bools] | None:
    """Return pairs of adjacent triangles and which of the 3 T edges have no second triangle.

    None if an edge has more than two triangles or two that traverse it in the same direction.
    """
    start, end = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    keys = np.minimum(start, end) * (int(start.max(initial=0)) + 1) + np.maximum(start, end)
    order = np.argsort(keys)
    ordered = keys[order]
    twice = ordered[1:] == ordered[:-1]
    if (twice[1:] & twice[:-1]).any():
        return None
    pairs = np.stack([order[:-1][twice], order[1:][twice]], axis=1)
    forward = start < end
    if (forward[pairs[:, 0]] == forward[pairs[:, 1]]).any():
        return None
    is_open = np.ones(len(keys), dtype=np.bool_)
    is_open[pairs.ravel()] = False
    return pairs // 3, is_open


def _face_outwards(
    positions: Floats, corners: NDArray[np.int64], pairs: NDArray[np.int64], is_open: Bools
) -> bool:
    """Return whether every connected part encloses a positive volume."""
    count = len(corners)
    labels = components(count, pairs)
    # The mean is the common corner of all tetrahedra, so a small opening hardly changes the sum.
    centered = positions - positions.mean(axis=0)
    doubled = area_vectors(centered, corners.astype(np.int32))
    sums = np.einsum("ta,ta->t", centered[corners[:, 0]], doubled)
    volumes = np.bincount(labels, sums / 6.0, count)
    areas = np.bincount(labels, 0.5 * np.sqrt(np.einsum("ta,ta->t", doubled, doubled)), count)
    sizes = np.bincount(labels, minlength=count)
    open_edges = np.bincount(np.repeat(labels, 3)[is_open], minlength=count)
    parts = sizes > 0
    is_outward = volumes[parts] > _HOLLOW * areas[parts] ** 1.5
    is_closed = open_edges[parts] ** 2 <= _CLOSED * sizes[parts]
    return bool((is_outward & is_closed).all())
