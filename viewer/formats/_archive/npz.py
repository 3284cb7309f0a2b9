r"""Reader of ``.npz`` and ``.npy`` files: arrays only, never pickled objects.

::

    npz    = zip archive of members "<key>.npy", each stored or deflated
    npy    = "\x93NUMPY" version length header values
    header = "{" "'descr': '<f8'" "'fortran_order': False" "'shape': (6890, 3)" "}"   in any order

On opening, the zip directory and the headers are read, and all sizes are checked for consistency.
Values are read on demand, from the file if it is on disk. The header is matched by its grammar;
numpy's own reader evaluates it as Python code, and warns about files of Python 2.
"""

from __future__ import annotations

import io
import math
import os
import re
import stat
import struct
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import IO, Any, cast

import numpy as np
from numpy.typing import NDArray

from viewer.diagnostics import Diagnostic, Phrase
from viewer.errors import FormatError
from viewer.formats._archive.values import Archive, Opaque, Value
from viewer.formats._file_bytes import unreadable
from viewer.formats._misfit import MisfitError
from viewer.formats._source import Source
from viewer.phrases import printable
from viewer.rig.arrays import Deferred

__all__ = ["array_dtype", "item_count", "open_npy", "open_npz", "shaped"]

_DTYPE = re.compile(r"[<>=|]?(?:b1|[iu][1248]|f[248]|[SU]([1-9][0-9]{0,6}))")
_LONGEST_TEXT = 1 << 20  # characters in one element
_MAX_AXES = 32
_MAX_BYTES = 1 << 60  # elements of an array; numpy cannot count more, even if an axis is 0
_LAST_LETTER = 0x10FFFF  # last code point of Unicode; numpy stores 4 bytes without checking them

_LONGEST_DIRECTORY = 2 << 20  # bytes, about 30,000 members: each member takes memory
_MAX_RATIO = 100  # ratio of unpacked to packed size; smooth motions reach 10 to 20
_SMALL = 64 << 20  # bytes; below this any ratio is accepted, as arrays of zeros compress well
_ENCRYPTED = 0x41  # flag bits 0 and 6
_METHODS = {12: "bzip2", 14: "LZMA", 93: "Zstandard"}
_CHUNK = 1 << 20
# All exceptions that zipfile raises for damaged archives, as found by mutation tests.
_DAMAGE = (
    zipfile.BadZipFile,
    zipfile.LargeZipFile,
    zlib.error,
    struct.error,
    OSError,
    EOFError,
    RuntimeError,
    ValueError,
    OverflowError,
)

_LONGEST_HEADER = 1 << 16
_LEAD = {
    b"\1\0": "<H",
    b"\2\0": "<I",
    b"\3\0": "<I",
}  # struct format of the header length, by version
_RECORD = re.compile(rb"'descr'\s*:\s*[\[(]")
_ITEM = re.compile(
    rb"'(?P<key>descr|fortran_order|shape)'\s*:\s*"
    rb"(?:'(?P<descr>[^'\\]{1,20})'|(?P<order>True|False)|\((?P<shape>[0-9L,\s]*)\))"
)
_FIELDS = {b"descr": "descr", b"fortran_order": "order", b"shape": "shape"}


def array_dtype(code: str) -> np.dtype[Any] | None:
    """Return a numeric or string dtype by its numpy spelling, or None for other types.

    Records, sub-arrays, objects, dates and platform-dependent types are not supported.

    >>> array_dtype(">f4"), array_dtype("|O"), array_dtype("S0")
    (dtype('>f4'), None, None)
    """
    match = _DTYPE.fullmatch(code)
    if match is None or int(match[1] or 1) > _LONGEST_TEXT:
        return None
    return np.dtype(code)


def item_count(shape: tuple[int, ...], item_size: int) -> int | None:
    """Return the number of elements of a shape, or None if numpy does not support it.

    >>> item_count((6890, 3), 8), item_count((0, 1 << 62), 8)
    (20670, None)
    """
    # An axis of length 0 makes the product 0 even if other axes are too long.
    if (
        len(shape) > _MAX_AXES
        or math.prod(max(side, 1) for side in shape) > _MAX_BYTES // item_size
    ):
        return None
    return math.prod(shape)


def shaped(flat: NDArray[Any], shape: tuple[int, ...], is_fortran: bool) -> NDArray[Any]:
    """Return flat values in their shape, C order and native byte order; copied if needed.

    Raises
    ------
    MisfitError
        If an element of a string array is not a valid character.
    """
    if flat.dtype.kind == "b" and flat.size and int(flat.view(np.uint8).max()) > 1:
        # numpy accepts any byte as bool, and then computes wrong results.
        flat = flat.view(np.uint8) != 0
    array = flat.reshape(shape, order="F" if is_fortran else "C")
    array = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("=")).reshape(shape)
    if array.dtype.kind == "U" and array.size:
        last = int(array.reshape(-1).view(np.uint32).max())
        if last > _LAST_LETTER:
            raise MisfitError(Phrase("array-letter", found=last))
    return array


