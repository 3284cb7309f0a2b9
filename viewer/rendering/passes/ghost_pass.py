"""Pass that draws a ghost over the scene: an extra surface, translucent or as edges only."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Literal, TypeAlias

import moderngl

from viewer.data_classes import dataclass
from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.posed_mesh import PosedMesh
from viewer.rendering.gpu.program import Programs
from viewer.rendering.options import Color, DisplayOptions
from viewer.rendering.passes.mesh_pass import MeshPass, draw_layer
from viewer.rendering.view import View
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure

GHOST_COLOR = (0.10, 0.42, 0.85)
"""Default colour of ghosts, linear."""

_NEARER = (-2.0, -4.0)  # factor and units of the polygon offset

GhostStyle: TypeAlias = Literal["solid", "translucent", "wireframe"]


@dataclass(frozen=True, slots=True, eq=False)
class Ghost:
    """A visible surface that cannot be picked."""

    figure: Figure
    """Figure with a mesh, which is drawn unposed."""
    placement: Floats
    """(4, 4). Matrix from figure space to scene space."""
    style: GhostStyle = "translucent"
    color: Color = GHOST_COLOR
    """(r, g, b). Linear."""


class GhostPass:
    """Pass that draws ghosts; the mesh is uploaded when a different ghost is drawn."""

    def __init__(self, context: moderngl.Context, programs: Programs, mesh_pass: MeshPass) -> None:
        self.context, self.programs, self._mesh_pass = context, programs, mesh_pass
        self._owner = Owner()
        self._figure: Figure | None = None
        self._posed: PosedMesh | None = None

    def draw(self, ghost: Ghost, view: View, options: DisplayOptions) -> None:
        """Draw a ghost over everything drawn so far."""
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
        # Prevents z-fighting with a coincident surface of the scene.
        self.context.polygon_offset = _NEARER
        draw_layer(self.context, look, draw)
        self.context.polygon_offset = 0.0, 0.0

    def _uploaded(self, figure: Figure) -> PosedMesh:
        if self._posed is None or figure is not self._figure:
            self.release()
            # This list stays empty, as a mesh without materials has no textures to reduce.
            notes: list[str] = []
            with self._owner.guard():
                buffers = self._owner.keep(MeshBuffers(self.context, figure, notes))
                posed = self._owner.keep(PosedMesh(self.context, self.programs, buffers))
            posed.update(None)
            self._figure, self._posed = figure, posed
        return self._posed

    def release(self) -> None:
        """Free all buffers."""
        if self._posed is not None:
            self._mesh_pass.forget(self._posed)
        self._owner.release()
        self._figure = self._posed = None
