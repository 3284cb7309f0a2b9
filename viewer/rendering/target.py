"""Where pictures are drawn: a multisampled framebuffer and the plain one it is resolved into."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np

from viewer.errors import RenderError, ViewerError
from viewer.rendering.context import check_errors
from viewer.rig.arrays import Bytes

__all__ = ["Target", "check_size", "picture_rows", "straight"]


def check_size(context: moderngl.Context, size: tuple[int, int]) -> None:
    """Refuse a picture that the driver cannot draw.

    Raises
    ------
    ViewerError
        With the size and the limit.
    """
    limit = min(*context.info["GL_MAX_VIEWPORT_DIMS"], context.info["GL_MAX_RENDERBUFFER_SIZE"])
    if not all(1 <= side <= limit for side in size):
        raise ViewerError(
            f"picture size: expected 1 to {limit} pixels a side, found {size[0]} x {size[1]}"
        )


class Target:
    """A picture being drawn.

    Parameters
    ----------
    context : moderngl.Context
        The context in use.
    size : (int, int)
        Width and height in pixels.
    samples : int
        Wanted samples a pixel; the driver's maximum if that is smaller.

    Attributes
    ----------
    framebuffer : moderngl.Framebuffer
        Draw here.
    texture : moderngl.Texture
        The picture after ``resolve``.
    """

    def __init__(self, context: moderngl.Context, size: tuple[int, int], samples: int) -> None:
        check_size(context, size)
        self.context, self.size = context, size
        self.samples = min(samples, context.max_samples) if samples > 1 else 0
        self.asked_samples = samples
        try:
            self.texture = context.texture(size, 4)
            self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self._owned: list[Any] = [self.texture]
            if self.samples:
                self._resolved = context.framebuffer([self.texture])
                color = context.renderbuffer(size, 4, samples=self.samples)
                depth = context.depth_renderbuffer(size, samples=self.samples)
                self.framebuffer = context.framebuffer([color], depth)
                self._owned += [self._resolved, color, depth, self.framebuffer]
            else:
                depth = context.depth_renderbuffer(size)
                self.framebuffer = self._resolved = context.framebuffer([self.texture], depth)
                self._owned += [depth, self.framebuffer]
        except moderngl.Error as problem:
            raise RenderError(f"a picture of {size[0]} x {size[1]} pixels: {problem}") from None
        check_errors(context, f"a picture of {size[0]} x {size[1]} pixels")

    def resolve(self) -> moderngl.Texture:
        """Average the samples and return the picture's texture."""
        if self.samples:
            self.context.copy_framebuffer(self._resolved, self.framebuffer)
        return self.texture

    def read(self) -> Bytes:
        """Return the resolved picture: (H, W, 4) uint8, first row at the top.

        Colours are not multiplied by alpha any more, as picture files expect.
        """
        return straight(picture_rows(self._resolved.read(components=4), self.size))

    def read_into(self, buffer: moderngl.Buffer) -> None:
        """Have the resolved picture copied into a buffer, as soon as the driver gets to it.

        Parameters
        ----------
        buffer : moderngl.Buffer
            4 bytes a pixel, last row first; ``picture_rows`` makes a picture of what is read
            from it. Whoever reads it waits until it is there.
        """
        self._resolved.read_into(buffer, components=4)

    def release(self) -> None:
        """Free framebuffers and textures."""
        for item in self._owned:
            item.release()


def picture_rows(data: bytes, size: tuple[int, int]) -> Bytes:
    """Return what OpenGL read as a picture: (H, W, 4) uint8, first row at the top, not a copy.

    Parameters
    ----------
    data : bytes
        Last row first.
    size : (int, int)
        Width and height.
    """
    return np.frombuffer(data, dtype=np.uint8).reshape(size[1], size[0], 4)[::-1]


def straight(pixels: Bytes) -> Bytes:
    """Return colours that are not multiplied by their alpha any more: (H, W, 4), a copy."""
    pixels = pixels.copy()
    alpha = pixels[..., 3]
    partial = (alpha > 0) & (alpha < 255)
    if partial.any():
        colors = pixels[partial, :3].astype(np.float64) * 255.0 / alpha[partial, None]
        pixels[partial, :3] = np.minimum(np.rint(colors), 255.0)
    return pixels
