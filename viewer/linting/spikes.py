"""Check of meshes for spikes: single vertices that stick out of the surface around them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.linting._finding import Finding
from viewer.linting._mirror import Mirror, mirror_of
from viewer.linting._subject import Subject
from viewer.linting._surface import FEWEST, Surface, surface_of
from viewer.phrases import counted
from viewer.rigs.arrays import Bools, Floats, largest_first
from viewer.rigs.geometry.topology import Indices
from viewer.rigs.geometry.vectors import reflected

# The height of a vertex is its distance from the mean of its neighbours. The tips of ears, hair and
# claws of 40 figures of artists are at most 2.2 edges high, those of weapons 4.
_EDGES = 5.0
_HEIGHT = 0.01  # smallest height that is seen, relative to the figure's size
# In a symmetric mesh, a vertex whose neighbours all have counterparts, but which has none itself,
# was moved on one side; artists leave some by up to 0.8 % of the size.


def check(subject: Subject) -> Iterator[Finding]:
    """Compare each vertex with its neighbours, and with its counterpart on the other side."""
    figure, size = subject.actor.figure, subject.size()
    mesh = figure.mesh
    if mesh is None or mesh.n_vertices < FEWEST or mesh.n_triangles == 0 or not size > 0.0:
        return
    if subject.lacks("positions", "triangles"):
        return
    surface = surface_of(figure)
    heights, edges = _heights(mesh.positions, surface)
    tall = heights > _EDGES * edges
    if figure.is_attached and not subject.lacks("bindings"):
        mirror = mirror_of(figure)
        if mirror is not None:
            tall |= _one_sided(mesh.positions, surface, mirror, heights, _HEIGHT * size)
    spikes = np.flatnonzero(tall & (heights > _HEIGHT * size))
    if len(spikes) == 0:
        return
    spikes = largest_first(spikes, heights)
    first = int(spikes[0])
    yield subject.found(
        "M013.vertices: {n} out of the surface (worst: vertex {vertex}, {height} from the middle "
        "of its neighbours)",
        n=counted(len(spikes), "vertex", "sticks", "stick"),
        vertex=first,
        height=subject.length(float(heights[first])),
        vertices=spikes,
        at=("positions", first),
    )


def _heights(points: Floats, surface: Surface) -> tuple[Floats, Floats]:
    """Return each place's distance from the mean of its neighbours, and their mean edge: (V,)."""
    (start, end), count = surface.edges.T, len(points)
    degree = np.bincount(start, minlength=count)
    sums = [np.bincount(start, points[end, axis], minlength=count) for axis in range(3)]
    means = np.stack(sums, axis=1) / np.maximum(degree, 1)[:, None]
    heights = np.linalg.norm(points - means, axis=1)
    heights[degree < 3] = 0.0
    # The edges of the neighbours without those to the vertex itself, which a spike makes long.
    lengths = np.linalg.norm(points[start] - points[end], axis=1)
    total = np.bincount(start, lengths, minlength=count)
    others = np.bincount(start, total[end] - lengths, minlength=count)
    n_others = np.bincount(start, degree[end] - 1, minlength=count)
    edges = np.where(n_others > 0, others / np.maximum(n_others, 1), np.inf)
    return heights, edges


def _one_sided(
    points: Floats, surface: Surface, mirror: Mirror, heights: Floats, least: float
) -> Bools:
    """Return which vertices, above ``least``, one side of a symmetric mesh has alone: (V,)."""
    (start, end), count = surface.edges.T, len(points)
    result = np.zeros(count, dtype=np.bool_)
    is_place = surface.place == np.arange(count)
    degree = np.bincount(start, minlength=count)
    known = np.bincount(start, mirror.known[end], minlength=count)
    alone = np.flatnonzero(is_place & ~mirror.known & (degree >= 3) & (known == degree))
    for vertex in alone[heights[alone] > least].tolist():
        other = _opposite(surface, mirror, vertex, alone)
        image = reflected(points[vertex], mirror.axis, mirror.centre)
        is_moved = other is not None and np.linalg.norm(points[other] - image) > least
        # Of the two, the one that is higher above its neighbours was moved.
        if other is not None and is_moved and heights[vertex] >= heights[other]:
            result[vertex] = True
    return result


def _opposite(surface: Surface, mirror: Mirror, vertex: int, alone: Indices) -> int | None:
    """Return the vertex without a counterpart whose neighbours are those of another, mirrored."""
    starts, ends = surface.edges.T
    first, last = np.searchsorted(starts, [vertex, vertex + 1])
    around = mirror.vertices[ends[first:last]]
    candidates = alone
    for neighbour in around.tolist():
        low, high = np.searchsorted(starts, [neighbour, neighbour + 1])
        candidates = np.intersect1d(candidates, ends[low:high])
    return int(candidates[0]) if len(candidates) else None
