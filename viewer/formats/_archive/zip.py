"""Zip archives: their directory, checked before anything is unpacked."""

from __future__ import annotations

import io
import os
import stat
import struct
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, cast, overload

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase, note, wording
from viewer.errors import FormatError, reason_of
from viewer.formats._source import Source, phrased, too_large, unreadable
from viewer.phrases import printable

DAMAGE = (
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
"""All exceptions that zipfile raises for damaged archives, as found by mutation tests."""
MAX_RATIO = 100
"""Largest ratio of unpacked to packed size; smooth motions reach 10 to 20."""
SMALL = 64 << 20
"""Unpacked size in bytes below which any ratio is accepted, as arrays of zeros compress well."""
_LONGEST_DIRECTORY = 2 << 20
"""Maximum bytes of one read, and thus of a zip directory: about 30,000 members."""
_CHUNK = 1 << 20
_INFLATED = 1 << 16  # bytes per piece, which stay in the cache between inflating and copying
_PAGE = 1 << 16  # number of bytes read at a time for small values
_PIECE = 1 << 20  # number of bytes read at a time for arrays
_ENCRYPTED = 0x41  # flag bits 0 and 6
_METHODS = {12: "bzip2", 14: "LZMA", 93: "Zstandard"}


@dataclass(frozen=True, slots=True)
class ZipDirectory:
    """A zip archive that is open for reading."""

    source: Source
    """The archive, for messages."""
    storage: StoredFile
    """Its file, which is opened again whenever a member is read later."""
    archive: zipfile.ZipFile
    """The open archive."""
    members: list[zipfile.ZipInfo]
    """Its members, whose sizes have been checked by ``check``."""

    def check(self, key_of: Callable[[zipfile.ZipInfo], str]) -> None:
        """Refuse repeated, encrypted, unreadable or oversized members before unpacking any."""
        source, named = self.source, [(key_of(member), member) for member in self.members]
        check_names([name for name, _ in named], source.fault)
        check_members(named, source.fault)
        total = sum(member.file_size for member in self.members)
        if total > source.max_size:
            raise too_large(source.path, total, source.max_size)
        check_ratio(total, self.storage.size, source.fault)


_Fault = Callable[..., FormatError]  # returns the error about an archive, given key and values


def check_names(names: Sequence[str], fault: _Fault) -> None:
    """Refuse an archive with several members of one name."""
    for name, count in Counter(names).items():
        if count > 1:
            raise fault(
                "F002.zip-twice: {item}: expected a single file with this path, found {found}",
                item=printable(name, 80),
                found=count,
            )


def check_members(members: Iterable[tuple[str, zipfile.ZipInfo]], fault: _Fault) -> None:
    """Refuse members, given with their names, that cannot be unpacked."""
    for name, member in members:
        item, method = printable(name, 80), member.compress_type
        if member.flag_bits & _ENCRYPTED:
            raise fault(
                "F002.zip-encrypted: {item}: expected an unencrypted file, found an encrypted one",
                item=item,
            )
        if method not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise fault(
                "F002.zip-method: {item}: expected a stored or deflated file, found {method}",
                item=item,
                method=_METHODS.get(method) or Phrase("compression method {method}", method=method),
            )


def check_ratio(total: int, size: int, fault: _Fault) -> None:
    """Refuse an archive of ``size`` bytes that unpacks to implausibly many."""
    if total > max(SMALL, MAX_RATIO * size):
        raise fault(
            "F002.zip-ratio: expected a compression ratio of at most {most}, found {found} bytes "
            "in {size}",
            most=MAX_RATIO,
            found=total,
            size=size,
        )


@contextmanager
def open_directory(source: Source) -> Iterator[ZipDirectory]:
    """Open a zip archive; damage found while it is open is an error of the source."""
    storage = StoredFile(source)
    try:
        with storage.open() as file, zipfile.ZipFile(file) as archive:
            yield ZipDirectory(source, storage, archive, archive.infolist())
    except DAMAGE as problem:
        raise source.fault(
            "F002.npz: expected a valid .npz file, found a damaged one ({reason})",
            reason=printable(problem, 100),
        ) from None


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


class StoredFile:
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
                raise unreadable(self.path, reason_of(problem)) from None
        if self._stamp is None:
            self.size = len(self._data or b"")
        else:
            self._data, self.size = None, self._stamp[0]

    def _is_in_file(self) -> bool:
        """Return whether the bytes are the file's bytes, apart from a final Ctrl-Z."""
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
            raise unreadable(self.path, reason_of(problem)) from None
        status = os.fstat(file.fileno())
        if (status.st_size, status.st_mtime_ns) != self._stamp:
            file.close()
            raise FormatError(
                Diagnostic("F002.changed: changed since it was opened: open it again", self.path)
            )
        return file

    def fault(self, key: str, problem: str | Phrase, **values: object) -> FormatError:
        """Return an error that states the file and the key."""
        return value_fault(self.path, key, problem, values)

    def damaged(self, key: str, problem: Exception) -> FormatError:
        """Return the error for a value whose bytes cannot be unpacked."""
        return self.fault(key, wording.NPY_DAMAGED, reason=printable(problem, 100))


@contextmanager
def opened_member(storage: StoredFile, member: zipfile.ZipInfo, key: str) -> Iterator[IO[bytes]]:
    """Open a member for reading; raise FormatError if it is damaged."""
    try:
        with (
            storage.open() as file,
            zipfile.ZipFile(file) as archive,
            archive.open(member) as stream,
        ):
            yield stream
    except DAMAGE as problem:
        raise storage.damaged(key, problem) from None


def read_into(stream: IO[bytes], room: memoryview) -> int:
    """Fill bytes from a stream, in pieces: a whole needs twice the memory; return how many."""
    done = 0
    while done < len(room) and (piece := stream.read(min(_INFLATED, len(room) - done))):
        room[done : done + len(piece)] = piece
        done += len(piece)
    return done


def value_fault(
    path: Path, key: str, problem: str | Phrase, values: dict[str, object]
) -> FormatError:
    """Return an error in the value of a key."""
    values = {"item": printable(key, 60), "problem": phrased(problem, values)}
    return FormatError(note(wording.ARCHIVE_VALUE, path, **values))


class FileWindow:
    """A file with the interface of bytes that the pickle machine uses."""

    def __init__(self, storage: StoredFile) -> None:
        self._storage = storage
        self._start, self._page = 0, b""

    def __len__(self) -> int:
        return self._storage.size

    @overload
    def __getitem__(self, where: int) -> int: ...
    @overload
    def __getitem__(self, where: slice) -> bytes: ...
    def __getitem__(self, where: int | slice) -> int | bytes:
        if isinstance(where, int):
            if not self._start <= where < self._start + len(self._page):
                self._start, self._page = where, self._read(where, where + _PAGE)
            return self._page[where - self._start]
        start, stop, _ = where.indices(len(self))
        first, last = start - self._start, stop - self._start
        if 0 <= first <= last <= len(self._page):
            return self._page[first:last]
        if stop - start <= _PAGE:
            self._start, self._page = start, self._read(start, start + _PAGE)
            return self._page[: max(stop - start, 0)]
        return self._read(start, stop)

    def find(self, wanted: bytes, start: int, stop: int) -> int:
        """Return the first offset of some bytes within a range, -1 if there is none."""
        while start < stop:
            end = min(start + _PIECE, stop)
            found = self[start:end].find(wanted)
            if found >= 0:
                return start + found
            # The bytes may extend across the end of a piece.
            start = end if end == stop else end - len(wanted) + 1
        return -1

    def _read(self, start: int, stop: int) -> bytes:
        pieces, stop = [], min(stop, len(self))
        with self._storage.open() as file:
            file.seek(start)
            while start < stop:
                piece = file.read(min(_PIECE, stop - start))
                if not piece:
                    raise self._storage.fault("", wording.NPY_CUT, expected=stop, found=start)
                pieces.append(piece)
                start += len(piece)
        return b"".join(pieces)


Data = bytes | FileWindow
"""The bytes of a pickle."""
