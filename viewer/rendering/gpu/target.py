"""Render targets: a multisampled framebuffer, resolved to a single-sample framebuffer.

The passes of an image in final quality are summed in floating point and averaged. A single image is
read directly into an array; those of a recording are copied to buffers while the next is drawn.
"""

from __future__ import annotations

import ctypes
import math
from collections import deque
from collections.abc import Callable
from typing import Any, TypeAlias

import moderngl
import numpy as np

from viewer.errors import RenderError, ViewerError
from viewer.phrases import Remedy, file_size
from viewer.rendering.gpu.context import check_errors, gl_function
from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.gpu.upload import checked
from viewer.rigs.arrays import Bytes

_OPAQUE = 0xFF000000  # smallest value of an opaque pixel as a little-endian number

_Call: TypeAlias = Callable[..., int | None]
_UINT, _INT, _SIZE, _POINTER = ctypes.c_uint, ctypes.c_int, ctypes.c_ssize_t, ctypes.c_void_p
_SIGNATURES: dict[str, tuple[type | None, list[type]]] = {
    "glBindBuffer": (None, [_UINT, _UINT]),
    "glBindFramebuffer": (None, [_UINT, _UINT]),
    "glBlitFramebuffer": (None, [*[_INT] * 8, _UINT, _UINT]),
    "glBufferData": (None, [_UINT, _SIZE, _POINTER, _UINT]),
    "glFlush": (None, []),
    "glMapBufferRange": (_POINTER, [_UINT, _SIZE, _SIZE, _UINT]),
    "glReadPixels": (None, [*[_INT] * 4, _UINT, _UINT, _POINTER]),
    "glUnmapBuffer": (ctypes.c_ubyte, [_UINT]),
}
"""Result and arguments of OpenGL's functions."""
_PIXEL_PACK_BUFFER, _READ_FRAMEBUFFER = 0x88EB, 0x8CA8
_STREAM_READ, _MAP_READ_BIT = 0x88E1, 0x0001
_COLOR_BUFFER_BIT, _NEAREST, _RGBA, _UNSIGNED_BYTE = 0x4000, 0x2600, 0x1908, 0x1401


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
            self.resolved = context.framebuffer([self.texture])
            own.append(self.resolved)
            color = context.renderbuffer(size, 4, samples=self.samples)
            own.append(color)
            depth = context.depth_renderbuffer(size, samples=self.samples)
            own.append(depth)
            self.framebuffer = context.framebuffer([color], depth)
        else:
            depth = context.depth_renderbuffer(size)
            own.append(depth)
            self.framebuffer = self.resolved = context.framebuffer([self.texture], depth)
        own.append(self.framebuffer)

    def _no_room(self) -> RenderError:
        """Return an error with the required memory and a smaller alternative."""
        width, height = self.size
        samples = f" with {self.samples} samples per pixel" if self.samples else ""
        less = "a smaller size needs less"
        if self.samples:
            alone = file_size(target_bytes(self.size, 0))
            option = Remedy("Samples in Preferences", "--samples 1")
            less = f"1 sample per pixel ({option}) needs {alone}, {less}"
        return RenderError(
            f"an image of {width} x {height} pixels{samples} needs "
            f"{file_size(target_bytes(self.size, self.samples))} of graphics memory, which "
            f"{self.context.info['GL_RENDERER']} does not provide; {less}"
        )

    def resolve(self) -> moderngl.Texture:
        """Average the samples and return the image's texture."""
        if self.samples:
            self.context.copy_framebuffer(self.resolved, self.framebuffer)
        return self.texture

    def read(self) -> Bytes:
        """Return the resolved image: (H, W, 4) uint8 with straight alpha, first row at the top."""
        # Its memory has OpenGL's order of rows, because reversing them would be another pass.
        pixels = np.empty((self.size[1], self.size[0], 4), dtype=np.uint8)
        self.resolved.read_into(pixels, components=4)
        make_straight(pixels)
        return pixels[::-1]

    def release(self) -> None:
        """Free framebuffers and textures."""
        for item in self._owned:
            item.release()


