"""Draws a surface that is not part of the scene over it: translucent, or only its edges."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import moderngl

from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.program import Programs
from viewer.rendering.options import Color, DisplayOptions
from viewer.rendering.passes.mesh_pass import MeshPass
from viewer.rendering.passes.see_through import draw_layer
from viewer.rendering.passes.skin_pass import PosedMesh
from viewer.rendering.view import View
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure

__all__ = ["GHOST_COLOR", "STYLES", "Ghost", "GhostPass"]

GHOST_COLOR = (0.10, 0.42, 0.85)
"""Linear."""

_NEARER = (-2.0, -4.0)  # OpenGL's factor and units of depth

STYLES = ("solid", "translucent", "wireframe")


@dataclass(frozen=True, slots=True, eq=False)
class Ghost:
    """A visible surface that cannot be picked.

    Attributes
    ----------
    figure : Figure
        With a mesh, which is drawn as it is.
    placement : (4, 4)
        Figure space to scene.
    style : str
        One of ``STYLES``.
    color : (r, g, b)
        Linear.
    """

    figure: Figure
    placement: Floats
    style: str = "translucent"
    color: Color = GHOST_COLOR


class GhostPass:
    """Draws ghosts; their mesh is uploaded when another one is drawn than before.

    Parameters
    ----------
    context : moderngl.Context
        The context in use.
    programs : Programs
        Gives the programs.
    mesh_pass : MeshPass
        Draws the surface.
    """

    def __init__(self, context: moderngl.Context, programs: Programs, mesh_pass: MeshPass) -> None:
        self.context, self.programs, self._mesh_pass = context, programs, mesh_pass
        self._owner = Owner()
        self._figure: Figure | None = None
        self._posed: PosedMesh | None = None

    def draw(self, ghost: Ghost, view: View, options: DisplayOptions) -> None:
        """Draw a ghost over what has been drawn.

        Parameters
        ----------
        ghost : Ghost
            What, where and how.
        view : View
            The camera's matrices.
        options : DisplayOptions
            Of the scene: lights count, textures and colours of numbers do not.

        Raises
        ------
        RenderError
            If the driver has no room for it.
        """
        posed = self._uploaded(ghost.figure)
        xray = ghost.style == "translucent"
        look = replace(
            options, shading="phong", xray=xray, texture=False, reduced=False, hidden_parts=()
        )
        if ghost.style == "wireframe":
            self.context.depth_func = "<="
            self._mesh_pass.draw_edges(posed, ghost.placement, view, look)
            self.context.depth_func = "<"
            return
        draw = partial(self._mesh_pass.draw, posed, ghost.placement, view, look, ghost.color)
        # A ghost that lies exactly on a surface is seen, and does not flicker.
        self.context.polygon_offset = _NEARER
        draw_layer(self.context, look, draw)
        self.context.polygon_offset = 0.0, 0.0

    def _uploaded(self, figure: Figure) -> PosedMesh:
        if self._posed is None or figure is not self._figure:
            self.release()
            notes: list[str] = []  # a mesh alone asks for nothing that could be missing
            with self._owner.guard():
                buffers = self._owner.keep(MeshBuffers(self.context, figure, notes))
                posed = self._owner.keep(PosedMesh(self.context, self.programs, buffers))
            posed.update(None)
            self._figure, self._posed = figure, posed
        return self._posed

    def release(self) -> None:
        """Free what was uploaded."""
        if self._posed is not None:
            self._mesh_pass.forget(self._posed)
        self._owner.release()
        self._figure = self._posed = None
