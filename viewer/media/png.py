"""PNG encoder (W3C PNG, third edition), about ten times faster than Pillow.

Pillow tries five filters on every row of an image. Here each row is filtered by "Sub", which
suits rendered surfaces and gradients, in numpy, and compressed by ISA-L, or by zlib at level 1
on machines for which ISA-L has no package. Rows are filtered in bands that fit into the processor's
cache, so an image is never copied as a whole.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from typing import Protocol

import numpy as np

from viewer.rigs.arrays import Bytes

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_SUB = 1
_RGB, _RGBA = 2, 6  # colour types
_BAND = 1 << 17  # pixels of a band


def encode_png(pixels: Bytes) -> bytes:
    """Return (H, W, 4) uint8 sRGB and alpha as PNG, without alpha if all of it is opaque."""
    is_opaque = int(pixels[..., 3].min()) == 255
    height, width = pixels.shape[:2]
    kind = _RGB if is_opaque else _RGBA
    header = struct.pack(">IIBBBBB", width, height, 8, kind, 0, 0, 0)
    chunks = (
        _chunk(b"IHDR", header),
        _chunk(b"sRGB", b"\0"),
        _chunk(b"IDAT", *_compressed(pixels, 3 if is_opaque else 4)),
        _chunk(b"IEND"),
    )
    return b"".join([_SIGNATURE, *(part for chunk in chunks for part in chunk)])


def _compressed(pixels: Bytes, channels: int) -> Iterator[bytes]:
    """Yield a zlib stream of the filtered rows of the first channels."""
    height, width = pixels.shape[:2]
    n_rows = min(max(_BAND // width, 1), height)
    band = np.empty((n_rows, width, channels), dtype=np.uint8)
    filtered = np.empty((n_rows, 1 + width * channels), dtype=np.uint8)
    filtered[:, 0] = _SUB
    compressor = _compressor()
    for top in range(0, height, n_rows):
        part = pixels[top : top + n_rows]
        for channel in range(channels):
            # Four times faster than a single assignment, whose inner loop would copy three bytes.
            band[: len(part), :, channel] = part[..., channel]
        values, rows = band[: len(part)].reshape(len(part), -1), filtered[: len(part)]
        rows[:, 1 : 1 + channels] = values[:, :channels]
        # The filter is defined modulo 256, so bytes may wrap around.
        np.subtract(values[:, channels:], values[:, :-channels], out=rows[:, 1 + channels :])
        yield compressor.compress(rows.data)
    yield compressor.flush()


class _Compressor(Protocol):
    def compress(self, data: memoryview, /) -> bytes: ...

    def flush(self) -> bytes: ...


def _compressor() -> _Compressor:
    try:
        from isal.isal_zlib import compressobj
    except ImportError:
        return zlib.compressobj(1)
    return compressobj(1)


def _chunk(name: bytes, *parts: bytes) -> Iterator[bytes]:
    """Yield a chunk: length, name, data and checksum."""
    yield struct.pack(">I", sum(map(len, parts)))
    checksum = 0
    for part in (name, *parts):
        yield part
        checksum = zlib.crc32(part, checksum)
    yield struct.pack(">I", checksum)
