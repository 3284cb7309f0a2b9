"""Instanced drawing of actors that share a figure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from viewer.rendering.gpu.program import Programs
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.mesh_pass import draw_runs, draw_solid, set_surface, shading_of
from viewer.rendering.view import View, set_lights
from viewer.rig.scene import Actor

if TYPE_CHECKING:
    from viewer.rendering.gpu.instance_buffers import InstanceBuffers

__all__ = ["FEWEST", "draw_instance_shapes", "draw_instances", "instance_groups"]

FEWEST = 8
"""Minimum number of actors to draw as instances; see ``instance_groups``."""


def instance_groups(actors: Sequence[Actor], options: DisplayOptions) -> list[list[Actor]]:
    """Return groups of actors to draw as instances: those with the same figure and shape.

    Posed buffers are used instead for small groups, so that camera moves need no skinning, for
    translucent actors, and for meshes that are drawn several times per frame, in the bind pose or
    coloured by a scalar quantity.

    Parameters
    ----------
    actors : sequence of Actor
        Actors whose meshes are drawn.
    options : DisplayOptions
        Display options.

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
        if actor.pose is not None and actor.figure.is_attached and actor.opacity == 1.0:
            key = id(actor.figure), actor.pose.shape_weights.tobytes()
            groups.setdefault(key, []).append(actor)
    return [group for group in groups.values() if len(group) >= FEWEST]


def draw_instances(
    programs: Programs,
    instances: InstanceBuffers,
    actors: Sequence[Actor],
    view: View,
    options: DisplayOptions,
    blended: bool = False,
) -> None:
    """Draw the surfaces of actors that share a mesh.

    Parameters
    ----------
    programs : Programs
        Provides the shading programs.
    instances : InstanceBuffers
        Updated buffers.
    actors : sequence of Actor
        The actors with which the buffers were updated, in that order.
    view : View
        The camera's matrices.
    options : DisplayOptions
        Shading and lights.
    blended : bool
        Whether to draw the blended triangles instead of the opaque ones.
    """
    program = programs.drawing(
        "instance",
        shading_of(instances.mesh, options),
        "mesh",
        skin=instances.method,
        affine=instances.is_affine,
        materials=instances.mesh.has_materials,
        effects=view.effects.defines,
    )
    instances.place(actors, view)
    instances.use(program, view)
    set_lights(program, view, options.lights)
    set_surface(program, instances.mesh, options)
    indices = instances.mesh.index_set(options.reduced, options.hidden_parts)
    array = instances.array(program, indices)
    draw_runs(array, indices, options, instances.count, blended)


def draw_instance_shapes(
    programs: Programs,
    instances: InstanceBuffers,
    actors: Sequence[Actor],
    view: View,
    options: DisplayOptions,
    fragment: str,
) -> None:
    """Draw instanced surfaces with a fragment shader that needs no material."""
    program = programs.drawing(
        "instance", fragment=fragment, skin=instances.method, affine=instances.is_affine
    )
    instances.place(actors, view)
    instances.use(program, view)
    indices = instances.mesh.index_set(options.reduced, options.hidden_parts)
    draw_solid(instances.array(program, indices), indices, instances.count)
