"""Pass that draws the legend of a scalar quantity into the corner of an image."""

from __future__ import annotations

import moderngl
import numpy as np

from viewer.rendering.gpu.draw_state import without_depth_test
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.overlay.legend import Legend, legend_pixels

_MARGIN = 0.014  # margin of the legend, as a fraction of the image height


class LegendPass:
    """Pass that draws a legend over everything else."""

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self.context = context
        self._program = programs.drawing("overlay")
        self._array = context.vertex_array(self._program, [])
        self._texture: moderngl.Texture | None = None
        self._drawn: tuple[Legend, tuple[int, int], bool] | None = None

    def draw(self, legend: Legend, size: tuple[int, int], is_light: bool = False) -> bool:
        """Draw a legend into the upper left corner of the bound framebuffer."""
        wanted = legend, size, is_light
        if self._drawn is None or self._drawn[0] is not legend or self._drawn[1:] != wanted[1:]:
            self._free()
            pixels = legend_pixels(*wanted)
            if pixels is not None:
                # Blending expects premultiplied alpha, and a texture's first row is at the bottom.
                multiplied = pixels.astype(np.float64)
                multiplied[..., :3] *= multiplied[..., 3:] / 255.0
                data = np.ascontiguousarray(np.rint(multiplied[::-1]).astype(np.uint8))
                self._texture = self.context.texture(data.shape[1::-1], 4, data.tobytes())
                self._texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self._drawn = wanted
        if self._texture is None:
            return False
        margin = max(round(_MARGIN * size[1]), 2)
        values = {
            "u_place": (margin, size[1] - margin - self._texture.height),
            "u_extent": self._texture.size,
            "u_picture": size,
            "u_texture": 0,
        }
        set_uniforms(self._program, values)
        self._texture.use(0)
        with without_depth_test(self.context):
            self._array.render(moderngl.TRIANGLE_STRIP, vertices=4)
        return True

    def _free(self) -> None:
        if self._texture is not None:
            self._texture.release()
        self._texture = None

    def release(self) -> None:
        """Free texture and vertex array."""
        self._free()
        self._array.release()
