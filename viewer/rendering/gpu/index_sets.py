"""Index buffers of the drawn triangles, in an order that keeps neighbours together.

GPUs cache the results of recent vertices, at most a few hundred. Files often list triangles in an
order that does not benefit from this cache, so that every vertex is shaded three to five times; in
the order of a space-filling curve, it is shaded once or twice (``tests/bench/bench_instances.py``).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.progress import report
from viewer.rendering.gpu.surfaces import PLAIN, Surface
from viewer.rendering.gpu.upload import buffer
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.memo import Memo
from viewer.rigs.mesh import bounding_box, split_seams
from viewer.rigs.scene import Scene

_CURVE_BITS = 10  # bits per axis
_split: Memo[Figure, tuple[Ints, Ints, Ints]] = Memo()
_orders: Memo[Figure, Ints] = Memo()


@dataclass(frozen=True, slots=True)
class MeshRun:
    """Consecutive triangles of one material, and of one part until runs are merged."""

    # Indices are counted from the buffer's start; the part is -1 for several or none.

    first: int
    count: int
    surface: Surface
    part: int = -1


@dataclass(frozen=True, slots=True)
class IndexSet:
    """An index buffer and its runs; its creator releases the buffer."""

    indices: moderngl.Buffer
    """Indices of split vertices."""
    runs: tuple[MeshRun, ...]
    """Drawn runs, in the order of the buffer."""
    order: Ints
    """(N,) int32. Index of the given triangle at each position of the buffer."""

    @property
    def spans(self) -> tuple[tuple[int, int], ...]:
        """First index and number of indices of all runs; adjacent runs are merged."""
        spans: list[tuple[int, int]] = []
        for run in self.runs:
            if spans and sum(spans[-1]) == run.first:
                spans[-1] = spans[-1][0], spans[-1][1] + run.count
            else:
                spans.append((run.first, run.count))
        return tuple(spans)

    def without(self, hidden: Collection[int]) -> IndexSet:
        """Return the same buffer without the runs of some parts; adjacent runs are merged."""
        runs: list[MeshRun] = []
        for run in self.runs:
            if run.part in hidden:
                continue
            before = runs[-1] if runs else None
            if (
                before is not None
                and before.surface is run.surface
                and before.first + before.count == run.first
            ):
                runs[-1] = replace(before, count=before.count + run.count, part=-1)
            else:
                runs.append(run)
        return replace(self, runs=tuple(runs))

    @property
    def is_blended(self) -> bool:
        """Whether any triangle is blended."""
        return any(run.surface.is_blended and run.count for run in self.runs)


def index_set(
    context: moderngl.Context,
    triangles: Ints,
    materials: Ints,
    surfaces: list[Surface],
    order: Ints | None = None,
    parts: Ints | None = None,
) -> IndexSet:
    """Upload triangles, (T, 3) split vertices, with a run for each material of each part."""
    # Materials, (T,), are indices into the surfaces and parts, (T,), numbers, -1 for none. The
    # order, (T,), is that of ``curve_order``; by default that of the file, as is that of the runs.
    parts = np.full(len(triangles), -1, dtype=np.int32) if parts is None else parts
    edges = _edges(materials, parts)
    runs = []
    for first, last in zip([0, *edges], [*edges, len(materials)], strict=True):
        index = int(materials[first]) if len(materials) else -1
        surface = PLAIN if index < 0 else surfaces[index]
        part = int(parts[first]) if len(parts) else -1
        runs.append(MeshRun(3 * int(first), 3 * int(last - first), surface, part))
    if order is None:
        order = np.arange(len(triangles), dtype=np.int32)
    return IndexSet(buffer(context, triangles[order], "u4"), tuple(runs), order)


def _edges(materials: Ints, parts: Ints) -> Ints:
    """Return the first triangle of each run except the first."""
    is_first = (np.diff(materials) != 0) | (np.diff(parts) != 0)
    return (np.flatnonzero(is_first) + 1).astype(np.int32)


def curve_order(triangles: Ints, materials: Ints, parts: Ints, positions: Floats) -> Ints:
    """Return the order, (T,) int32, of triangles along a space-filling curve within each run."""
    # Materials and parts, (T,), are -1 for none; the rest positions, (R, 3), are of the vertices
    # that the triangles, (T, 3), refer to.
    if not len(triangles):
        return np.zeros(0, dtype=np.int32)
    run = np.zeros(len(triangles), dtype=np.int64)
    run[_edges(materials, parts)] = 1
    # The sum of the corners is three times the centre; a mean over an axis takes longer.
    one, two, three = triangles.T
    centers = positions.take(one, axis=0) + positions.take(two, axis=0)
    centers += positions.take(three, axis=0)
    along = (np.cumsum(run) << 3 * _CURVE_BITS) + curve_places(centers)
    return np.argsort(along, kind="stable").astype(np.int32)


def curve_places(points: Floats) -> NDArray[np.int64]:
    """Return the positions of points, (N, 3), on a Z-order curve through their box (Morton 1966).

    These are Morton codes, (N,): interleaved bits of x, y and z, with 1024 cells along the longest
    side.

    >>> curve_places(np.array([[0.0, 0, 0], [1023, 0, 0], [0, 1, 0], [1, 1, 1]])).tolist()
    [0, 153391689, 2, 7]
    """
    low, high = bounding_box(points)
    size = float((high - low).max()) or 1.0
    cells = ((points - low) * ((2**_CURVE_BITS - 1) / size)).astype(np.int64)
    # Each step spreads groups of bits, until there are two zeros between any two bits.
    for shift, mask in ((16, 0x30000FF), (8, 0x300F00F), (4, 0x30C30C3), (2, 0x9249249)):
        cells = (cells | cells << shift) & mask
    return cells[:, 0] | cells[:, 1] << 1 | cells[:, 2] << 2


def kept_triangles(figure: Figure, hidden: tuple[int, ...], triangles: Ints) -> Bools:
    """Return a mask, (T,), of triangles with a corner outside the hidden body parts."""
    if figure.body_parts is None or not hidden:
        return np.ones(len(triangles), dtype=bool)
    is_shown: Bools = ~np.isin(figure.body_parts.of_vertex, hidden)
    return np.any(is_shown[triangles], axis=1)


def prepare_scene(scene: Scene) -> None:
    """Compute the order of triangles in advance, in the thread that reads files."""
    # For millions of triangles, this takes longer than the upload and would block the window.
    for figure in dict.fromkeys(actor.figure for actor in scene.actors):
        if figure.mesh is not None:
            report(0, 0, "")
            triangle_order(figure)


def split_vertices(figure: Figure) -> tuple[Ints, Ints, Ints]:
    """Return ``split_seams`` of a figure's mesh."""
    return _split.get(figure, (), lambda: split_seams(figure.require_mesh()))


def triangle_order(figure: Figure) -> Ints:
    """Return the order in which all triangles of a figure are uploaded: (T,) int32."""

    def order() -> Ints:
        mesh = figure.require_mesh()
        sources, _, triangles = split_vertices(figure)
        rest = mesh.positions[sources]
        return curve_order(triangles, mesh.material_indices, mesh.part_indices, rest)

    return _orders.get(figure, (), order)