@dataclass(frozen=True, slots=True)
class _Header:
    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    is_fortran: bool
    n_items: int
    offset: int  # size of the values, in bytes

    def deferred(self, load: Callable[[], NDArray[Any]]) -> Deferred:
        return Deferred(self.shape, self.dtype.newbyteorder("="), load)


class _Reader(io.BufferedReader):
    """A file with a size limit for each read, as zipfile trusts the declared directory size."""

    def read(self, size: int | None = -1, /) -> bytes:
        if size is None or size < 0:
            here = self.tell()
            size = self.seek(0, os.SEEK_END) - here
            self.seek(here)
        if size > _LONGEST_DIRECTORY:
            raise ValueError(f"a directory of {size} bytes")
        return super().read(size)


class _Storage:
    """The file of a source, reopened for each read, or its bytes if there is no file."""

    def __init__(self, source: Source) -> None:
        self.path = source.path
        self._data = source._data  # None unless the file has been read already
        self._stamp: tuple[int, int] | None = None
        try:
            status = self.path.stat()
            if stat.S_ISREG(status.st_mode) and self._is_in_file():
                self._stamp = status.st_size, status.st_mtime_ns
        except (OSError, ValueError) as problem:
            if self._data is None:
                raise unreadable(self.path, _reason(problem)) from None
        if self._stamp is None:
            self.size = len(self._data or b"")
        else:
            self._data, self.size = None, self._stamp[0]

    def _is_in_file(self) -> bool:
        """Return whether the bytes are those of the file, apart from a final Ctrl-Z."""
        if self._data is None:
            return True
        with self.path.open("rb") as file:
            head = file.read(_CHUNK)
            file.seek(len(self._data))
            rest = file.read(_CHUNK)
        return self._data[:_CHUNK] == head[: len(self._data)] and not rest.strip(b"\x1a")

    def open(self) -> IO[bytes]:
        """Open the file, which must be unchanged since it was first opened."""
        if self._data is not None:
            return _Reader(cast("io.RawIOBase", io.BytesIO(self._data)))
        try:
            file = _Reader(self.path.open("rb", buffering=0))
        except OSError as problem:
            raise unreadable(self.path, _reason(problem)) from None
        status = os.fstat(file.fileno())
        if (status.st_size, status.st_mtime_ns) != self._stamp:
            file.close()
            raise FormatError(Diagnostic("F002.changed", self.path))
        return file

    def fault(self, key: str, problem: Phrase) -> FormatError:
        """Return an error that gives the file and the key."""
        values = {"item": printable(key, 60), "problem": problem}
        return FormatError(Diagnostic("F002.archive-value", self.path, values=values))


def _reason(problem: Exception) -> object:
    return getattr(problem, "strerror", None) or problem


def open_npz(source: Source) -> Archive:
    """Open an ``.npz`` file; raises as ``open_archive`` does."""
    storage = _Storage(source)
    try:
        with storage.open() as file, zipfile.ZipFile(file) as archive:
            members = archive.infolist()
            _check_members(source, members, storage.size)
            values = {_key(member): _open_member(storage, archive, member) for member in members}
    except _DAMAGE as problem:
        raise source.fault("F002.npz", reason=printable(problem, 100)) from None
    return Archive(source, "npz", tuple(values), values.__getitem__)


def open_npy(source: Source) -> Archive:
    """Open an ``.npy`` file as an archive with the single key "arr_0"."""
    key = "arr_0"
    storage = _Storage(source)
    with storage.open() as stream:
        header = _read_header(storage, key, stream, storage.size)
    if isinstance(header, Opaque):
        value: Value = header
    else:
        if storage.size > source.max_size:
            raise source.fault("F001.too-large", most=source.max_size, size=storage.size)
        value = header.deferred(partial(_load_file, storage, key, header))
    return Archive(source, "npy", (key,), {key: value}.__getitem__)


def _key(member: zipfile.ZipInfo) -> str:
    return member.filename.removesuffix(".npy")


def _check_members(source: Source, members: list[zipfile.ZipInfo], size: int) -> None:
    """Refuse unreadable or oversized members before anything is unpacked."""
    for name, count in Counter(map(_key, members)).items():
        if count > 1:
            raise source.fault("F002.npz-twice", item=printable(name, 60), found=count)
    for member in members:
        name, method = printable(_key(member), 60), member.compress_type
        if member.flag_bits & _ENCRYPTED:
            raise source.fault("F002.npz-encrypted", item=name)
        if method in _METHODS:
            raise source.fault("F002.npz-method-name", item=name, method=_METHODS[method])
        if method not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise source.fault("F002.npz-method", item=name, method=method)
    total = sum(member.file_size for member in members)
    if total > source.max_size:
        raise source.fault("F001.too-large", most=source.max_size, size=total)
    if total > max(_SMALL, _MAX_RATIO * size):
        raise source.fault("F002.npz-ratio", most=_MAX_RATIO, found=total, size=size)


