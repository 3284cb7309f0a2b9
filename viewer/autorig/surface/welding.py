"""Welding of a mesh into connected surfaces: coincident vertices merged, islands labelled.

Files repeat vertices along texture seams and hard edges. Computations on a surface must not treat
these as borders, or the mesh would tear there.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.geometry.topology import Indices, components, sides_of, welded
from viewer.rigs.mesh import side_lengths, triangle_areas

if TYPE_CHECKING:
    from scipy.sparse import csr_array

# Tolerance as a fraction of the median edge; rounding in text files separates equal vertices by
# less.
_NEAR = 1e-4
# Of an island that does not bend: length of the edges that span it, relative to the diagonal of its
# box (0.58 for the sides of a cube), and fraction of its area in triangles with such an edge. The
# longest part of a leg of three parts has less than half of the area.
_SPANS, _STIFF = 0.5, 0.6


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Welded:
    """A mesh without coincident vertices."""

    positions: Floats
    """(W, 3). Position of the first of the vertices that were joined."""
    triangles: Ints
    """(F, 3) int32. Triangles with three different corners."""
    vertices: Ints
    """(V,) int32. The welded vertex of each vertex of the mesh."""
    islands: Ints
    """(W,) int32. Connected component of each welded vertex, counted from 0. A vertex without a
    triangle is a separate island."""

    @property
    def n_islands(self) -> int:
        """Number of connected components."""
        return int(self.islands.max()) + 1 if len(self.islands) else 0


def weld(positions: Floats, triangles: Ints) -> Welded:
    """Join coincident vertices, drop triangles that collapse to edges, and label the islands.

    A triangle without area is preserved if its corners differ: it closes a gap at a T-junction,
    where only one side of an edge has a vertex.
    """
    same = welded(positions, np.arange(len(positions), dtype=np.int32))
    first, inverse = np.unique(same, return_inverse=True)
    vertices = inverse.astype(np.int32)
    tolerance = _NEAR * _median_edge(positions, triangles)
    if tolerance > 0.0:
        nearby = _joined_nearby(positions[first], tolerance)
        vertices = nearby[vertices]
        first = first[np.unique(nearby, return_index=True)[1]]
    corners = vertices[triangles]
    kept = corners[(corners != np.roll(corners, 1, axis=1)).all(axis=1)]
    return Welded(
        positions=positions[first],
        triangles=kept,
        vertices=vertices,
        islands=islands(len(first), kept),
    )


def one_sided(mesh: Welded) -> Welded:
    """Return a mesh without the second sides of triangles that are there twice.

    Both sides together enclose nothing, and edges of four triangles have no Laplace operator.
    """
    first = np.unique(np.sort(mesh.triangles, axis=1), axis=0, return_index=True)[1]
    return replace(mesh, triangles=mesh.triangles[np.sort(first)])


def islands(n_vertices: int, triangles: Ints) -> Ints:
    """Return each vertex's connected component (V,), numbered in the order of first vertices."""
    return _labels(n_vertices, edges(triangles))


def stiff_islands(mesh: Welded) -> Bools:
    """Return the islands that do not bend, as boxes and rods: (I,).

    Most of their surface spans them from end to end, without vertices in between: a joint in the
    middle would shear them.
    """
    low, high = np.full((mesh.n_islands, 3), np.inf), np.full((mesh.n_islands, 3), -np.inf)
    np.minimum.at(low, mesh.islands, mesh.positions)
    np.maximum.at(high, mesh.islands, mesh.positions)
    owners = mesh.islands[mesh.triangles[:, 0]]
    sides = side_lengths(mesh.positions, mesh.triangles).max(axis=1)
    spans = sides >= _SPANS * np.linalg.norm(high - low, axis=1)[owners]
    areas = triangle_areas(mesh.positions, mesh.triangles)
    spanned = np.bincount(owners, areas * spans, mesh.n_islands)
    found: Bools = spanned > _STIFF * np.bincount(owners, areas, mesh.n_islands)
    return found


def edges(triangles: Ints) -> Ints:
    """Return the undirected edges of triangles, each once: (E, 2) int32, lower index first."""
    starts, ends = sides_of(triangles).reshape(-1, 2).T
    low, high = np.minimum(starts, ends), np.maximum(starts, ends)
    width = int(high.max(initial=0)) + 1
    # ``np.unique`` hashes integers, which takes five times as long as to sort them.
    keys = np.sort(low[low != high].astype(np.int64) * width + high[low != high])
    unique = keys[np.diff(keys, prepend=-1) > 0]
    return np.stack([unique // width, unique % width], axis=1).astype(np.int32)


def edge_graph(positions: Floats, triangles: Ints) -> csr_array:
    """Return the lengths of the edges of triangles, sparse (V, V), in one direction each."""
    from scipy import sparse

    links, count = edges(triangles), len(positions)
    lengths = np.linalg.norm(positions[links[:, 0]] - positions[links[:, 1]], axis=1)
    return sparse.csr_array((lengths, (links[:, 0], links[:, 1])), shape=(count, count))


def _joined_nearby(positions: Floats, tolerance: float) -> Ints:
    """Return a label for each position; positions within the tolerance get the same label."""
    from scipy import spatial

    # Each round merges every position with its nearest neighbour, so the size of clusters at least
    # halves per round; finding all pairs in one pass would take memory quadratic in a cluster's
    # size.
    labels = np.arange(len(positions), dtype=np.int32)
    kept = labels
    while True:
        tree = spatial.cKDTree(positions[kept])
        nearest = tree.query(positions[kept], k=[2], distance_upper_bound=tolerance, workers=-1)[1][
            :, 0
        ]
        rows = np.nonzero(nearest < len(kept))[0]
        if len(rows) == 0:
            return labels
        joined = _labels(len(kept), np.stack([rows, nearest[rows]], axis=1))
        labels = joined[labels]
        kept = kept[np.unique(joined, return_index=True)[1]]


def _labels(count: int, pairs: Ints | Indices) -> Ints:
    """Return each node's component, numbered in the order of first nodes: (count,) int32."""
    # A component is known by its smallest node.
    labels = np.unique(components(count, pairs), return_inverse=True)[1]
    return labels.astype(np.int32)


def _median_edge(positions: Floats, triangles: Ints) -> float:
    links = edges(triangles)
    lengths = np.linalg.norm(positions[links[:, 0]] - positions[links[:, 1]], axis=1)
    lengths = lengths[lengths > 0.0]
    return float(np.median(lengths)) if len(lengths) else 0.0
