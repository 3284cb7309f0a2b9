"""Mipmaps of textures, computed by numpy for software rendering.

Mesa compiles two programs for ``glGenerateMipmap``, which takes 60 ms: a fifth of the time from
start-up to the first image.
"""

from __future__ import annotations

import ctypes
import sys
from typing import Any

import moderngl
import numpy as np

from viewer.rendering.gpu.context import is_software
from viewer.rig.arrays import Bytes
from viewer.rig.srgb import decode_srgb, encode_srgb

__all__ = ["add_mipmaps", "halved_pictures"]

_SRGB8_ALPHA8, _RGBA8 = 0x8C43, 0x8058
_RGBA, _UNSIGNED_BYTE, _TEXTURE_2D = 0x1908, 0x1401, 0x0DE1
_STEPS = 1 << 14  # number of steps of linear light; the sum of four values still fits into 16 bits
_CHANNELS = np.uint64((_STEPS - 1) * 0x0001_0001_0001_0001)  # the bits of four values


def add_mipmaps(texture: moderngl.Texture, pixels: Bytes, is_linear: bool = False) -> None:
    """Add all smaller levels to a texture.

    Parameters
    ----------
    texture : moderngl.Texture
        An RGBA texture, whose context must be current.
    pixels : (H, W, 4) uint8
        Contents of the texture, first row at v = 0.
    is_linear : bool
        Whether the pixels are linear data, not sRGB colours.
    """
    upload = _upload_function() if is_software(texture.ctx) else None
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

    Parameters
    ----------
    pixels : (H, W, 4) uint8
        Pixels in sRGB unless ``is_linear``; alpha is treated like a colour.
    is_linear : bool
        Whether the pixels are linear data.

    Returns
    -------
    list of (H >> n, W >> n, 4) uint8
        No side is shorter than 1; an odd last row or column is dropped.
    """
    decode, encode = _tables(is_linear)
    # Adds the four channels of a pixel as one number: sums of four values fit into 16 bits.
    linear = decode.take(pixels).view(np.uint64)[..., 0]
    pictures = []
    while max(linear.shape) > 1:
        height, width = linear.shape[0] // 2, linear.shape[1] // 2
        if height:
            linear = linear[0 : 2 * height : 2] + linear[1 : 2 * height : 2]
        if width:
            linear = linear[:, 0 : 2 * width : 2] + linear[:, 1 : 2 * width : 2]
        # A side of one pixel is averaged with itself.
        linear = linear >> np.uint64(2 if height and width else 1) & _CHANNELS
        channels = np.ascontiguousarray(linear).view(np.uint16)
        pictures.append(encode.take(channels.reshape(*linear.shape, 4)))
    return pictures


def _tables(is_linear: bool) -> tuple[np.ndarray, Bytes]:
    """Return the lookup tables from bytes to steps of linear light, and back."""
    values, steps = np.arange(256) / 255.0, np.arange(_STEPS) / (_STEPS - 1)
    decoded = values if is_linear else decode_srgb(values)
    encoded = steps if is_linear else encode_srgb(steps)
    decode = np.rint(decoded * (_STEPS - 1)).astype(np.uint16)
    return decode, np.rint(255.0 * encoded).astype(np.uint8)


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
