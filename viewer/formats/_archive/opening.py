"""Opening of pickles, ``.npz``, ``.npy``, torch and JSON files, detected by their first bytes."""

from __future__ import annotations

import bz2
import io
import json
import lzma
import re
import zlib
from collections.abc import Callable
from functools import partial
from typing import Protocol

from viewer.formats._archive.values import Archive, Value
from viewer.formats._archive.zip import MAX_RATIO, SMALL, Data, FileWindow
from viewer.formats._source import Source
from viewer.formats._text.json_places import MOST_DIGITS, deepest_place, long_number_place
from viewer.phrases import printable

_ZIP = (b"PK\x03\x04", b"PK\x05\x06")
_NPY = b"\x93NUMPY"
_LFS = b"version https://git-lfs"
# Protocols 2 to 5 have a header; protocols 0 and 1 begin with the value that they build.
_PICKLE = re.compile(
    rb"\x80[\x02-\x05]|\(d[pqSUVX(.]|\}[q(.]|\(lp[0-9]|\][q(.]"
    rb"|c(?:__builtin__|builtins|copy_reg|collections|numpy|scipy|chumpy|os|posix|nt)[\w.]*\r?\n"
)
_PICKLE_START = re.compile(rb"\x80[\x02-\x05]|[(}\]c]")
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
_LARGE = 32 << 20  # bytes up to which pickles are read as a whole
_SHORTEST = 12  # minimum size of a compressed pickle, bytes
_PIECE = 1 << 20  # number of bytes unpacked at a time
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


def is_archive(head: bytes) -> bool:
    r"""Return whether a file that begins with these bytes is a pickle, an ``.npz`` or an ``.npy``.

    >>> is_archive(b"\x80\x02}q\x01."), is_archive(b"positions 4 {")
    (True, False)
    """
    return head.startswith((*_ZIP, _NPY)) or _PICKLE.match(head) is not None or _is_compressed(head)


def _is_compressed(head: bytes) -> bool:
    r"""Return whether a file that begins with these bytes may be a compressed pickle.

    >>> _is_compressed(zlib.compress(bytes([128, 4]) + b"}." * 20)), _is_compressed(b"x^2 + y^2")
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
    return not begin or _PICKLE_START.match(begin) is not None


def open_archive(source: Source) -> Archive:
    """Open a pickle, ``.npz``, ``.npy``, torch or JSON file, detected by its first bytes.

    ``source``: the file. Harmless errors are added to its warnings. Its ``max_size`` also limits
    the total unpacked size of compressed files. Raises ``FormatError`` if the file is none of
    these, is damaged, or contains anything other than data.
    """
    # Imported late, so that readers of other formats do not import them.
    from viewer.formats._archive.npz import open_npy, open_npz
    from viewer.formats._archive.zip import open_directory
    from viewer.formats._torch import is_torch, open_torch

    head = source.peek(4096)
    if head.startswith(_ZIP):
        with open_directory(source) as directory:
            if is_torch(directory):
                return open_torch(directory)
            return open_npz(directory, partial(_open_member, source), partial(_list_member, source))
    if head.startswith(_NPY):
        return open_npy(source, _open_objects)
    if head.startswith(_LFS):
        raise source.fault("F002.archive-pointer")
    if _is_compressed(head):
        return _open_pickle(source, unpacked(source))
    if head.lstrip()[:1] in (b"{", b"["):
        return _open_json(source)
    if not is_archive(head):
        looks = source.looks_like() or "an unknown format"
        raise source.fault("F002.archive", found=looks)
    return _open_pickle(source, _pickle_data(source))


def _open_json(source: Source) -> Archive:
    """Open a JSON file; NaN and infinities are numbers, as Python writes them."""
    from viewer.formats._pickle.reading import named_archive

    text = source.data.decode("utf-8", "replace")
    try:
        whole = json.loads(text)
    except json.JSONDecodeError as problem:
        offset = len(text[: problem.pos].encode())
        raise source.fault("F002.json", offset, reason=printable(problem.msg, 100)) from None
    except RecursionError:
        raise source.fault("F002.json-nesting", deepest_place(text)) from None
    except ValueError:  # decoding can raise no other error
        place = long_number_place(text)
        raise source.fault("F002.capture-digits", place, most=MOST_DIGITS) from None
    return named_archive(source, "json", len(source.data), whole)


def _pickle_data(source: Source) -> Data:
    """Return the bytes of a pickle; the bytes of a large file are read on demand."""
    from viewer.formats._archive.zip import StoredFile

    if source._data is None:
        storage = StoredFile(source)
        if storage.size > _LARGE:
            return FileWindow(storage)
    return source.data


def _open_pickle(source: Source, data: Data) -> Archive:
    """Open a pickle, or a legacy torch file, which begins like one."""
    from viewer.formats._pickle.machine import Machine, run
    from viewer.formats._pickle.reading import named_archive, warn_of_rest
    from viewer.formats._torch import MAGIC, read_bytes, read_stream

    machine = Machine(source, data)
    machine.load_bytes = read_bytes
    whole = read_stream(machine) if data[: len(MAGIC)] == MAGIC else run(machine)
    warn_of_rest(machine)
    return named_archive(source, "pickle", len(data), whole)


def _open_member(source: Source, key: str, data: bytes) -> Archive | None:
    """Open the dict, or list of dicts, in an array of objects of an ``.npz``; None for others."""
    from viewer.formats._pickle.machine import Machine, run
    from viewer.formats._pickle.reading import nested_archive
    from viewer.formats._torch import read_bytes

    machine = Machine(source, data)
    machine.load_bytes = read_bytes
    return nested_archive(source, "npz", len(data), run(machine), (key,))


def _list_member(source: Source, key: str, data: bytes) -> Value:
    """Return the objects in an array of objects of an ``.npz`` as a list; None for others."""
    from viewer.formats._pickle.machine import Machine, run
    from viewer.formats._pickle.reading import listed
    from viewer.formats._torch import read_bytes

    machine = Machine(source, data)
    machine.load_bytes = read_bytes
    return listed(source, len(data), key, run(machine))


def _open_objects(source: Source, offset: int) -> Archive | None:
    """Open the dict, or list of dicts, in an array of objects; None for other objects."""
    from viewer.formats._pickle.machine import Machine, run
    from viewer.formats._pickle.reading import has_names, named_archive, warn_of_rest
    from viewer.formats._torch import read_bytes

    data = _pickle_data(source)
    machine = Machine(source, data, offset)
    machine.load_bytes = read_bytes
    whole = run(machine)
    warn_of_rest(machine)
    return named_archive(source, "npy", len(data), whole) if has_names(whole) else None


def unpacked(source: Source) -> bytes:
    """Return the pickle in a compressed file.

    Raises ``FormatError`` if the data are damaged, not a pickle, packed by an unsupported method,
    or too large.
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
        if not result.tell() and found and not _PICKLE_START.match(found):
            raise source.fault("F002.packed-kind", method=method, found=found[:20])
        if result.tell() + len(found) > most:
            raise source.fault("F002.packed-size", method=method, most=most, size=len(data))
        result.write(found)
    return result.getvalue()
