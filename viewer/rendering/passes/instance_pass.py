"""Draws actors that share a figure as instances of its mesh."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from viewer.rendering.gpu.program import Programs
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.mesh_pass import draw_runs, set_surface
from viewer.rendering.view import View, set_lights
from viewer.rig.scene import Actor

if TYPE_CHECKING:
    from viewer.rendering.gpu.instance_buffers import CrowdBuffers

__all__ = ["FEWEST", "crowds_of", "draw_crowd"]

FEWEST = 8
"""Actors from which on they are drawn as a crowd; see ``crowds_of``."""


def crowds_of(actors: Sequence[Actor], options: DisplayOptions) -> list[list[Actor]]:
    """Return which actors are drawn together: those of one figure and one shape.

    Few actors keep their posed buffers, which a camera that moves does not skin anew, and so do all
    where those are drawn several times or as they were bound, or where every vertex has a number.

    Parameters
    ----------
    actors : sequence of Actor
        Whose meshes are drawn.
    options : DisplayOptions
        What is shown.

    Returns
    -------
    list of list of Actor
        Groups of at least ``FEWEST``.
    """
    if options.show == "binding" or options.shading == "scalar":
        return []
    if options.wireframe or options.normals:
        return []
    groups: dict[tuple[int, bytes], list[Actor]] = {}
    for actor in actors:
        if actor.pose is not None and actor.figure.is_attached:
            key = id(actor.figure), actor.pose.shape_weights.tobytes()
            groups.setdefault(key, []).append(actor)
    return [group for group in groups.values() if len(group) >= FEWEST]


def draw_crowd(
    programs: Programs,
    crowd: CrowdBuffers,
    actors: Sequence[Actor],
    view: View,
    options: DisplayOptions,
) -> None:
    """Draw the surfaces of a crowd.

    Parameters
    ----------
    programs : Programs
        Gives the shading programs.
    crowd : CrowdBuffers
        Already updated.
    actors : sequence of Actor
        The same, in the same order.
    view : View
        The camera's matrices.
    options : DisplayOptions
        Shading and lights.
    """
    program = programs.drawing(
        "crowd", options.shading, "mesh", skin=crowd.method, affine=crowd.is_affine
    )
    crowd.place(actors, view)
    crowd.use(program, view)
    set_lights(program, view, options.lights)
    set_surface(program, crowd.mesh, options)
    indices = crowd.mesh.index_set(options.reduced, options.hidden_parts)
    draw_runs(crowd.array(program, indices), indices, options.texture, instances=crowd.count)
