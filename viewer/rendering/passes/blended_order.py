"""Order of blended triangles: runs and the triangles within each, from the farthest to the nearest.

The place of a triangle is its posed centroid. So the order is right for everything but triangles
that intersect or overlap cyclically, and for materials that interleave, which are drawn one after
the other. The posed vertices are read back when the pose changes, and sorted when the view does.
"""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np

from viewer.rendering.gpu.index_sets import IndexSet, MeshRun
from viewer.rendering.gpu.upload import buffer
from viewer.rendering.passes.skin_pass import PosedMesh
from viewer.rig.arrays import Floats

__all__ = ["SortedTriangles"]


class SortedTriangles:
    """Blended triangles in an index buffer of their own, sorted.

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
        self._key: tuple[object, ...] = ()

    def sort(self, mesh: PosedMesh, source: IndexSet, along: Floats) -> None:
        """Sort the triangles, and upload them if their order may have changed.

        Parameters
        ----------
        mesh : PosedMesh
            The updated mesh.
        source : IndexSet
            Triangles of the mesh; the blended ones are used.
        along : (3,)
            Row of the model-view matrix that gives the depth, which decreases with the distance.
        """
        runs = [run for run in source.runs if run.surface.is_blended and run.count]
        key = (mesh.n_updates, along.tobytes(), *((run.first, run.count) for run in runs))
        if key == self._key:
            return
        rows = [np.arange(run.first // 3, (run.first + run.count) // 3) for run in runs]
        triangles = mesh.mesh.triangles[source.order[np.concatenate(rows)]]
        heights = mesh.posed_positions() @ along.astype(np.float32)
        depths = heights[triangles].sum(axis=1)
        counts = np.array([run.count // 3 for run in runs])
        order = np.lexsort((depths, np.repeat(np.arange(len(runs)), counts)))
        data = np.ascontiguousarray(triangles[order], dtype="u4").tobytes()
        # Vertex arrays that use the buffer remain valid when it is given another size.
        self.indices.orphan(len(data))
        self.indices.write(data)
        starts = np.cumsum(counts) - counts
        farthest = np.argsort(np.add.reduceat(depths, starts) / counts, kind="stable")
        self.runs = tuple(replace(runs[one], first=3 * int(starts[one])) for one in farthest)
        self._key = key

    def release(self) -> None:
        """Free the index buffer."""
        self.indices.release()
