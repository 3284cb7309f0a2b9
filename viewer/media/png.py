"""PNG encoder (W3C PNG, third edition), about three times faster than Pillow.

Pillow tries five filters on every row of an image. Here each row is filtered by "Sub", which
suits rendered surfaces and gradients, in numpy, and compressed at zlib's level 1.
"""

from __future__ import annotations

import struct
import zlib

import numpy as np

from viewer.rig.arrays import Bytes

__all__ = ["encode_png"]

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_SUB = 1
_RGB, _RGBA = 2, 6  # colour types


def encode_png(pixels: Bytes) -> bytes:
    """Return an image as the bytes of a PNG file, without alpha if all of it is opaque.

    Parameters
    ----------
    pixels : (H, W, 4) uint8
        sRGB and alpha, first row at the top.
    """
    is_opaque = bool((pixels[..., 3] == 255).all())
    channels, kind = (3, _RGB) if is_opaque else (4, _RGBA)
    height, width = pixels.shape[:2]
    rows = np.empty((height, 1 + width * channels), dtype=np.uint8)
    rows[:, 0] = _SUB
    filtered = rows[:, 1:].reshape(height, width, channels)
    filtered[:, 0] = pixels[:, 0, :channels]
    # The filter is defined modulo 256, so bytes may wrap around.
    np.subtract(
        pixels[:, 1:, :channels], pixels[:, :-1, :channels], out=filtered[:, 1:], casting="unsafe"
    )
    header = struct.pack(">IIBBBBB", width, height, 8, kind, 0, 0, 0)
    chunks = (
        (b"IHDR", header),
        (b"sRGB", b"\0"),
        (b"IDAT", zlib.compress(rows.data, 1)),
        (b"IEND", b""),
    )
    return _SIGNATURE + b"".join(_chunk(name, data) for name, data in chunks)


def _chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
