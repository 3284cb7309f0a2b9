"""Outlines of toon materials: the back faces of the surface, moved outwards along its normals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import moderngl
import numpy as np

from viewer.rendering.gpu.index_sets import MeshRun
from viewer.rendering.gpu.program import set_uniforms
from viewer.rendering.gpu.surfaces import SAMPLERS, Surface
from viewer.rendering.options import DisplayOptions
from viewer.rig.arrays import Floats
from viewer.rig.material import TEXTURES
from viewer.rig.units import METRES

__all__ = ["draw_hulls", "outlined_runs"]

_WIDTH = TEXTURES.index("occlusion_texture")  # texture unit of the width


def outlined_runs(runs: Sequence[MeshRun], blended: bool) -> list[MeshRun]:
    """Return the opaque or the blended runs that have an outline."""
    return [
        run for run in runs if run.surface.outline is not None and run.surface.is_blended == blended
    ]


def draw_hulls(
    array: moderngl.VertexArray,
    runs: Sequence[MeshRun],
    placement: Floats,
    unit: str,
    options: DisplayOptions,
    is_mirrored: bool,
) -> None:
    """Draw the outlines of surfaces.

    Parameters
    ----------
    array : moderngl.VertexArray
        The mesh with the program of ``hull.vert``, whose other uniforms are already set.
    runs : sequence of MeshRun
        Result of ``outlined_runs``.
    placement : (4, 4)
        Matrix from figure space to scene space.
    unit : str
        Unit of the figure, see ``Figure.unit``.
    options : DisplayOptions
        Display options.
    is_mirrored : bool
        Whether the mesh is reflected, which reverses the winding of its front faces.
    """
    program, context = array.program, array.ctx
    scale = float(np.cbrt(abs(np.linalg.det(placement[:3, :3])))) / METRES.get(unit, 1.0)
    context.enable(moderngl.CULL_FACE)
    context.cull_face = "front"
    context.front_face = "cw" if is_mirrored else "ccw"
    for run in runs:
        run.surface.use(program, options.texture)
        set_uniforms(program, _uniforms(run.surface, scale, options.texture))
        array.render(moderngl.TRIANGLES, vertices=run.count, first=run.first)
    context.front_face, context.cull_face = "ccw", "back"
    context.disable(moderngl.CULL_FACE)


def _uniforms(surface: Surface, scale: float, textured: bool) -> dict[str, Any]:
    """Return the uniforms of an outline; ``scale``: camera units per metre."""
    outline = surface.outline
    assert outline is not None  # checked by the caller
    values, unit = surface.uniforms, SAMPLERS["u_occlusion_map"]
    has_map = textured and any(used == unit for used, _ in surface.textures)
    places = np.frombuffer(values["u_places"], "f4").reshape(-1, 9)
    on_screen = outline.mode == "screen"
    return {
        "u_outline_color": outline.color,
        "u_outline_mix": outline.mix,
        "u_hull_width": outline.width * (1.0 if on_screen else scale),
        "u_hull_on_screen": on_screen,
        "u_has_width_map": has_map,
        "u_width_map": unit,
        "u_width_place": places[_WIDTH].tobytes(),
        "u_width_set": int(np.frombuffer(values["u_uv_sets"], "i4")[_WIDTH]),
    }
