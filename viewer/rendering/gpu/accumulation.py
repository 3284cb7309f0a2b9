"""Sum of several passes of one image, in floating point."""

from __future__ import annotations

import moderngl

from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.gpu.target import Target
from viewer.rendering.gpu.upload import checked

__all__ = ["Accumulation"]


class Accumulation:
    """Accumulator that adds images and draws their average.

    Colours are premultiplied by alpha, so averaging pixels averages their coverage.

    Parameters
    ----------
    context : moderngl.Context
        The context in use.
    programs : Programs
        Provides the program.
    size : (int, int)
        Width and height in pixels.

    Attributes
    ----------
    count : int
        Images added since the last ``clear``.
    """

    def __init__(self, context: moderngl.Context, programs: Programs, size: tuple[int, int]):
        self.context, self.size, self.count = context, size, 0
        self._owner = Owner()
        keep = self._owner.keep
        what = f"the sum of images of {size[0]} x {size[1]} pixels"
        with self._owner.guard():
            self._sum = keep(checked(context, context.texture(size, 4, dtype="f4"), what))
            self._framebuffer = keep(context.framebuffer([self._sum]))
            program = programs.drawing("fullscreen", fragment="average")
            self._array = keep(context.vertex_array(program, []))

    def clear(self) -> None:
        """Begin a new sum."""
        self._framebuffer.clear()
        self.count = 0

    def add(self, target: Target) -> None:
        """Add the image of a target."""
        texture = target.resolve()
        self._framebuffer.use()
        self.context.viewport = (0, 0, *self.size)
        self.context.enable_only(moderngl.BLEND)
        self.context.blend_func = moderngl.ONE, moderngl.ONE
        self._draw(texture, 1.0)
        self.count += 1

    def show(self, target: Target) -> None:
        """Replace the image of a target by the average; its depths are preserved."""
        target.framebuffer.use()
        self.context.viewport = (0, 0, *self.size)
        self.context.enable_only(moderngl.NOTHING)
        self._draw(self._sum, 1.0 / max(self.count, 1))

    def _draw(self, texture: moderngl.Texture, factor: float) -> None:
        set_uniforms(self._array.program, {"u_texture": 0, "u_factor": factor})
        texture.use(0)
        self._array.render(moderngl.TRIANGLES, vertices=3)

    def release(self) -> None:
        """Free the sum."""
        self._owner.release()
