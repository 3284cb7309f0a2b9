"""Runs of triangles of one material, drawn with their colours or only as shapes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import moderngl

from viewer.rendering.gpu.back_faces import Region
from viewer.rendering.gpu.draw_state import clipped, sides
from viewer.rendering.gpu.index_sets import IndexSet, MeshRun
from viewer.rendering.gpu.program import set_uniforms
from viewer.rendering.gpu.surfaces import SAMPLERS
from viewer.rendering.options import DisplayOptions

if TYPE_CHECKING:
    from viewer.rendering.passes.blended_order import SortedTriangles

__all__ = ["Prepare", "draw_runs", "draw_shapes"]

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
    """Draw all opaque or all blended triangles, one material at a time.

    If blended triangles are not sorted, their back faces are drawn first. Back faces of opaque
    triangles are drawn only in the regions ``back_faces``, if given.
    """
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
    """Draw the shapes of all surfaces, with the cutouts of their materials.

    Parameters
    ----------
    array : moderngl.VertexArray
        The mesh with a program whose fragment shader needs no colours.
    indices : IndexSet
        The triangles.
    options : DisplayOptions
        Display options.
    fragment : str
        Name of the fragment shader. With ``"depth"`` back faces are drawn too, because they block
        light; with ``"geometry"`` blended surfaces are omitted, because others show through them.
    prepare : callable
        Sets further uniforms before each run.
    instances : int
        Number of instances.
    is_mirrored : bool
        Whether the mesh is reflected, which reverses the winding of its front faces.
    """
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
