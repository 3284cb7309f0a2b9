"""Compressed pickles: recognised by their first bytes, and unpacked within limits of memory."""

from __future__ import annotations

import bz2
import io
import lzma
import re
import zlib
from collections.abc import Callable
from typing import Protocol

from viewer.formats._archive.zip_directory import MAX_RATIO, SMALL
from viewer.formats._source import Source
from viewer.phrases import printable

__all__ = ["is_compressed", "unpacked"]

_SHORTEST = 12  # minimum size of a compressed pickle, bytes
_PIECE = 1 << 20  # number of bytes unpacked at a time
_PICKLE = re.compile(rb"\x80[\x02-\x05]|[(}\]c]")
# The header of zlib may consist of letters, but in a text no control characters follow them.
_ZLIB = re.compile(rb"x[\x01\x5e\x9c\xda](?=[\s\S]*[\x00-\x08\x0e-\x1f\x80-\xff])")
_KINDS: dict[str, re.Pattern[bytes]] = {
    "zlib": _ZLIB,
    "gzip": re.compile(rb"\x1f\x8b\x08"),
    "bz2": re.compile(rb"BZh[1-9]1AY&SY"),
    "xz": re.compile(rb"\xfd7zXZ\x00"),
    "lzma": re.compile(rb"\x5d\x00\x00[\x00\x01-\xff]"),
}
_UNSUPPORTED = {"lz4": re.compile(rb"\x04\x22\x4d\x18"), "joblib 0.9": re.compile(rb"ZF0x")}
_DAMAGE = (zlib.error, lzma.LZMAError, OSError, EOFError, ValueError)


class _Unpacker(Protocol):
    """Common interface of the decompressors of bz2 and lzma."""

    @property
    def eof(self) -> bool: ...
    @property
    def needs_input(self) -> bool: ...
    def decompress(self, data: bytes, max_length: int = -1) -> bytes: ...


class _Zlib:
    """The decompressor of zlib with the interface of the decompressors of bz2 and lzma."""

    def __init__(self, window: int) -> None:
        self._inner = zlib.decompressobj(window)

    @property
    def eof(self) -> bool:
        return self._inner.eof

    @property
    def needs_input(self) -> bool:
        return not self._inner.unconsumed_tail

    def decompress(self, data: bytes, max_length: int = -1) -> bytes:
        return self._inner.decompress(self._inner.unconsumed_tail + data, max(max_length, 0))


_UNPACKERS: dict[str, Callable[[], _Unpacker]] = {
    "zlib": lambda: _Zlib(zlib.MAX_WBITS),
    "gzip": lambda: _Zlib(16 + zlib.MAX_WBITS),
    "bz2": bz2.BZ2Decompressor,
    "xz": lambda: lzma.LZMADecompressor(lzma.FORMAT_XZ),
    "lzma": lambda: lzma.LZMADecompressor(lzma.FORMAT_ALONE),
}


def is_compressed(head: bytes) -> bool:
    r"""Return whether a file that begins with these bytes may be a compressed pickle.

    >>> is_compressed(zlib.compress(bytes([128, 4]) + b"}." * 20)), is_compressed(b"x^2 + y^2")
    (True, False)
    """
    if any(kind.match(head) for kind in _UNSUPPORTED.values()):
        return True
    method = next((name for name, kind in _KINDS.items() if kind.match(head)), None)
    if method is None or len(head) < _SHORTEST:
        return False
    try:
        begin = _UNPACKERS[method]().decompress(head, _SHORTEST)
    except _DAMAGE:
        return False
    # A block longer than the head is unpacked when the file is opened.
    return not begin or _PICKLE.match(begin) is not None


def unpacked(source: Source) -> bytes:
    """Return the pickle in a compressed file.

    Raises
    ------
    FormatError
        If the data are damaged, not a pickle, packed by an unsupported method, or too large.
    """
    head = source.peek(64)
    for name, kind in _UNSUPPORTED.items():
        if kind.match(head):
            raise source.fault("F002.packed-method", method=name)
    method = next(name for name, kind in _KINDS.items() if kind.match(head))
    try:
        return _unpacked(source, method, _UNPACKERS[method]())
    except _DAMAGE as problem:
        reason = printable(problem, 100)
        raise source.fault("F002.packed", method=method, reason=reason) from None


def _unpacked(source: Source, method: str, unpacker: _Unpacker) -> bytes:
    data, result, at = source.data, io.BytesIO(), 0
    most = min(source.max_size, max(SMALL, MAX_RATIO * len(data)))
    while not unpacker.eof:
        piece = b""
        if unpacker.needs_input:
            piece = data[at : at + _PIECE]
            at += len(piece)
        found = unpacker.decompress(piece, _PIECE)
        if not piece and not found and at >= len(data):
            raise EOFError("truncated")
        if not result.tell() and found and not _PICKLE.match(found):
            raise source.fault("F002.packed-kind", method=method, found=found[:20])
        if result.tell() + len(found) > most:
            raise source.fault("F002.packed-size", method=method, most=most, size=len(data))
        result.write(found)
    return result.getvalue()
