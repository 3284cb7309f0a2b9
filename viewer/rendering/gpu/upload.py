"""Upload of arrays to the GPU, with all conversions to float32 and transpositions."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from functools import cache
from typing import TypeAlias, TypeVar

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from viewer.errors import RenderError
from viewer.phrases import file_size
from viewer.rendering.gpu.context import check_errors, gl_function, is_software
from viewer.rigs.arrays import Bytes, Floats
from viewer.rigs.srgb import decode_srgb, encode_srgb

_Item = TypeVar("_Item", moderngl.Buffer, moderngl.Texture)
_Numbers: TypeAlias = NDArray[np.generic] | list[float]

# Fixed texture widths, on which the shaders rely: every OpenGL 3.3 driver allows at least 1024.
_MATRICES_PER_ROW = 256  # a matrix has three texels
_PAIRS_PER_ROW = 1024
_RIGID_PER_ROW = 128  # a joint has five texels
_SRGB8_ALPHA8, _RGBA8 = 0x8C43, 0x8058
_TEXTURE_2D, _RGBA, _UNSIGNED_BYTE = 0x0DE1, 0x1908, 0x1401
_FEW_TEXELS = 1 << 20  # of a texture whose mipmaps the processor computes
_MOST_LIGHT = (1 << 14) - 1  # the sum of four texels fits into 16 bits


def buffer(context: moderngl.Context, values: ArrayLike, dtype: str) -> moderngl.Buffer:
    """Return a vertex or index buffer; one byte long if it is empty."""
    data = np.ascontiguousarray(values, dtype=dtype).tobytes() or b"\0"
    return checked(context, context.buffer(data), f"a mesh buffer of {file_size(len(data))}")


def reserved(context: moderngl.Context, size: int, what: str) -> moderngl.Buffer:
    """Return a buffer of ``size`` bytes that is written often; ``what`` names it in errors."""
    made = context.buffer(reserve=max(size, 1), dynamic=True)
    return checked(context, made, f"{what} of {file_size(size)}")


def checked(context: moderngl.Context, item: _Item, what: str) -> _Item:
    """Return an object that the driver created without error; otherwise free it and raise."""
    try:
        check_errors(context, what)
    except RenderError:
        item.release()
        raise
    return item


def float32(values: Floats) -> NDArray[np.float32]:
    """Return the numbers as contiguous float32 in row-major order."""
    return np.ascontiguousarray(values, dtype=np.float32)


def as_uniform(matrix: NDArray[np.floating]) -> bytes:
    """Return a matrix for column vectors as GLSL stores it, column by column."""
    return np.ascontiguousarray(matrix.T, dtype="f4").tobytes()


def matrix_texture(context: moderngl.Context, count: int) -> moderngl.Texture:
    """Return an empty texture for ``count`` joint matrices."""
    size = (3 * _MATRICES_PER_ROW, _height(count, _MATRICES_PER_ROW))
    return _data_texture(context, size, 4, f"{count} joints")


def write_stacked(texture: moderngl.Texture, rows: NDArray[np.float32]) -> None:
    """Replace the first rows of a texture by consecutive texels, (N, ...), padding the last row."""
    wide = texture.width * texture.components
    flat = rows.reshape(-1)
    height = -(-flat.size // wide)
    if height == 1:
        texture.write(flat, viewport=(0, 0, flat.size // texture.components, 1))
        return
    if flat.size < height * wide:
        flat = np.concatenate([flat, np.zeros(height * wide - flat.size, "f4")])
    texture.write(flat, viewport=(0, 0, texture.width, height))


def rigid_texture(context: moderngl.Context, count: int) -> moderngl.Texture:
    """Return an empty texture for ``count`` joints' dual quaternions and stretches."""
    size = (5 * _RIGID_PER_ROW, _height(count, _RIGID_PER_ROW))
    return _data_texture(context, size, 4, f"{count} joints")


def pair_texture(
    context: moderngl.Context, indices: _Numbers, weights: _Numbers
) -> moderngl.Texture:
    """Return a texture of (index, weight) pairs, one texel each."""
    count = len(indices)
    height = _height(count, _PAIRS_PER_ROW)
    texture = _data_texture(context, (_PAIRS_PER_ROW, height), 2, f"{count} influences")
    pairs = np.zeros((texture.width * texture.height, 2), "f4")
    # float32 represents every index below 2^24 exactly.
    pairs[:count, 0] = indices
    pairs[:count, 1] = weights
    texture.write(pairs.tobytes())
    return checked(context, texture, f"{count} influences")


