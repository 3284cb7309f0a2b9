"""Order of blended triangles: runs and the triangles within each, from the farthest to the nearest.

The place of a triangle is its posed centroid. The order is therefore correct except for triangles
that intersect or overlap cyclically, and for interleaved materials, which are drawn one after the
other. The posed vertices are read back when the pose changes, and sorted when the view does.
"""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.rendering.gpu.index_sets import IndexSet, MeshRun
from viewer.rendering.gpu.ownership import Kept
from viewer.rendering.gpu.upload import buffer
from viewer.rendering.passes.skin_pass import PosedMesh
from viewer.rig.arrays import Floats

__all__ = ["BlendedOrder", "SortedTriangles"]


class SortedTriangles:
    """The blended triangles of an index set in an index buffer of their own.

    Parameters
    ----------
    context : moderngl.Context
        The context in use.
    source : IndexSet
        All triangles.
    triangles : (T, 3)
        Their split vertices, in the order of the index set.

    Attributes
    ----------
    indices : moderngl.Buffer
        Indices of split vertices.
    runs : tuple of MeshRun
        A run per material, the farthest first.
    """

    def __init__(
        self, context: moderngl.Context, source: IndexSet, triangles: NDArray[np.int32]
    ) -> None:
        rows, starts, count = [], [], 0
        self._given: list[MeshRun] = [run for run in source.runs if run.surface.is_blended]
        for run in self._given:
            rows.append(np.arange(run.first // 3, (run.first + run.count) // 3))
            starts.append(count)
            count += len(rows[-1])
        self._starts = np.array(starts)
        self._owners = np.repeat(np.arange(len(rows)), [len(one) for one in rows])
        self._triangles = triangles[np.concatenate(rows)]
        self._key: tuple[object, ...] = ()
        self.runs: tuple[MeshRun, ...] = ()
        self.indices = buffer(context, self._triangles, "u4")

    def sort(self, mesh: PosedMesh, along: Floats) -> None:
        """Sort the triangles, and upload them if their order may have changed.

        Parameters
        ----------
        mesh : PosedMesh
            The updated mesh.
        along : (3,)
            Row of the model-view matrix that gives the depth, which decreases with the distance.
        """
        key = mesh.n_updates, along.tobytes()
        if key == self._key:
            return
        heights = mesh.posed_positions() @ along.astype(np.float32)
        depths = heights[self._triangles].sum(axis=1)
        order = np.lexsort((depths, self._owners))
        self.indices.write(np.ascontiguousarray(self._triangles[order], dtype="u4"))
        counts = np.array([run.count // 3 for run in self._given])
        means = np.add.reduceat(depths, self._starts) / counts
        self.runs = tuple(
            replace(self._given[index], first=3 * int(self._starts[index]))
            for index in np.argsort(means, kind="stable").tolist()
        )
        self._key = key

    def release(self) -> None:
        """Free the index buffer."""
        self.indices.release()


class BlendedOrder:
    """The sorted blended triangles of one posed mesh, per index set."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._sorted: Kept[IndexSet, SortedTriangles] = Kept()

    def sorted(self, mesh: PosedMesh, source: IndexSet, along: Floats) -> SortedTriangles:
        """Return the blended triangles of an index set, sorted; see ``SortedTriangles.sort``."""

        def make() -> SortedTriangles:
            return SortedTriangles(self._context, source, mesh.mesh.triangles[source.order])

        found = self._sorted.get(source, make)
        found.sort(mesh, along)
        return found

    def release(self) -> None:
        """Free all index buffers."""
        self._sorted.keep_only([])
