"""Mipmaps of textures, computed by numpy for software rendering.

Mesa compiles two programs for ``glGenerateMipmap``, which takes 60 ms: a fifth of the time from
start-up to the first image. Only for large textures does the driver save more than that: one of
4096 x 4096 pixels takes it 60 ms, and numpy 170 ms.
"""

from __future__ import annotations

import ctypes
import sys
from functools import lru_cache
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.rendering.gpu.context import is_software
from viewer.rig.arrays import Bytes
from viewer.rig.srgb import decode_srgb, encode_srgb

_SRGB8_ALPHA8, _RGBA8 = 0x8C43, 0x8058
_RGBA, _UNSIGNED_BYTE, _TEXTURE_2D = 0x1908, 0x1401, 0x0DE1
_STEPS = 1 << 14  # number of steps of linear light; the sum of four values still fits into 16 bits
_SHIFT = np.uint16(6)  # linear bytes are multiplied by 64, which uses nearly all steps
_HALF = np.uint16(1 << 5)
_BLOCK = 1 << 16  # number of pixels that are converted together
_MOST_PIXELS = 1 << 22  # maximum size of a texture for which numpy takes less time than compiling
_LANES = np.uint64(0x3FFF_3FFF_3FFF_3FFF)  # the bits of a step in each of four channels


def add_mipmaps(texture: moderngl.Texture, pixels: Bytes, is_linear: bool = False) -> None:
    """Add all smaller levels to a texture.

    ``texture``: an RGBA texture, whose context must be current. ``pixels``: (H, W, 4) uint8,
    contents of the texture, first row at v = 0. ``is_linear``: whether the pixels are linear data,
    not sRGB colours.
    """
    is_small = texture.width * texture.height <= _MOST_PIXELS
    upload = _upload_function() if is_small and is_software(texture.ctx) else None
    if upload is None:
        texture.build_mipmaps()
        return
    texture.use()
    for level, picture in enumerate(halved_pictures(pixels, is_linear), 1):
        height, width = picture.shape[:2]
        stored_as = _RGBA8 if is_linear else _SRGB8_ALPHA8
        size = (level, stored_as, width, height, 0)
        upload(_TEXTURE_2D, *size, _RGBA, _UNSIGNED_BYTE, picture.ctypes.data)


def halved_pictures(pixels: Bytes, is_linear: bool = False) -> list[Bytes]:
    """Return the mipmap levels from half the size down to one pixel, averaged in linear light.

    ``pixels``: (H, W, 4) uint8, pixels in sRGB unless ``is_linear``; alpha is treated like a
    colour. ``is_linear``: whether the pixels are linear data. Returns list of (H >> n, W >> n, 4)
    uint8, no side is shorter than 1; an odd last row or column is dropped.
    """
    pixels = np.ascontiguousarray(pixels)
    height, width = pixels.shape[:2]
    if height == width == 1:
        return []
    # Blocks of rows fit into the processor's caches. An odd last row never forms a block alone.
    count = 2 * max(_BLOCK // (2 * width), 1)
    blocks = (pixels[first : first + count] for first in range(0, max(height - 1, 1), count))
    texels = np.concatenate([_halved(_decoded(block, is_linear)) for block in blocks])
    pictures = [_encoded(texels, is_linear)]
    while max(texels.shape) > 1:
        texels = _halved(texels)
        pictures.append(_encoded(texels, is_linear))
    return pictures


def _halved(texels: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return the averages of squares of four texels, or of pairs if one side is 1."""
    rows, columns = (side // 2 for side in texels.shape)
    texels = texels[: 2 * rows : 2] + texels[1 : 2 * rows : 2] if rows else 2 * texels
    texels = (
        texels[:, : 2 * columns : 2] + texels[:, 1 : 2 * columns : 2] if columns else 2 * texels
    )
    return (texels >> np.uint64(2)) & _LANES


def _decoded(pixels: Bytes, is_linear: bool) -> NDArray[np.uint64]:
    """Return the steps of linear light of four channels per number: (H, W).

    Sums of four pixels fit into the 16 bits of a channel, so a single addition adds all channels.
    """
    if is_linear:
        steps = pixels.astype(np.uint16) << _SHIFT
    else:
        # Looking up two channels together takes half the time.
        steps = _tables()[0].take(pixels.view(np.uint16)).view(np.uint16)
    return steps.view(np.uint64)[..., 0]


def _encoded(texels: NDArray[np.uint64], is_linear: bool) -> Bytes:
    """Return the pixels of steps of linear light: (H, W, 4)."""
    steps = texels[..., None].view(np.uint16)
    if is_linear:
        return ((steps + _HALF) >> _SHIFT).astype(np.uint8)
    return _tables()[1].take(steps)


@lru_cache(1)
def _tables() -> tuple[NDArray[np.uint32], Bytes]:
    """Return the lookup tables from two sRGB bytes to two steps of linear light, and back."""
    values, steps = np.arange(256) / 255.0, np.arange(_STEPS) / (_STEPS - 1)
    decode = np.rint(decode_srgb(values) * (_STEPS - 1)).astype(np.uint16)
    two = np.arange(1 << 16, dtype=np.uint16).view(np.uint8).reshape(-1, 2)
    pairs = decode.take(two).view(np.uint32)[:, 0]
    return np.ascontiguousarray(pairs), np.rint(255.0 * encode_srgb(steps)).astype(np.uint8)


def _upload_function() -> Any:
    """Return glTexImage2D, which moderngl exposes for level 0 only; None if it is not found."""
    if not sys.platform.startswith("linux"):
        return None
    try:
        function = ctypes.CDLL("libGL.so.1").glTexImage2D
    except (OSError, AttributeError):
        return None
    function.restype = None
    integers = [ctypes.c_uint] + 5 * [ctypes.c_int] + 2 * [ctypes.c_uint]
    function.argtypes = (*integers, ctypes.c_void_p)
    return function
