"""Drawing of translucent actors as a single layer."""

from __future__ import annotations

from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.mesh_pass import MeshPass
from viewer.rendering.passes.see_through import draw_nearest
from viewer.rendering.view import View
from viewer.rendering.visibility import Meshes, placement_of

__all__ = ["draw_translucent"]


def draw_translucent(
    mesh_pass: MeshPass, meshes: Meshes, view: View, options: DisplayOptions
) -> None:
    """Draw translucent actors over everything opaque.

    Where they overlap, only the nearest surface is visible, so the poses of a motion stay legible.

    Parameters
    ----------
    mesh_pass : MeshPass
        Draws the surfaces.
    meshes : Meshes
        Updated meshes.
    view : View
        The camera's matrices.
    options : DisplayOptions
        Display options.
    """
    drawn = [
        (actor, mesh, opacity)
        for actor, mesh in meshes.singles
        if 0.0 < (opacity := options.opacity * actor.opacity) < 1.0
    ]
    if not drawn:
        return

    def draw() -> None:
        for actor, mesh, opacity in drawn:
            place = placement_of(actor, options)
            for blended in (False, True)[: 1 + mesh.mesh.is_blended]:
                mesh_pass.draw(mesh, place, view, options, actor.color, blended, opacity)

    draw_nearest(mesh_pass.context, draw)
    for actor, mesh, opacity in drawn:
        mesh_pass.draw_lines(mesh, placement_of(actor, options), view, options, opacity)