class Readback:
    """Images of a target, copied to buffers that other threads read while the next one is drawn.

    An image passes through ``begin``, ``end`` and ``free``, in this order and always the oldest
    first; ``count`` of them may be between ``begin`` and ``free``. Drivers of graphics cards copy
    an image after ``begin`` has returned. Others copy it at once, and finish drawing it first.

    moderngl holds Python's lock during every call, so no other thread could run while the driver
    waits or copies: an encoder that needs the lock five times per frame would be delayed by five
    frames. ``ctypes`` releases the lock, so the functions that may wait are called through it, and
    the pixels are those of the driver, without a copy. If moderngl does not expose the addresses of
    OpenGL's functions, its own functions are called (``is_free`` is False).
    """

    def __init__(self, target: Target, count: int) -> None:
        self._target, context = target, target.context
        self._n_bytes = 4 * math.prod(target.size)
        self._free, self._begun, self._ended = (deque[moderngl.Buffer]() for _ in range(3))
        self._calls = _calls(context)
        self.is_free = self._calls is not None
        what = f"a buffer of {file_size(self._n_bytes)} for frames"
        self._owner = Owner()
        with self._owner.guard():
            for _ in range(count):
                made = checked(context, context.buffer(reserve=self._n_bytes), what)
                self._free.append(self._owner.keep(made))
                if self._calls is None:
                    continue
                # moderngl announces that buffers will be written by this process, so drivers place
                # them where reading is slow.
                self._bind(made)
                self._calls["glBufferData"](_PIXEL_PACK_BUFFER, self._n_bytes, None, _STREAM_READ)
                self._bind(None)
                check_errors(context, what)

    def begin(self) -> None:
        """Queue a copy of the target's image, which may be drawn again afterwards."""
        buffer = self._free.popleft()
        self._begun.append(buffer)
        target, calls = self._target, self._calls
        if calls is None:
            target.resolve()
            target.resolved.read_into(buffer, components=4)
            return
        width, height = target.size
        target.resolved.use()  # for reading and drawing
        if target.samples:
            box = 0, 0, width, height
            calls["glBindFramebuffer"](_READ_FRAMEBUFFER, target.framebuffer.glo)
            calls["glBlitFramebuffer"](*box, *box, _COLOR_BUFFER_BIT, _NEAREST)
            calls["glBindFramebuffer"](_READ_FRAMEBUFFER, target.resolved.glo)
        self._bind(buffer)
        calls["glReadPixels"](0, 0, width, height, _RGBA, _UNSIGNED_BYTE, None)
        self._bind(None)
        self.submit()

    def submit(self) -> None:
        """Let the driver start all work that was queued, without waiting for it."""
        if self._calls is not None:
            self._calls["glFlush"]()

    def end(self) -> Bytes:
        """Wait for a copy, and return its pixels; they must not be used after ``free``.

        (H, W, 4) uint8, premultiplied, first row at the top; read-only.
        """
        buffer = self._begun.popleft()
        self._ended.append(buffer)
        if self._calls is None:
            data = memoryview(buffer.read())
        else:
            # This waits for the commands that write the buffer, and not for later ones.
            self._bind(buffer)
            address = self._calls["glMapBufferRange"](
                _PIXEL_PACK_BUFFER, 0, self._n_bytes, _MAP_READ_BIT
            )
            self._bind(None)
            if not address:
                doing = f"reading an image of {file_size(self._n_bytes)}"
                check_errors(self._target.context, doing)
                raise RenderError(f"{doing}: the driver provides no address")
            data = memoryview((ctypes.c_ubyte * self._n_bytes).from_address(address))
        pixels = picture_rows(data, self._target.size)
        pixels.flags.writeable = False
        return pixels

    def free(self) -> None:
        """Reuse the buffer of the oldest image that ``end`` returned."""
        buffer = self._ended.popleft()
        self._free.append(buffer)
        if self._calls is not None:
            self._bind(buffer)
            is_intact = self._calls["glUnmapBuffer"](_PIXEL_PACK_BUFFER)
            self._bind(None)
            if not is_intact:
                raise RenderError("the driver lost the pixels of an image while they were read")

    def _bind(self, buffer: moderngl.Buffer | None) -> None:
        assert self._calls is not None
        self._calls["glBindBuffer"](_PIXEL_PACK_BUFFER, 0 if buffer is None else buffer.glo)

    def release(self) -> None:
        """Free the buffers; no other thread may read an image any more."""
        self._owner.release()


def _calls(context: moderngl.Context) -> dict[str, _Call] | None:
    """Return OpenGL's functions by name; None if an address is unknown."""
    found = {}
    for name, (result, arguments) in _SIGNATURES.items():
        call = gl_function(context, name, result, arguments)
        if call is None:
            return None
        found[name] = call
    return found


class TexturePass:
    """Pass that draws a texture over a bound target of its size, times a factor."""

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self._array = context.vertex_array(programs.drawing("fullscreen", fragment="average"), [])

    def draw(self, texture: moderngl.Texture, factor: float = 1.0) -> None:
        """Draw a texture."""
        set_uniforms(self._array.program, {"u_texture": 0, "u_factor": factor})
        texture.use(0)
        self._array.render(moderngl.TRIANGLES, vertices=3)

    def release(self) -> None:
        """Free the vertex array."""
        self._array.release()


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
            self._pass = keep(TexturePass(context, programs))

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
        self._pass.draw(texture)
        self.count += 1

    def show(self, target: Target) -> None:
        """Replace the image of a target by the average; its depths are preserved."""
        target.framebuffer.use()
        self.context.viewport = (0, 0, *self.size)
        self.context.enable_only(moderngl.NOTHING)
        self._pass.draw(self._sum, 1.0 / max(self.count, 1))

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


def picture_rows(data: bytes | memoryview, size: tuple[int, int]) -> Bytes:
    """Return pixels from OpenGL as a view: (H, W, 4) uint8, first row at the top."""
    return np.frombuffer(data, dtype=np.uint8).reshape(size[1], size[0], 4)[::-1]


def make_straight(pixels: Bytes) -> None:
    """Replace premultiplied colours by straight ones, in place; (H, W, 4) uint8."""
    if pixels.size and pixels.view("<u4").min() >= _OPAQUE:
        return
    alpha = pixels[..., 3]
    partial = (alpha > 0) & (alpha < 255)
    if partial.any():
        colors = pixels[partial, :3].astype(np.float64) * 255.0 / alpha[partial, None]
        pixels[partial, :3] = np.minimum(np.rint(colors), 255.0)
