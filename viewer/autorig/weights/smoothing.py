"""Weight smoothing along edges, around the vertices whose weights were inpainted."""

from __future__ import annotations

from typing import Any

import numpy as np

from viewer.autorig.surface.welding import edges
from viewer.rig._scipy import scipy_part
from viewer.rig.arrays import Bools, Floats, Ints

__all__ = ["ROUNDS", "smooth", "within"]

ROUNDS = 10
_FRACTION = 0.2  # blend factor of the neighbours' mean in each iteration
# Each iteration spreads weights by one edge; weights below this are dropped at the end.
_NEGLIGIBLE = 1e-6


def smooth(weights: Any, triangles: Ints, active: Bools, rounds: int = ROUNDS) -> Any:
    """Blend weights with the mean of their neighbours: w <- 0.8 w + 0.2 mean(w of neighbours).

    Parameters
    ----------
    weights : sparse (W, J) in rows
        Rows that sum to 1 keep that sum.
    triangles : (F, 3)
        Vertex indices; their edges define neighbours.
    active : (W,) bool
        Vertices that change; the others are only read.
    rounds : int
        Number of iterations.

    Returns
    -------
    sparse (W, J) in rows
        New weights below 1e-6 are dropped, and rows rescaled to their previous sum.
    """
    sparse = scipy_part("sparse")
    links = edges(triangles)
    both = np.concatenate([links, links[:, ::-1]])
    both = both[active[both[:, 0]]]
    count = weights.shape[0]
    degrees = np.bincount(both[:, 0], minlength=count)
    mixed = degrees > 0  # the weights of vertices without neighbours are unchanged
    mean = sparse.csr_array(
        (_FRACTION / degrees[both[:, 0]], (both[:, 0], both[:, 1])), shape=(count, count)
    )
    step = sparse.csr_array(mean + sparse.diags_array(np.where(mixed, 1.0 - _FRACTION, 1.0)))
    result = weights
    for _ in range(rounds):
        result = step @ result
    changed = np.repeat(mixed, np.diff(result.indptr))
    result.data[changed & (np.abs(result.data) < _NEGLIGIBLE)] = 0.0
    result.eliminate_zeros()
    before = np.asarray(weights.sum(axis=1)).ravel()
    after = np.asarray(result.sum(axis=1)).ravel()
    factors = np.divide(before, after, out=np.ones_like(after), where=after > 0.0)
    return sparse.csr_array(sparse.diags_array(factors) @ result)


def within(positions: Floats, triangles: Ints, sources: Bools, reach: float) -> Bools:
    """Return the vertices connected to a source by a path of edges no longer than ``reach``.

    Parameters
    ----------
    positions : (W, 3)
        Any unit.
    triangles : (F, 3)
        Vertex indices.
    sources : (W,) bool
        Vertices at which the paths start.
    reach : float
        Maximum length in the unit of ``positions``.

    Returns
    -------
    (W,) bool
        Reached vertices, including the sources.
    """
    sparse, graph = scipy_part("sparse"), scipy_part("sparse.csgraph")
    if not sources.any():
        return sources.copy()
    links = edges(triangles)
    lengths = np.linalg.norm(positions[links[:, 0]] - positions[links[:, 1]], axis=1)
    count = len(positions)
    matrix = sparse.csr_array((lengths, (links[:, 0], links[:, 1])), shape=(count, count))
    distances = graph.dijkstra(
        matrix, directed=False, indices=np.nonzero(sources)[0], limit=reach, min_only=True
    )
    return np.isfinite(distances)
