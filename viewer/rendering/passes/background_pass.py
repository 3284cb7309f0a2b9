"""Background of an image: a colour, a gradient, or the studio out of focus.

The gradient is drawn once per image size and copied.
"""

from __future__ import annotations

import math

import moderngl

from viewer.rendering.gpu.draw_state import without_colors, without_depth_test
from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.gpu.studio import STUDIO_SAMPLERS, Studio
from viewer.rendering.gpu.target import Target, TexturePass
from viewer.rendering.gpu.upload import checked
from viewer.rendering.options import BACKGROUNDS, Lights, parse_color
from viewer.rendering.view import View, set_lights

GRADIENT = {"u_bottom": (0.80, 0.83, 0.86), "u_top": (0.36, 0.43, 0.52)}
"""Uniforms of ``background.frag``: colours at the bottom and at the top, sRGB."""

_CLEARED = {
    "white": (1.0, 1.0, 1.0, 1.0),
    "transparent": (0.0, 0.0, 0.0, 0.0),
    "environment": (0.0, 0.0, 0.0, 0.0),  # another pass draws it
}
# Maximum size of a stored gradient; larger ones are drawn each time, to save memory.
_MOST_PIXELS = 1 << 23
# Field of view for parallel projections, whose rays would all show the same point, degrees.
_PARALLEL_FOV = 35.0


class BackgroundPass:
    """Pass that clears a target and fills it with its background."""

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self.context, self.programs = context, programs
        self._gradient: moderngl.VertexArray | None = None
        self._picture: _Picture | None = None
        self._last_size = 0, 0

    def draw(self, target: Target, background: str) -> None:
        """Clear the depth and colour of a bound target; ``"environment"`` clears to transparent."""
        if background != "gradient":
            color = _CLEARED.get(background) or (*parse_color(background), 1.0)
            target.framebuffer.clear(*color, depth=1.0)
            return
        with without_colors(self.context):
            target.framebuffer.clear(depth=1.0)
        self.context.disable(moderngl.DEPTH_TEST | moderngl.BLEND)
        self._draw_gradient(target)
        self.context.enable(moderngl.DEPTH_TEST | moderngl.BLEND)

    def _draw_gradient(self, target: Target) -> None:
        size = target.size
        if self._picture is not None and self._picture.size != size:
            self._picture.release()
            self._picture = None
        # The first image of a size is often the only one, for instance while a window is resized.
        if self._picture is None and size == self._last_size and size[0] * size[1] <= _MOST_PIXELS:
            self._picture = _Picture(self.context, self.programs, size)
            with self.context.scope(self._picture.framebuffer):
                self._compute()
            target.framebuffer.use()
        self._last_size = size
        if self._picture is None:
            self._compute()
        else:
            self._picture.copy_to(target)

    def _compute(self) -> None:
        program = self.programs.drawing("fullscreen", fragment="background")
        set_uniforms(program, GRADIENT)
        if self._gradient is None:
            self._gradient = self.context.vertex_array(program, [])
        self._gradient.render(moderngl.TRIANGLES, vertices=3)

    def release(self) -> None:
        """Free the vertex array and the stored image."""
        for item in (self._gradient, self._picture):
            if item is not None:
                item.release()


class _Picture:
    """Stored image that is copied instead of being drawn again."""

    def __init__(
        self, context: moderngl.Context, programs: Programs, size: tuple[int, int]
    ) -> None:
        self.context, self.size = context, size
        self._owner = Owner()
        keep = self._owner.keep
        with self._owner.guard():
            what = f"a background of {size[0]} x {size[1]} pixels"
            self._texture = keep(checked(context, context.texture(size, 4), what))
            self.framebuffer = keep(context.framebuffer([self._texture]))
            self._pass = keep(TexturePass(context, programs))

    def copy_to(self, target: Target) -> None:
        """Replace the colours of a bound target of the same size."""
        if not target.samples:
            self.context.copy_framebuffer(target.framebuffer, self.framebuffer)
            return
        # With several samples per pixel, drawing is faster than copying on software drivers.
        self._pass.draw(self._texture)

    def release(self) -> None:
        """Free everything."""
        self._owner.release()


class BackdropPass:
    """Pass that draws the studio."""

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


def is_light(background: str) -> bool:
    """Return whether dark text is easier to read on a background: white, or a light colour.

    >>> is_light("white"), is_light("#e9ebee"), is_light("#303840"), is_light("gradient")
    (True, True, False, False)
    """
    # The gradient is dark at the top, where legends are, and what is behind the others is unknown.
    if background in BACKGROUNDS:
        return background == "white"
    red, green, blue = parse_color(background)
    return 0.299 * red + 0.587 * green + 0.114 * blue > 0.5  # perceived brightness, Rec. 601
