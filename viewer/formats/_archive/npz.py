r"""Reader of ``.npz`` and ``.npy`` files: arrays, and dicts in arrays of objects.

::

    npz    = zip archive of members "<key>.npy", each stored or deflated
    npy    = "\x93NUMPY" version length header values
    header = "{" "'descr': '<f8'" "'fortran_order': False" "'shape': (6890, 3)" "}"   in any order

On opening, the zip directory and the headers are read, and all sizes are checked for consistency.
Values are read on demand, from the file if it is on disk. The header is parsed by its grammar;
numpy's reader would evaluate it as Python code, and warns about files of Python 2.
"""

from __future__ import annotations

import math
import re
import struct
import zipfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from typing import IO, TypeAlias

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Phrase, wording
from viewer.formats._archive.values import Archive, Opaque, Value, array_dtype, item_count, shaped
from viewer.formats._archive.zip import DAMAGE, StoredFile, ZipDirectory, opened_member, read_into
from viewer.formats._source import InvalidValueError, Source, too_large
from viewer.phrases import axes
from viewer.rigs.arrays import Deferred

_MAX_AXES = 32
_CHUNK = 1 << 16  # bytes of a pickle read at a time
_LONGEST_HEADER = 1 << 16
_LEAD = {b"\1\0": "<H", b"\2\0": "<I", b"\3\0": "<I"}  # format of the header's length, by version
_RECORD = re.compile(rb"'descr'\s*:\s*[\[(]")
_ITEM = re.compile(
    rb"'(?P<key>descr|fortran_order|shape)'\s*:\s*"
    rb"(?:'(?P<descr>[^'\\]{1,20})'|(?P<order>True|False)|\((?P<shape>[0-9L,\s]*)\))"
)
_OBJECTS = Opaque(Phrase("object array"))
_Opened: TypeAlias = Callable[[], AbstractContextManager[IO[bytes]]]
"""Opens an array in its file."""
_FIELDS = {b"descr": "descr", b"fortran_order": "order", b"shape": "shape"}


@dataclass(frozen=True, slots=True)
class _Header:
    dtype: np.dtype[np.generic]
    shape: tuple[int, ...]
    is_fortran: bool
    n_items: int
    offset: int  # position of the values, in bytes

    def deferred(
        self,
        load: Callable[[], NDArray[np.generic]],
        blocks: Callable[[int], Iterator[NDArray[np.generic]]] | None = None,
    ) -> Deferred:
        has_rows = bool(self.shape) and not self.is_fortran and self.dtype.isnative
        return Deferred(
            self.shape, self.dtype.newbyteorder("="), load, blocks if has_rows else None
        )


def open_npz(
    directory: ZipDirectory,
    opened: Callable[[str, bytes], Archive | None] | None = None,
    listed: Callable[[str, bytes], Value] | None = None,
) -> Archive:
    """Open an ``.npz`` file; ``opened`` and ``listed`` read a key's objects from their pickle."""
    directory.check(_key)
    members, storage = {_key(member): member for member in directory.members}, directory.storage
    values = {key: _open_member(directory, member) for key, member in members.items()}

    def branch(key: str) -> Archive | None:
        if opened is None or values[key] != _OBJECTS:
            return None
        return opened(key, _load_objects(storage, members[key]))

    def objects(key: str) -> Value:
        if listed is None or values[key] != _OBJECTS:
            return None
        return listed(key, _load_objects(storage, members[key]))

    return Archive(
        directory.source, "npz", tuple(values), values.__getitem__, branch, objects=objects
    )


def open_npy(
    source: Source, opened: Callable[[Source, int], Archive | None] | None = None
) -> Archive:
    """Open an ``.npy`` file as an archive with the single key "arr_0"."""
    key = "arr_0"
    storage = StoredFile(source)
    with storage.open() as stream:
        header = _read_header(storage, key, stream, storage.size)
        offset = stream.tell()
    if isinstance(header, Opaque):
        is_object = header == _OBJECTS
        named = opened(source, offset) if opened is not None and is_object else None
        if named is not None:
            return named
        value: Value = header
    else:
        if storage.size > source.max_size:
            raise too_large(source.path, storage.size, source.max_size)
        how = storage, key, header, partial(_opened_file, storage, key)
        value = header.deferred(partial(_load, *how), partial(_blocks, *how))
    return Archive(source, "npy", (key,), {key: value}.__getitem__)


def _key(member: zipfile.ZipInfo) -> str:
    return member.filename.removesuffix(".npy")


