"""Pass that draws the studio, out of focus, behind the scene."""

from __future__ import annotations

import math

import moderngl

from viewer.rendering.gpu.draw_state import without_depth_test
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.gpu.studio import STUDIO_SAMPLERS, Studio
from viewer.rendering.options import Lights
from viewer.rendering.view import View, set_lights

__all__ = ["BackdropPass"]

# Field of view for parallel projections, whose rays would all show the same point, degrees.
_PARALLEL_FOV = 35.0


class BackdropPass:
    """Pass that draws the studio.

    Parameters
    ----------
    context : moderngl.Context
        The context in use.
    programs : Programs
        Provides the shader programs.
    studio : Studio
        The environment to show.
    """

    def __init__(self, context: moderngl.Context, programs: Programs, studio: Studio) -> None:
        self.context, self.studio = context, studio
        self._program = programs.drawing("backdrop")
        self._array = context.vertex_array(self._program, [])

    def draw(self, view: View, lights: Lights) -> None:
        """Fill the image."""
        self.studio.use()
        projection = view.projection
        scale = 1.0 / projection[0, 0], 1.0 / projection[1, 1]
        shift = projection[0, 2] * scale[0], projection[1, 2] * scale[1]
        if view.camera.is_parallel:
            height = math.tan(math.radians(0.5 * _PARALLEL_FOV))
            scale, shift = (height * scale[0] / scale[1], height), (0.0, 0.0)
        set_lights(self._program, view, lights)
        set_uniforms(self._program, {"u_ray_scale": scale, "u_ray_shift": shift})
        set_uniforms(self._program, STUDIO_SAMPLERS)
        with without_depth_test(self.context):
            self._array.render(moderngl.TRIANGLES, vertices=3)

    def release(self) -> None:
        """Free the vertex array."""
        self._array.release()
