r"""Torch files since version 1.6: zip archives of a pickle and of storages.

::

    NAME/data.pkl     pickle of the saved value, whose storages are persistent ids
    NAME/data/KEY     the bytes of a storage, read when a tensor of it is used
    NAME/byteorder    "little" or "big"; NAME/version and others are not needed
"""

from __future__ import annotations

import zipfile
from functools import partial
from typing import Literal

from viewer.diagnostics import wording
from viewer.formats._archive.values import Archive
from viewer.formats._archive.zip import StoredFile, ZipDirectory, opened_member, read_into
from viewer.formats._pickle.machine import Machine
from viewer.formats._pickle.reading import named_archive
from viewer.formats._pickle.tensors import Storage, storage_of
from viewer.formats._pickle.values import Span, noun
from viewer.formats._source import InvalidValueError, too_large
from viewer.phrases import counted, quoted

_PICKLE = "/data.pkl"
_LARGEST_PICKLE = 64 << 20  # maximum bytes of the pickle, which does not contain the arrays


def is_torch(directory: ZipDirectory) -> bool:
    """Return whether a zip archive is a torch file."""
    return any(member.filename.endswith(_PICKLE) for member in directory.members)


def open_torch(directory: ZipDirectory) -> Archive:
    """Open a torch file whose value is a dict; errors as of ``open_archive``."""
    directory.check(lambda member: member.filename)
    source, members = directory.source, {member.filename: member for member in directory.members}
    found = [name for name in members if name.endswith(_PICKLE)]
    root = found[0].removesuffix("data.pkl")
    if len(found) > 1 or f"{root}constants.pkl" in members:
        raise source.fault(
            "F002.torch-kind: expected a torch file of tensors, found a compiled module "
            "(`torch.jit.save`), which is a program"
        )
    size = members[found[0]].file_size
    if size > _LARGEST_PICKLE:
        raise too_large(source.path, size, _LARGEST_PICKLE)
    order: Literal["<", ">"] = "<"
    if f"{root}byteorder" in members:
        order = ">" if directory.archive.read(f"{root}byteorder") == b"big" else "<"
    storages = _Storages(directory.storage, f"{root}data/", members, order)
    machine = Machine(source, directory.archive.read(found[0]))
    machine.persistent = storages.find
    whole = machine.run()
    return named_archive(source, "torch", max(size, directory.storage.size), whole)


class _Storages:
    """The storages of a file by key, each created once."""

    def __init__(
        self,
        file: StoredFile,
        folder: str,
        members: dict[str, zipfile.ZipInfo],
        order: Literal["<", ">"],
    ) -> None:
        self._file, self._folder, self._members, self._order = file, folder, members, order
        self._known: dict[str, Storage] = {}

    def find(self, persistent: object) -> Storage:
        """Return the storage of a persistent id, after comparing its size with the archive's."""
        found = storage_of(persistent)
        if found is None:
            raise InvalidValueError(wording.TENSOR_PERSISTENT)
        key, storage = found
        member = self._members.get(self._folder + key)
        if member is None:
            raise InvalidValueError(wording.TENSOR_KEY, item=quoted(key))
        if member.file_size != storage.size:
            values = {"item": quoted(key), "expected": storage.size, "found": member.file_size}
            raise InvalidValueError(
                "expected a storage {item} of {expected} bytes, found {found}", **values
            )
        known = self._known.setdefault(key, storage)
        if (known.code, known.count) != (storage.code, storage.count):
            raise InvalidValueError(wording.TENSOR_STORAGES, item=quoted(key))
        known.order, known.load = self._order, partial(_read_member, self._file, member)
        return known


def _read_member(storage: StoredFile, member: zipfile.ZipInfo) -> memoryview:
    room = memoryview(bytearray(member.file_size))
    with opened_member(storage, member, member.filename) as stream:
        found = read_into(stream, room)
        if found < len(room):
            raise EOFError(f"{found} bytes")
    return room.toreadonly()


# Legacy streams of torch: files before version 1.6, and storages inside other pickles.
#
# ::
#
#     stream  = magic number, protocol 1001, {"little_endian": …}, value, [key, …], storage …
#     storage = number of elements (8 bytes), their bytes; in the order of the keys
#
# The first five items are consecutive pickles. Storages in the value are persistent ids.

_NUMBER = 0x1950A86A20F9469CFC6C
_PROTOCOL = 1001
MAGIC = b"\x80\x02\x8a\nl\xfc\x9cF\xf9 j\xa8P\x19."
"""The first bytes of a legacy file."""


def read_bytes(outer: Machine, data: Span) -> object:
    """Return the storage that a pickle of tensors contains as bytes; see ``read_stream``."""
    inner = outer.nested(data.data, data.start, data.stop)
    found = read_stream(inner)
    outer.rejoin(inner)
    if not isinstance(found, Storage):
        raise outer.fail("expected a storage saved by torch, found {found}", found=noun(found))
    return found


def read_stream(machine: Machine) -> object:
    """Return the value of a legacy stream, with its storages in place."""
    if machine.run() != _NUMBER:
        raise machine.fail("expected a torch file, found a pickle of a different kind")
    if machine.run() != _PROTOCOL:
        raise machine.fail(
            "expected torch protocol {expected}, found a different one", expected=_PROTOCOL
        )
    system = machine.run()
    is_little = not isinstance(system, dict) or system.get("little_endian") is not False
    storages: dict[str, Storage] = {}
    machine.persistent = partial(_declare, storages, "<" if is_little else ">")
    found = machine.run()
    machine.persistent = None
    keys = machine.run()
    for key in keys if isinstance(keys, list) else []:
        # Find the bytes of a storage, whose number must be the declared one.
        name = key.text() if isinstance(key, Span) and key.coding is not None else ""
        storage = storages.get(name)
        if storage is None or storage.load is not None:
            raise machine.fail(wording.TENSOR_KEY, item=quoted(name))
        count = machine.number(8, is_signed=True)
        if count != storage.count:
            values = {
                "item": quoted(name),
                "expected": counted(storage.count, "element"),
                "found": count,
            }
            raise machine.fail("expected {expected} in the storage {item}, found {found}", **values)
        start = machine.skip(storage.size)
        storage.load = Span(machine.data, start, machine.at).view
    if any(storage.load is None for storage in storages.values()):
        raise machine.fail(wording.TENSOR_NO_STORAGE)
    return found


def _declare(storages: dict[str, Storage], order: Literal["<", ">"], persistent: object) -> Storage:
    """Return the storage of a persistent id, the same one for the same key."""
    found = storage_of(persistent)
    if found is None:
        raise InvalidValueError(wording.TENSOR_PERSISTENT)
    key, storage = found
    storage.order = order
    known = storages.setdefault(key, storage)
    if (known.code, known.count) != (storage.code, storage.count):
        raise InvalidValueError(wording.TENSOR_STORAGES, item=quoted(key))
    return known
