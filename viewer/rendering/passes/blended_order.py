"""Order of blended triangles: runs and the triangles within each, from the farthest to the nearest.

Triangles are sorted by their posed centroids. The order is therefore correct except for triangles
that intersect or overlap cyclically, and for interleaved materials, which are drawn one after the
other. The posed vertices are read back when the pose changes, and sorted when the view changes.
"""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np

from viewer.rendering.gpu.index_sets import IndexSet, MeshRun
from viewer.rendering.gpu.posed_mesh import PosedMesh
from viewer.rendering.gpu.upload import buffer
from viewer.rig.arrays import Floats, Ints

__all__ = ["SortedTriangles"]


class SortedTriangles:
    """Blended triangles in a separate index buffer, sorted.

    Parameters
    ----------
    context : moderngl.Context
        The context in use.

    Attributes
    ----------
    indices : moderngl.Buffer
        Indices of split vertices.
    runs : tuple of MeshRun
        A run per material, the farthest first.
    """

    def __init__(self, context: moderngl.Context) -> None:
        self.indices = buffer(context, np.zeros(0), "u4")
        self.runs: tuple[MeshRun, ...] = ()
        self._given: tuple[MeshRun, ...] = ()
        self._buffer: moderngl.Buffer | None = None
        self._triangles: Ints = np.zeros((0, 3), np.int32)
        self._key: tuple[object, ...] = ()
        self._positions, self._n_updates = np.zeros((0, 3), np.float32), -1

    def sort(self, mesh: PosedMesh, source: IndexSet, along: Floats) -> None:
        """Sort the triangles, and upload them if their order may have changed.

        Parameters
        ----------
        mesh : PosedMesh
            The updated mesh.
        source : IndexSet
            Triangles of the mesh; the blended ones are used.
        along : (3,)
            Row of the model-view matrix that yields the depth, which decreases with the distance.
        """
        given = tuple(run for run in source.runs if run.surface.is_blended and run.count)
        if given != self._given or source.indices is not self._buffer:
            rows = [np.arange(run.first // 3, (run.first + run.count) // 3) for run in given]
            self._triangles = mesh.mesh.triangles[source.order[np.concatenate(rows)]]
            self._given, self._buffer, self._key = given, source.indices, ()
        key = mesh.n_updates, along.tobytes()
        if key == self._key:
            return
        if mesh.n_updates != self._n_updates:
            # Reading waits for the GPU, so a moving camera uses the positions of the last pose.
            self._positions, self._n_updates = mesh.posed_positions(), mesh.n_updates
        heights = self._positions @ along.astype(np.float32)
        depths = heights[self._triangles].sum(axis=1)
        stops = np.cumsum([run.count // 3 for run in given])
        parts = np.split(depths, stops[:-1])
        starts = [0, *stops[:-1].tolist()]
        order = [
            start + np.argsort(part, kind="stable")
            for start, part in zip(starts, parts, strict=True)
        ]
        data = np.ascontiguousarray(self._triangles[np.concatenate(order)], "u4").tobytes()
        # Vertex arrays that use the buffer remain valid when it is resized.
        self.indices.orphan(len(data))
        self.indices.write(data)
        farthest = np.argsort([part.mean() for part in parts], kind="stable").tolist()
        self.runs = tuple(replace(given[one], first=3 * starts[one]) for one in farthest)
        self._key = key

    def release(self) -> None:
        """Free the index buffer."""
        self.indices.release()
