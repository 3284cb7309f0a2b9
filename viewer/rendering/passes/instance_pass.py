"""Instanced drawing of actors that share a figure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.mesh_pass import fragment_macros, has_tints, set_surface, shading_of
from viewer.rendering.passes.runs import Prepare, draw_runs, draw_shapes
from viewer.rendering.view import View, set_lights
from viewer.rig.scene import Actor

if TYPE_CHECKING:
    from viewer.rendering.gpu.instance_buffers import InstanceBuffers

__all__ = ["FEWEST", "draw_instance_shapes", "draw_instances", "instance_groups"]

FEWEST = 8
"""Minimum number of actors to draw as instances; see ``instance_groups``."""


def instance_groups(actors: Sequence[Actor], options: DisplayOptions) -> list[list[Actor]]:
    """Return groups of actors to draw as instances: those with the same figure and shape.

    Posed buffers are used instead for small groups, so that camera moves need no re-skinning, and
    for translucent actors, actors with hidden parts, outlines or changed materials, and meshes that
    are drawn several times per frame, in the bind pose or coloured by a scalar. If back faces are
    culled, either all or none of the actors of a group are mirrored, and actors with mirrored
    joints are drawn individually.

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
    groups: dict[tuple[int, bytes, bool], list[Actor]] = {}
    for actor in actors:
        pose, is_opaque = actor.pose, options.opacity * actor.opacity == 1.0
        is_plain = is_opaque and not actor.hidden_parts and not _has_own_look(actor)
        if pose is None or not actor.figure.is_attached or not is_plain:
            continue
        is_mirrored = False
        if options.cull or _has_single_sides(actor):
            if (pose.scales < 0.0).any():
                continue
            sign = np.linalg.det(actor.placement[:3, :3]) * pose.figure_scale
            is_mirrored = bool(sign < 0.0)
        key = id(actor.figure), pose.shape_weights.tobytes(), is_mirrored
        groups.setdefault(key, []).append(actor)
    return [group for group in groups.values() if len(group) >= FEWEST]


def _has_own_look(actor: Actor) -> bool:
    """Return whether outlines are drawn, or expressions may change materials."""
    shapes, mesh, pose = actor.figure.blend_shapes, actor.figure.require_mesh(), actor.pose
    if any(material.outline is not None for material in mesh.materials):
        return True
    has_binds = shapes is not None and shapes.material_binds is not None
    return has_binds and pose is not None and bool(pose.shape_weights.any())


def _has_single_sides(actor: Actor) -> bool:
    """Return whether the back faces of at least one material are not drawn."""
    return any(not material.double_sided for material in actor.figure.require_mesh().materials)


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
        summed=instances.has_sums,
        materials=instances.mesh.has_materials,
        effects=fragment_macros(instances.mesh, view, options),
    )
    instances.place(actors, view)
    instances.use(program, view)
    set_lights(program, view, options.lights)
    set_surface(program, instances.mesh, options)
    indices = instances.mesh.index_set(options.reduced, options.hidden_parts)
    array = instances.array(program, indices)
    draw_runs(array, indices, options, instances.count, blended, instances.is_mirrored)


def draw_instance_shapes(
    programs: Programs,
    instances: InstanceBuffers,
    actors: Sequence[Actor],
    view: View,
    options: DisplayOptions,
    fragment: str,
    prepare: Prepare,
) -> None:
    """Draw instanced surfaces with a fragment shader that shows no colours."""
    program = programs.drawing(
        "instance",
        fragment=fragment,
        skin=instances.method,
        affine=instances.is_affine,
        summed=instances.has_sums,
        materials=instances.mesh.has_materials,
    )
    instances.place(actors, view)
    instances.use(program, view)
    set_uniforms(program, {"u_has_tint": has_tints(instances.mesh, options)})
    indices = instances.mesh.index_set(options.reduced, options.hidden_parts)
    array, mirrored = instances.array(program, indices), instances.is_mirrored
    draw_shapes(array, indices, options, fragment, prepare, instances.count, mirrored)
