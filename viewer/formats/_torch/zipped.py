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

from viewer.diagnostics import Phrase
from viewer.errors import FormatError
from viewer.formats._archive.stored_file import StoredFile
from viewer.formats._archive.values import Archive
from viewer.formats._archive.zip_directory import DAMAGE, ZipDirectory
from viewer.formats._misfit import MisfitError
from viewer.formats._pickle.machine import Machine
from viewer.formats._pickle.reading import named_archive
from viewer.formats._pickle.steps import run
from viewer.formats._pickle.tensors import Storage, storage_of
from viewer.phrases import printable

__all__ = ["is_torch", "open_torch"]

_PICKLE = "/data.pkl"
_LARGEST_PICKLE = 64 << 20  # maximum bytes of the pickle, which does not contain the arrays
_LARGEST_READ = 1 << 20


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
        raise source.fault("F002.torch-kind")
    size = members[found[0]].file_size
    if size > _LARGEST_PICKLE:
        raise source.fault("F001.too-large", most=_LARGEST_PICKLE, size=size)
    order: Literal["<", ">"] = "<"
    if f"{root}byteorder" in members:
        order = ">" if directory.archive.read(f"{root}byteorder") == b"big" else "<"
    storages = _Storages(directory.storage, f"{root}data/", members, order)
    machine = Machine(source, directory.archive.read(found[0]))
    machine.persistent = storages.find
    whole = run(machine)
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
            raise MisfitError(Phrase("tensor-persistent"))
        key, storage = found
        member = self._members.get(self._folder + key)
        if member is None:
            raise MisfitError(Phrase("tensor-key", item=key))
        if member.file_size != storage.size:
            values = {"item": key, "expected": storage.size, "found": member.file_size}
            raise MisfitError(Phrase("tensor-member", **values))
        known = self._known.setdefault(key, storage)
        if (known.code, known.count) != (storage.code, storage.count):
            raise MisfitError(Phrase("tensor-storages", item=key))
        known.order, known.load = self._order, partial(_read_member, self._file, member)
        return known


def _read_member(storage: StoredFile, member: zipfile.ZipInfo) -> memoryview:
    """Read the bytes of a member in pieces: reading it as a whole needs twice the memory."""
    room, done = bytearray(member.file_size), 0
    try:
        with (
            storage.open() as file,
            zipfile.ZipFile(file) as archive,
            archive.open(member) as stream,
        ):
            while done < len(room):
                piece = stream.read(min(_LARGEST_READ, len(room) - done))
                if not piece:
                    raise EOFError(f"{done} bytes")
                room[done : done + len(piece)] = piece
                done += len(piece)
    except DAMAGE as problem:
        raise _damaged(storage, member.filename, problem) from None
    return memoryview(room).toreadonly()


def _damaged(storage: StoredFile, key: str, problem: Exception) -> FormatError:
    return storage.fault(key, Phrase("npy-damaged", reason=printable(problem, 100)))
