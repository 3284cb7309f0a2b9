"""Render targets: a multisampled framebuffer, resolved to a single-sample framebuffer.

The passes of an image in final quality are summed in floating point and averaged.
"""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np

from viewer.errors import RenderError, ViewerError
from viewer.phrases import Remedy
from viewer.rendering.gpu.context import check_errors
from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.gpu.upload import checked
from viewer.rig.arrays import Bytes

_OPAQUE = 0xFF000000  # smallest value of an opaque pixel as a little-endian number


class Target:
    """Framebuffers of an image that is being drawn, which is ``texture`` after ``resolve``."""

    # Samples per pixel are rounded down to a power of two and limited by the driver.

    def __init__(self, context: moderngl.Context, size: tuple[int, int], samples: int) -> None:
        check_size(context, size)
        self.context, self.size = context, size
        most = min(samples, context.max_samples)
        # Drivers support powers of two.
        self.samples = 1 << (most.bit_length() - 1) if most > 1 else 0
        self.asked_samples = samples
        self._owned: list[Any] = []
        try:
            self._allocate()
            check_errors(context, f"an image of {size[0]} x {size[1]} pixels")
        except (moderngl.Error, RenderError):
            self.release()
            context.clear_errors()  # this clears the error of the failed allocation
            raise self._no_room() from None

    def _allocate(self) -> None:
        """Create the framebuffers; if any part fails, all parts are released."""
        context, size, own = self.context, self.size, self._owned
        self.texture = context.texture(size, 4)
        own.append(self.texture)
        self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        if self.samples:
            self._resolved = context.framebuffer([self.texture])
            own.append(self._resolved)
            color = context.renderbuffer(size, 4, samples=self.samples)
            own.append(color)
            depth = context.depth_renderbuffer(size, samples=self.samples)
            own.append(depth)
            self.framebuffer = context.framebuffer([color], depth)
        else:
            depth = context.depth_renderbuffer(size)
            own.append(depth)
            self.framebuffer = self._resolved = context.framebuffer([self.texture], depth)
        own.append(self.framebuffer)

    def _no_room(self) -> RenderError:
        """Return an error with the required memory and a smaller alternative."""
        width, height = self.size
        samples = f" with {self.samples} samples per pixel" if self.samples else ""
        less = "a smaller size needs less"
        if self.samples:
            alone = _gigabytes(target_bytes(self.size, 0))
            option = Remedy("Samples in Preferences", "--samples 1")
            less = f"1 sample per pixel ({option}) needs {alone}, {less}"
        return RenderError(
            f"an image of {width} x {height} pixels{samples} needs "
            f"{_gigabytes(target_bytes(self.size, self.samples))} of graphics memory, which "
            f"{self.context.info['GL_RENDERER']} does not provide; {less}"
        )

    def resolve(self) -> moderngl.Texture:
        """Average the samples and return the image's texture."""
        if self.samples:
            self.context.copy_framebuffer(self._resolved, self.framebuffer)
        return self.texture

    def read(self) -> Bytes:
        """Return the resolved image: (H, W, 4) uint8 with straight alpha, first row at the top."""
        return straight(picture_rows(self._resolved.read(components=4), self.size))

    def read_into(self, buffer: moderngl.Buffer) -> None:
        """Queue a copy of the resolved image to a buffer, without waiting for it."""
        # The buffer has 4 bytes per pixel, last row first; ``picture_rows`` converts it to an
        # image. Reading it waits for the copy.
        self._resolved.read_into(buffer, components=4)

    def release(self) -> None:
        """Free framebuffers and textures."""
        for item in self._owned:
            item.release()


class Accumulation:
    """Sum of ``count`` passes of one image, in floating point, and their average."""

    # Colours are premultiplied by alpha, so averaging pixels averages their coverage.

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


def check_size(context: moderngl.Context, size: tuple[int, int], what: str = "image size") -> None:
    """Raise for an image size that the driver cannot draw; ``what`` begins the message."""
    limit = min(*context.info["GL_MAX_VIEWPORT_DIMS"], context.info["GL_MAX_RENDERBUFFER_SIZE"])
    if not all(1 <= side <= limit for side in size):
        raise ViewerError(
            f"{what}: expected 1 to {limit} pixels per side, found {size[0]} x {size[1]}"
        )


def target_bytes(size: tuple[int, int], samples: int) -> int:
    """Return the memory in bytes that OpenGL needs to draw an image.

    Colour and depth of every sample, 4 bytes each, plus the resolved image; without multisampling,
    the image and its depth.

    >>> target_bytes((100, 10), 4), target_bytes((100, 10), 0)
    (36000, 8000)
    """
    picture = 4 * size[0] * size[1]
    return picture * (2 * samples + 1) if samples else 2 * picture


def picture_rows(data: bytes, size: tuple[int, int]) -> Bytes:
    """Return pixels from OpenGL as a view: (H, W, 4) uint8, first row at the top."""
    return np.frombuffer(data, dtype=np.uint8).reshape(size[1], size[0], 4)[::-1]


def straight(pixels: Bytes) -> Bytes:
    """Return colours with straight instead of premultiplied alpha: (H, W, 4), a copy."""
    pixels = pixels.copy()
    if pixels.size and pixels.view("<u4").min() >= _OPAQUE:
        return pixels
    alpha = pixels[..., 3]
    partial = (alpha > 0) & (alpha < 255)
    if partial.any():
        colors = pixels[partial, :3].astype(np.float64) * 255.0 / alpha[partial, None]
        pixels[partial, :3] = np.minimum(np.rint(colors), 255.0)
    return pixels


def _gigabytes(count: int) -> str:
    return f"{count / 1e9:.1f} GB" if count >= 1e8 else f"{count / 1e6:.3g} MB"
