"""Shadows on the ground: the key light's shadows, and contact shadows."""

from __future__ import annotations

import moderngl
import numpy as np

from viewer.rendering.gpu.draw_state import behind, without_depth_writes
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.gpu.upload import buffer
from viewer.rendering.gpu.vertex_arrays import VertexArrays
from viewer.rendering.passes.contact_pass import Contact
from viewer.rendering.view import SHADOW_UNIT, Shadow, View, set_model
from viewer.rig.arrays import Floats
from viewer.rig.geometry.vectors import unit

__all__ = ["GroundShadowPass"]

_OPACITY = 0.42  # opacity of the key light's shadow
_CONTACT_OPACITIES = 0.55, 0.38
_GRAZING = (
    0.06,
    0.22,
)  # sine of the light's elevation at which its shadow appears and has full strength
_FIELD_UNIT = 0


class GroundShadowPass:
    """Pass that draws black patches on the ground, whose opacity represents the shadow.

    Parameters
    ----------
    context : moderngl.Context
        The context in use.
    programs : Programs
        Provides the programs.
    """

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self.context, self.programs = context, programs
        self._corners = buffer(context, [[0, 0], [1, 0], [0, 1], [1, 1]], "f4")
        self._arrays = VertexArrays(context)

    def draw_shadow(self, shadow: Shadow, view: View, up: Floats, height: float) -> None:
        """Draw the key light's shadow.

        Parameters
        ----------
        shadow : Shadow
            The shadow map.
        view : View
            The camera's matrices.
        up : (3,)
            The up axis.
        height : float
            Height of the ground along that axis.
        """
        back = np.linalg.inv(shadow.matrix)
        away = back[:3, 2]
        slope = -(up @ away) / np.linalg.norm(away)
        fade = float(np.clip((slope - _GRAZING[0]) / (_GRAZING[1] - _GRAZING[0]), 0.0, 1.0))
        if fade == 0.0:
            return
        # Rays through the corners of the map meet the ground at these depths.
        corners = np.array([[0.0, 0, 0, 1], [1, 0, 0, 1], [0, 1, 0, 1]]) @ back.T
        depths = (height - corners[:, :3] @ up) / (up @ away)
        places = corners[:, :3] + depths[:, None] * away
        program = self.programs.drawing("patch", fragment="ground_shadow")
        growth = depths[1:] - depths[0]
        values = {
            "u_shadow_map": SHADOW_UNIT,
            "u_shadow_filter": shadow.filter(is_ground=True),
            "u_depth": (float(depths[0]), *growth.tolist()),
            "u_opacity": _OPACITY * fade * shadow.strength,
        }
        set_uniforms(program, values)
        shadow.texture.use(SHADOW_UNIT)
        self._draw(program, view, places[0], places[1] - places[0], places[2] - places[0])

    def draw_contact(
        self, contact: Contact, view: View, axes: Floats, height: float, strength: float
    ) -> None:
        """Draw contact shadows; the rows of ``axes`` are the ground's two axes and the up axis."""
        program = self.programs.drawing("patch", fragment="ground_contact")
        opacities = tuple(strength * opacity for opacity in _CONTACT_OPACITIES)
        set_uniforms(program, {"u_field": _FIELD_UNIT, "u_opacity": opacities})
        contact.texture.use(_FIELD_UNIT)
        # Seen from below, the second axis points down.
        origin = axes.T @ np.array([contact.low[0], contact.high[1], height])
        sides = contact.high - contact.low
        self._draw(program, view, origin, sides[0] * axes[0], -sides[1] * axes[1])

    def _draw(
        self, program: moderngl.Program, view: View, origin: Floats, first: Floats, second: Floats
    ) -> None:
        """Draw the parallelogram given by a corner and two sides, scene space."""
        placement = np.eye(4)
        placement[:3, 0], placement[:3, 1] = first, second
        # Only the direction matters: the product of two sides would exceed the range of float32.
        placement[:3, 2] = np.cross(unit(first), unit(second))
        placement[:3, 3] = origin
        set_model(program, view, placement, np.zeros(3))
        array = self._arrays.get(program, lambda: [(self._corners, "2f4", "in_corner")])
        # Patches are translucent and must not hide anything, nor show through a flat mesh on the
        # ground, which has the same depth.
        with without_depth_writes(self.context), behind(self.context):
            array.render(moderngl.TRIANGLE_STRIP)

    def release(self) -> None:
        """Free vertex arrays and corners."""
        self._arrays.release()
        self._corners.release()
