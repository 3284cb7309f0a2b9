"""PNG encoder (W3C PNG, third edition), about ten times faster than Pillow.

Pillow tries five filters on every row of an image. Here each row is filtered by "Sub", which
suits rendered surfaces and gradients, in numpy, and compressed by ISA-L, or by zlib at level 1
on machines for which ISA-L has no package.
"""

from __future__ import annotations

import struct
import zlib

import numpy as np

from viewer.rig.arrays import Bytes

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_SUB = 1
_RGB, _RGBA = 2, 6  # colour types


def encode_png(pixels: Bytes) -> bytes:
    """Return (H, W, 4) uint8 sRGB and alpha as PNG, without alpha if all of it is opaque."""
    is_opaque = int(pixels[..., 3].min()) == 255
    channels, kind = (3, _RGB) if is_opaque else (4, _RGBA)
    height, width = pixels.shape[:2]
    values = _packed(pixels, channels).reshape(height, width * channels)
    rows = np.empty((height, 1 + width * channels), dtype=np.uint8)
    rows[:, 0] = _SUB
    rows[:, 1 : 1 + channels] = values[:, :channels]
    # The filter is defined modulo 256, so bytes may wrap around.
    np.subtract(values[:, channels:], values[:, :-channels], out=rows[:, 1 + channels :])
    header = struct.pack(">IIBBBBB", width, height, 8, kind, 0, 0, 0)
    chunks = (
        (b"IHDR", header),
        (b"sRGB", b"\0"),
        (b"IDAT", _compressed(rows)),
        (b"IEND", b""),
    )
    return _SIGNATURE + b"".join(_chunk(name, data) for name, data in chunks)


def _packed(pixels: Bytes, channels: int) -> Bytes:
    """Return the first channels, contiguous: the filter then runs over whole rows."""
    if channels == pixels.shape[2]:
        return np.ascontiguousarray(pixels)
    packed = np.empty((*pixels.shape[:2], channels), dtype=np.uint8)
    for channel in range(channels):
        # Four times faster than a single assignment, whose inner loop would copy three bytes.
        packed[..., channel] = pixels[..., channel]
    return packed


def _compressed(rows: Bytes) -> bytes:
    """Return a zlib stream of the bytes."""
    try:
        from isal.isal_zlib import compress
    except ImportError:
        return zlib.compress(rows.data, 1)
    return compress(rows.data, 1)


def _chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
