"""Runs of triangles of one material: drawn with their colours or only as shapes, and sorted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import moderngl
import numpy as np

from viewer.rendering.gpu.back_faces import Region
from viewer.rendering.gpu.draw_state import clipped, sides
from viewer.rendering.gpu.index_sets import IndexSet, MeshRun
from viewer.rendering.gpu.posed_mesh import PosedMesh
from viewer.rendering.gpu.program import set_uniforms
from viewer.rendering.gpu.surfaces import SAMPLERS
from viewer.rendering.gpu.upload import buffer
from viewer.rendering.options import DisplayOptions
from viewer.rigs.arrays import Floats, Ints

Prepare = Callable[[moderngl.Program, MeshRun], object]
"""Function that sets further uniforms of a program before a run is drawn."""


def draw_runs(
    array: moderngl.VertexArray,
    indices: IndexSet | SortedTriangles,
    options: DisplayOptions,
    instances: int = 1,
    blended: bool = False,
    is_mirrored: bool = False,
    back_faces: Sequence[Region] | None = None,
) -> None:
    """Draw all opaque or all blended triangles, one material at a time."""
    # If blended triangles are not sorted, their back faces are drawn first. Back faces of opaque
    # triangles are drawn only in the regions ``back_faces``, if given.
    two_passes = blended and isinstance(indices, IndexSet)
    plain = {"u_metallic": options.metallic, "u_roughness": options.roughness}
    for run in indices.runs:
        if run.surface.is_blended != blended:
            continue
        set_uniforms(array.program, plain)
        run.surface.use(array.program, options.texture)
        is_open = run.surface.double_sided
        is_culled = options.cull or back_faces is not None
        with sides(array.ctx, is_culled, is_open, two_passes, is_mirrored) as orders:
            for order in orders:
                array.ctx.cull_face = order
                _render(array, run, instances)
            if back_faces and is_open and not options.cull:
                array.ctx.cull_face = "front"
                for region in back_faces:
                    with clipped(array.ctx, region):
                        _render(array, run, instances)


def draw_shapes(
    array: moderngl.VertexArray,
    indices: IndexSet,
    options: DisplayOptions,
    fragment: str,
    prepare: Prepare,
    instances: int = 1,
    is_mirrored: bool = False,
) -> None:
    """Draw the shapes of all surfaces, with the cutouts of their materials."""
    # With "depth" back faces are drawn too, because they block light; with "geometry" blended
    # surfaces are omitted, because others show through them.
    program = array.program
    has_materials = "u_alpha_mode" in program
    if has_materials:
        set_uniforms(program, SAMPLERS)
    for run in indices.runs:
        surface = run.surface
        if surface.is_blended and fragment == "geometry":
            continue
        if has_materials:
            surface.use(program, options.texture)
        prepare(program, run)
        is_open = surface.double_sided or fragment == "depth"
        is_culled = options.cull and fragment != "depth"
        with sides(array.ctx, is_culled, is_open, False, is_mirrored):
            _render(array, run, instances)


def _render(array: moderngl.VertexArray, run: MeshRun, instances: int) -> None:
    array.render(moderngl.TRIANGLES, vertices=run.count, first=run.first, instances=instances)


class SortedTriangles:
    """Blended triangles in a separate index buffer, sorted from the farthest to the nearest."""

    # Triangles are sorted by their posed centroids. The order is therefore correct except for
    # triangles that intersect or overlap cyclically, and for interleaved materials, which are drawn
    # one after the other. The posed vertices are read back when the pose changes, and sorted when
    # the view changes.

    def __init__(self, context: moderngl.Context) -> None:
        self.indices = buffer(context, np.zeros(0), "u4")
        self.runs: tuple[MeshRun, ...] = ()
        self._given: tuple[MeshRun, ...] = ()
        self._buffer: moderngl.Buffer | None = None
        self._triangles: Ints = np.zeros((0, 3), np.int32)
        self._key: tuple[object, ...] = ()
        self._positions, self._n_updates = np.zeros((0, 3), np.float32), -1

    def sort(self, mesh: PosedMesh, source: IndexSet, along: Floats) -> None:
        """Sort the triangles, and upload them if their order may have changed."""
        # ``along`` is the row, (3,), of the model-view matrix that yields the depth, which
        # decreases with the distance.
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