def _open_member(directory: ZipDirectory, member: zipfile.ZipInfo) -> Value:
    key = _key(member)
    if not member.filename.endswith(".npy"):
        return Opaque(Phrase("not an array"))
    storage = directory.storage
    with directory.archive.open(member) as stream:
        header = _read_header(storage, key, stream, member.file_size)
    if isinstance(header, Opaque):
        return header
    how = storage, key, header, partial(opened_member, storage, member, key)
    return header.deferred(partial(_load, *how), partial(_blocks, *how))


def _read_header(storage: StoredFile, key: str, stream: IO[bytes], size: int) -> _Header | Opaque:
    """Read the header, and check that the values fill the rest of ``size`` bytes."""
    lead = stream.read(8)
    layout = _LEAD.get(lead[6:8])
    if not lead.startswith(b"\x93NUMPY") or layout is None:
        raise storage.fault(key, "expected an .npy header, found {found}", found=lead)
    width = struct.calcsize(layout)
    length = int.from_bytes(stream.read(width), "little")
    if length >= _LONGEST_HEADER:
        raise storage.fault(
            key, "expected a header smaller than 64 KiB, found {found} bytes", found=length
        )
    text = stream.read(length)
    if len(text) < length:
        raise storage.fault(
            key,
            "expected a header of {expected} bytes, found {found}",
            expected=length,
            found=len(text),
        )
    if _RECORD.search(text):
        return Opaque(Phrase("structured array"))
    offset = 8 + width + length
    found = {match["key"]: match[_FIELDS[match["key"]]] for match in _ITEM.finditer(text)}
    rest = re.sub(rb"[\s,]+", b"", _ITEM.sub(b"", text))
    shape = _parse_shape(found.get(b"shape"))
    descr, order = found.get(b"descr"), found.get(b"fortran_order")
    if rest != b"{}" or shape is None or descr is None or order is None:
        raise storage.fault(
            key,
            "expected a header with descr, fortran_order and shape, found {found}",
            found=text[:80],
        )
    code = descr.decode("latin-1")
    dtype = array_dtype(code)
    if dtype is None:
        is_object = code.endswith("O")
        return Opaque(
            Phrase("object array") if is_object else Phrase("array of type {dtype}", dtype=code)
        )
    n_items = item_count(shape, dtype.itemsize)
    if n_items is None or n_items * dtype.itemsize != size - offset:
        left = max(size - offset, 0)
        raise storage.fault(
            key,
            "expected {shape} {dtype}, found {found} bytes",
            shape=axes(shape),
            dtype=dtype.name,
            found=left,
        )
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


@contextmanager
def _opened_file(storage: StoredFile, key: str) -> Iterator[IO[bytes]]:
    try:
        with storage.open() as stream:
            yield stream
    except DAMAGE as problem:
        raise storage.damaged(key, problem) from None


def _blocks(
    storage: StoredFile, key: str, header: _Header, opened: _Opened, count: int
) -> Iterator[NDArray[np.generic]]:
    """Yield blocks of rows, all in the same memory."""
    row = math.prod(header.shape[1:])
    with opened() as stream:
        stream.read(header.offset)
        flat = np.empty(min(count, header.shape[0]) * row, header.dtype)
        for start in range(0, header.shape[0], count):
            n_rows = min(count, header.shape[0] - start)
            part = flat[: n_rows * row]
            _fill(storage, key, part, stream)
            yield part.reshape(n_rows, *header.shape[1:])


def _load_objects(storage: StoredFile, member: zipfile.ZipInfo) -> bytes:
    """Return the pickle of a member that is an array of objects."""
    with opened_member(storage, member, _key(member)) as stream:
        _read_header(storage, _key(member), stream, member.file_size)
        return b"".join(iter(partial(stream.read, _CHUNK), b""))


def _load(storage: StoredFile, key: str, header: _Header, opened: _Opened) -> NDArray[np.generic]:
    size = header.n_items * header.dtype.itemsize
    with opened() as stream:
        stream.read(header.offset)
        try:
            flat = np.empty(header.n_items, header.dtype)
        except MemoryError:
            raise storage.fault(key, "not enough memory: {size} bytes needed", size=size) from None
        _fill(storage, key, flat, stream)
    try:
        return shaped(flat, header.shape, header.is_fortran)
    except InvalidValueError as problem:
        raise storage.fault(key, problem.problem) from None


def _fill(storage: StoredFile, key: str, flat: NDArray[np.generic], stream: IO[bytes]) -> None:
    """Read the values of an array."""
    found = read_into(stream, flat.view(np.uint8).data) if flat.nbytes else 0
    if found < flat.nbytes:
        raise storage.fault(key, wording.NPY_CUT, expected=flat.nbytes, found=found)