def _open_member(storage: _Storage, archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> Value:
    key = _key(member)
    if not member.filename.endswith(".npy"):
        return Opaque(Phrase("unread-member"))
    with archive.open(member) as stream:
        header = _read_header(storage, key, stream, member.file_size)
    if isinstance(header, Opaque):
        return header
    return header.deferred(partial(_load_member, storage, member, header))


def _read_header(storage: _Storage, key: str, stream: IO[bytes], size: int) -> _Header | Opaque:
    """Read the header, and check that the values fill the rest of ``size`` bytes."""
    lead = stream.read(8)
    layout = _LEAD.get(lead[6:8])
    if not lead.startswith(b"\x93NUMPY") or layout is None:
        raise storage.fault(key, Phrase("npy-lead", found=lead))
    width = struct.calcsize(layout)
    length = int.from_bytes(stream.read(width), "little")
    if length >= _LONGEST_HEADER:
        raise storage.fault(key, Phrase("npy-header-length", found=length))
    text = stream.read(length)
    if len(text) < length:
        raise storage.fault(key, Phrase("npy-header-cut", expected=length, found=len(text)))
    if _RECORD.search(text):
        return Opaque(Phrase("unread-records"))
    return _parse_header(storage, key, text, 8 + width + length, size)


def _parse_header(
    storage: _Storage, key: str, text: bytes, offset: int, size: int
) -> _Header | Opaque:
    found = {match["key"]: match[_FIELDS[match["key"]]] for match in _ITEM.finditer(text)}
    rest = re.sub(rb"[\s,]+", b"", _ITEM.sub(b"", text))
    shape = _parse_shape(found.get(b"shape"))
    descr, order = found.get(b"descr"), found.get(b"fortran_order")
    if rest != b"{}" or shape is None or descr is None or order is None:
        raise storage.fault(key, Phrase("npy-header", found=text[:80]))
    code = descr.decode("latin-1")
    dtype = array_dtype(code)
    if dtype is None:
        is_object = code.endswith("O")
        return Opaque(Phrase("unread-objects") if is_object else Phrase("unread-dtype", dtype=code))
    n_items = item_count(shape, dtype.itemsize)
    if n_items is None or n_items * dtype.itemsize != size - offset:
        left = max(size - offset, 0)
        raise storage.fault(key, Phrase("array-bytes", shape=shape, dtype=dtype.name, found=left))
    return _Header(dtype, shape, order == b"True", n_items, offset)


def _parse_shape(text: bytes | None) -> tuple[int, ...] | None:
    """Parse axis lengths written as ``6890, 3``, ``5,`` or ``6890L, 3L`` (Python 2)."""
    if text is None:
        return None
    words = [word.strip().removesuffix(b"L") for word in text.split(b",")]
    if words[-1] == b"":
        words.pop()
    if len(words) > _MAX_AXES or not all(word.isdigit() and len(word) < 20 for word in words):
        return None
    return tuple(map(int, words))


def _load_member(storage: _Storage, member: zipfile.ZipInfo, header: _Header) -> NDArray[Any]:
    key = _key(member)
    try:
        with (
            storage.open() as file,
            zipfile.ZipFile(file) as archive,
            archive.open(member) as stream,
        ):
            return _load(storage, key, header, stream)
    except _DAMAGE as problem:
        raise _damaged(storage, key, problem) from None


def _load_file(storage: _Storage, key: str, header: _Header) -> NDArray[Any]:
    try:
        with storage.open() as stream:
            return _load(storage, key, header, stream)
    except _DAMAGE as problem:
        raise _damaged(storage, key, problem) from None


def _damaged(storage: _Storage, key: str, problem: Exception) -> FormatError:
    return storage.fault(key, Phrase("npy-damaged", reason=printable(problem, 100)))


def _load(storage: _Storage, key: str, header: _Header, stream: IO[bytes]) -> NDArray[Any]:
    stream.read(header.offset)
    size = header.n_items * header.dtype.itemsize
    try:
        flat = np.empty(header.n_items, header.dtype)
    except MemoryError:
        raise storage.fault(key, Phrase("npy-memory", size=size)) from None
    # The data is read in chunks, because reading it at once would need twice the memory.
    room = flat.view(np.uint8) if size else np.empty(0, np.uint8)
    done = 0
    while done < size:
        chunk = stream.read(min(_CHUNK, size - done))
        if not chunk:
            raise storage.fault(key, Phrase("npy-cut", expected=size, found=done))
        room[done : done + len(chunk)] = np.frombuffer(chunk, np.uint8)
        done += len(chunk)
    try:
        return shaped(flat, header.shape, header.is_fortran)
    except MisfitError as problem:
        raise storage.fault(key, problem.problem) from None
