"""Welding of a mesh into connected surfaces: coincident vertices merged, islands labelled.

Files repeat vertices along texture seams and hard edges. Computations on a surface must not treat
these as borders, or the mesh would tear there.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats, Ints

# Tolerance as a fraction of the median edge; rounding in text files separates equal vertices by
# less.
_NEAR = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
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
    first, vertices = _joined_exactly(positions)
    tolerance = _NEAR * _median_edge(positions, triangles)
    if tolerance > 0.0:
        nearby = _joined_nearby(positions[first], tolerance)
        vertices = nearby[vertices]
        first = first[np.unique(nearby, return_index=True)[1]]
    welded, corners = positions[first], vertices[triangles].astype(np.int32)
    kept = corners[(corners != np.roll(corners, 1, axis=1)).all(axis=1)]
    return Welded(
        positions=welded,
        triangles=kept,
        vertices=vertices.astype(np.int32),
        islands=islands(len(welded), kept),
    )


def islands(n_vertices: int, triangles: Ints) -> Ints:
    """Return each vertex's connected component (V,), numbered in the order of first vertices."""
    from scipy import sparse
    from scipy.sparse import csgraph as graph

    links = edges(triangles)
    matrix = sparse.csr_array(
        (np.ones(len(links), dtype=np.int8), (links[:, 0], links[:, 1])),
        shape=(n_vertices, n_vertices),
    )
    return _in_order(graph.connected_components(matrix, directed=False)[1])


def edges(triangles: Ints) -> Ints:
    """Return the undirected edges of triangles, each once: (E, 2) int32, lower index first."""
    pairs, _ = _counted_edges(triangles)
    return pairs


def non_manifold_edges(triangles: Ints) -> Ints:
    """Return the non-manifold edges, shared by more than two triangles: (E, 2) int32."""
    pairs, counts = _counted_edges(triangles)
    return pairs[counts > 2]


def _counted_edges(triangles: Ints) -> tuple[Ints, Any]:
    corners = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    low, high = corners.min(axis=1), corners.max(axis=1)
    width = int(corners.max(initial=0)) + 1
    keys = low[low != high].astype(np.int64) * width + high[low != high]
    unique, counts = np.unique(keys, return_counts=True)
    return np.stack([unique // width, unique % width], axis=1).astype(np.int32), counts


def _joined_exactly(positions: Floats) -> tuple[Any, Any]:
    """Return the first vertex at each position, in vertex order, and each vertex's position."""
    # Adding 0 replaces -0.0 by 0.0, as equal positions must have equal bytes.
    rows = np.ascontiguousarray(positions + 0.0).view(np.dtype((np.void, 24))).ravel()
    _, first, inverse = np.unique(rows, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return np.sort(first), rank[inverse]


def _joined_nearby(positions: Floats, tolerance: float) -> Any:
    """Return a label for each position; positions within the tolerance get the same label."""
    from scipy import sparse, spatial
    from scipy.sparse import csgraph as graph

    # Each round merges every position with its nearest neighbour, so the size of clusters at least
    # halves per round; finding all pairs in one pass would take memory quadratic in a cluster's
    # size.
    labels: Any = np.arange(len(positions))
    kept = labels
    while True:
        tree = spatial.cKDTree(positions[kept])
        nearest = tree.query(positions[kept], k=[2], distance_upper_bound=tolerance, workers=-1)[1][
            :, 0
        ]
        rows = np.nonzero(nearest < len(kept))[0]
        if len(rows) == 0:
            return labels
        links = sparse.csr_array(
            (np.ones(len(rows), dtype=np.int8), (rows, nearest[rows])),
            shape=(len(kept), len(kept)),
        )
        joined = _in_order(graph.connected_components(links, directed=False)[1])
        labels = joined[labels]
        kept = kept[np.unique(joined, return_index=True)[1]]


def _in_order(labels: Ints) -> Ints:
    """Renumber labels by their first occurrence."""
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int32)
    rank[np.argsort(first)] = np.arange(len(first), dtype=np.int32)
    return rank[inverse]


def _median_edge(positions: Floats, triangles: Ints) -> float:
    links = edges(triangles)
    lengths = np.linalg.norm(positions[links[:, 0]] - positions[links[:, 1]], axis=1)
    lengths = lengths[lengths > 0.0]
    return float(np.median(lengths)) if len(lengths) else 0.0