def picture_texture(
    context: moderngl.Context, pixels: Bytes, notes: list[str], is_linear: bool = False
) -> moderngl.Texture:
    """Return a mip-mapped sRGB or linear texture, clamped at its edges, v = 0 at the last row."""
    # An image that exceeds the driver's limit is reduced by an integer factor, with a message.
    limit = context.info["GL_MAX_TEXTURE_SIZE"]
    factor = -(-max(pixels.shape[:2]) // limit)
    if factor > 1:
        notes.append(
            f"a texture of {pixels.shape[1]} x {pixels.shape[0]} pixels exceeds this "
            f"driver's limit of {limit} and was reduced by {factor}"
        )
        pixels = pixels[::factor, ::factor]
    flipped = np.ascontiguousarray(pixels[::-1])
    size = (pixels.shape[1], pixels.shape[0])
    stored_as = _RGBA8 if is_linear else _SRGB8_ALPHA8
    texture = context.texture(size, 4, flipped, internal_format=stored_as)
    texture.repeat_x = texture.repeat_y = False
    build_mipmaps(context, texture, flipped, is_linear)
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    if not is_software(context):
        texture.anisotropy = 8.0  # would double the drawing time in software
    return checked(context, texture, f"a texture of {size[0]} x {size[1]} pixels")


def build_mipmaps(
    context: moderngl.Context, texture: moderngl.Texture, pixels: Bytes, is_linear: bool
) -> None:
    """Fill the mipmaps of a texture, whose texels are (H, W, 4) uint8."""
    upload, (width, height) = None, texture.size
    # Mesa's driver in software compiles a shader for it in each process: 100 ms. This takes up to
    # twice as long per texel as the driver does afterwards, 15 ms for the largest: figures with
    # fewer than ten of them, or many small ones, gain.
    if width * height <= _FEW_TEXELS and is_software(context):
        arguments = [ctypes.c_uint, *[ctypes.c_int] * 5, ctypes.c_uint, ctypes.c_uint]
        upload = gl_function(context, "glTexImage2D", None, [*arguments, ctypes.c_void_p])
    if upload is None:
        texture.build_mipmaps()
        return
    texture.use()
    stored_as = _RGBA8 if is_linear else _SRGB8_ALPHA8
    for level, texels in enumerate(reduced(pixels, is_linear), 1):
        height, width = texels.shape[:2]
        box = width, height, 0
        kind = _RGBA, _UNSIGNED_BYTE
        upload(_TEXTURE_2D, level, stored_as, *box, *kind, texels.ctypes.data)


def reduced(texels: Bytes, is_linear: bool) -> Iterator[Bytes]:
    """Yield the mipmaps of (H, W, 4) uint8 texels, largest first.

    Each texel is the mean light of those that it covers; alpha is linear.
    """
    tables = [_light_tables(is_linear)] * 3 + [_light_tables(True)]
    # Without "clip", ``take`` checks the indices and takes a third longer.
    planes = [
        light.take(texels[..., channel], mode="clip") for channel, (light, _) in enumerate(tables)
    ]
    two = np.uint16(2)
    while planes[0].size > 1:
        sums = [_sums_of_four(plane) for plane in planes]
        level = np.empty((*sums[0].shape, 4), dtype=np.uint8)
        for channel, (_, stored) in enumerate(tables):
            level[..., channel] = stored.take(sums[channel], mode="clip")
        yield level
        planes = [(one + two) >> two for one in sums]


def _sums_of_four(plane: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """Return four times the mean of the texels that each texel of the next mipmap covers."""
    return _sums_of_two(_sums_of_two(plane).T).T


def _sums_of_two(rows: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """Return twice the mean of the rows that each row of the next mipmap covers."""
    count, half = len(rows), len(rows) // 2
    if count == 1:
        return 2 * rows
    if count % 2 == 0:
        return rows[0::2] + rows[1::2]
    # Of 2 n + 1 rows, row k of n covers (2 n + 1) / n: (n - k) / n of row 2 k, all of row 2 k + 1,
    # and (k + 1) / n of row 2 k + 2 (Guthe and Heckbert 2005).
    parts, whole = np.arange(half, dtype=np.float32)[:, None], np.float32(half)
    sums = (whole - parts) * rows[0:-1:2] + whole * rows[1::2] + (parts + 1) * rows[2::2]
    return np.rint(sums * np.float32(2.0 / count)).astype(np.uint16)


@cache
def _light_tables(is_linear: bool) -> tuple[NDArray[np.uint16], Bytes]:
    """Return the light of each stored value, and the stored value of each sum of four lights."""
    values = np.arange(256) / 255.0
    # Near black, where sRGB has its finest steps, one step is five units of light.
    means = np.arange(1 << 16) / (4.0 * _MOST_LIGHT)
    light, stored = (values, means) if is_linear else (decode_srgb(values), encode_srgb(means))
    return np.rint(_MOST_LIGHT * light).astype("u2"), np.rint(255.0 * stored).astype("u1")


def ramp_texture(context: moderngl.Context, pixels: Bytes) -> moderngl.Texture:
    """Return an sRGB texture of one row without mipmaps, for a colour map."""
    size = (len(pixels), 1)
    texture = context.texture(size, 4, pixels.tobytes(), internal_format=_SRGB8_ALPHA8)
    texture.repeat_x = texture.repeat_y = False
    texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
    return texture


def _height(count: int, per_row: int) -> int:
    return max(1, -(-count // per_row))


def _data_texture(
    context: moderngl.Context, size: tuple[int, int], components: int, what: str
) -> moderngl.Texture:
    limit = context.info["GL_MAX_TEXTURE_SIZE"]
    if max(size) > limit:
        raise RenderError(
            f"{what} need a texture of {size[0]} x {size[1]}; "
            f"{context.info['GL_RENDERER']} takes at most {limit}"
        )
    texture = context.texture(size, components, dtype="f4")
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return checked(context, texture, what)
