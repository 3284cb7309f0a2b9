"""Opening of pickles, ``.npz``, ``.npy``, torch and JSON files, detected by their first bytes."""

from __future__ import annotations

import bz2
import lzma
import re
import zlib
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from viewer.errors import FormatError
from viewer.formats._archive.values import Archive, Value
from viewer.formats._archive.zip import MAX_RATIO, SMALL, Data, FileWindow
from viewer.formats._source import Source
from viewer.formats._text.json_places import decoded
from viewer.phrases import printable

if TYPE_CHECKING:
    from viewer.formats._pickle.machine import Machine

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
_DAMAGE = (zlib.error, lzma.LZMAError, OSError, EOFError, ValueError)


# Decompressors, whose ``decompress`` takes the data and the largest length of the result.
_UNPACKERS: dict[str, Callable[[], Any]] = {
    "zlib": zlib.decompressobj,
    "gzip": partial(zlib.decompressobj, 16 + zlib.MAX_WBITS),
    "bz2": bz2.BZ2Decompressor,
    "xz": partial(lzma.LZMADecompressor, lzma.FORMAT_XZ),
    "lzma": partial(lzma.LZMADecompressor, lzma.FORMAT_ALONE),
}


def is_archive(head: bytes) -> bool:
    """Return whether these first bytes are those of a pickle, an ``.npz`` or an ``.npy``."""
    return head.startswith((*_ZIP, _NPY)) or _PICKLE.match(head) is not None or _is_compressed(head)


def _is_compressed(head: bytes) -> bool:
    """Return whether a file that begins with these bytes may be a compressed pickle.

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
    """Open a pickle, ``.npz``, ``.npy``, torch or JSON file, detected by its first bytes."""
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
        raise source.fault(
            "F002.archive-pointer: expected a pickle, .npz or .npy file, found a Git LFS "
            "pointer (`git lfs pull` fetches the file)"
        )
    if _is_compressed(head):
        return _open_pickle(source, unpacked(source))
    if head.lstrip()[:1] in (b"{", b"["):
        return _open_json(source)
    if not is_archive(head):
        looks = source.looks_like() or "an unknown format"
        raise source.fault(
            "F002.archive: expected a pickle, .npz or .npy file, found {found}", found=looks
        )
    return _open_pickle(source, _pickle_data(source))


def _open_json(source: Source) -> Archive:
    """Open a JSON file; NaN and infinities are numbers, as Python writes them."""
    from viewer.formats._pickle.reading import named_archive

    text = source.data.decode("utf-8", "replace")

    def fault(key: str, offset: int | None, **values: object) -> FormatError:
        place = None if offset is None else len(text[:offset].encode())
        return source.fault(key, place, **values)

    whole = decoded(text, fault)
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
    from viewer.formats._pickle.reading import named_archive, warn_of_rest
    from viewer.formats._torch import MAGIC, read_stream

    machine = _machine(source, data)
    whole = read_stream(machine) if data[: len(MAGIC)] == MAGIC else machine.run()
    warn_of_rest(machine)
    return named_archive(source, "pickle", len(data), whole)


def _open_member(source: Source, key: str, data: bytes) -> Archive | None:
    """Open the dict, or list of dicts, in an array of objects of an ``.npz``; None for others."""
    from viewer.formats._pickle.reading import nested_archive

    return nested_archive(source, "npz", len(data), _machine(source, data).run(), (key,))


def _list_member(source: Source, key: str, data: bytes) -> Value:
    """Return the objects in an array of objects of an ``.npz`` as a list; None for others."""
    from viewer.formats._pickle.reading import listed

    return listed(source, len(data), key, _machine(source, data).run())


def _open_objects(source: Source, offset: int) -> Archive | None:
    """Open the dict, or list of dicts, in an array of objects; None for other objects."""
    from viewer.formats._pickle.reading import has_names, named_archive, warn_of_rest

    data = _pickle_data(source)
    machine = _machine(source, data, offset)
    whole = machine.run()
    warn_of_rest(machine)
    return named_archive(source, "npy", len(data), whole) if has_names(whole) else None


def _machine(source: Source, data: Data, start: int = 0) -> Machine:
    """Return the machine for a pickle that may contain tensors as bytes."""
    from viewer.formats._pickle.machine import Machine
    from viewer.formats._torch import read_bytes

    machine = Machine(source, data, start)
    machine.load_bytes = read_bytes
    return machine


def unpacked(source: Source) -> bytes:
    """Return the pickle in a compressed file; ``max_size`` of the source limits it, too."""
    head = source.peek(64)
    for name, kind in _UNSUPPORTED.items():
        if kind.match(head):
            raise source.fault(
                "F002.packed-method: expected a pickle compressed with zlib, gzip, bz2, xz or "
                "lzma, found {method}: save it again by `joblib.dump(joblib.load(FILE), FILE, "
                "compress=0)`",
                method=name,
            )
    method = next(name for name, kind in _KINDS.items() if kind.match(head))
    data, unpacker = source.data, _UNPACKERS[method]()
    most = min(source.max_size, max(SMALL, MAX_RATIO * len(data)))
    try:
        begin = _UNPACKERS[method]().decompress(data, 20)
        if begin and not _PICKLE_START.match(begin):
            raise source.fault(
                "F002.packed-kind: expected a pickle in the {method} data, found {found}",
                method=method,
                found=begin,
            )
        found = unpacker.decompress(data, most + 1)
        if len(found) <= most and not unpacker.eof:
            raise EOFError("truncated")
    except _DAMAGE as problem:
        reason = printable(problem, 100)
        raise source.fault(
            "F002.packed: expected valid {method} data, found damaged data ({reason})",
            method=method,
            reason=reason,
        ) from None
    if len(found) > most:
        raise source.fault(
            "F002.packed-size: expected at most {most} bytes in {size} bytes of {method} data, "
            "found more",
            method=method,
            most=most,
            size=len(data),
        )
    return bytes(found)
