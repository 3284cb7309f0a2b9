"""Files that are reopened for each value read from them, and must not change in between."""

from __future__ import annotations

import io
import os
import stat
from typing import IO, cast

from viewer.diagnostics import Diagnostic, Phrase
from viewer.errors import FormatError
from viewer.formats._file_bytes import unreadable
from viewer.formats._source import Source
from viewer.phrases import printable

__all__ = ["LONGEST_DIRECTORY", "StoredFile"]

LONGEST_DIRECTORY = 2 << 20
"""Maximum bytes of one read, and thus of a zip directory: about 30,000 members."""

_CHUNK = 1 << 20


class _Reader(io.BufferedReader):
    """A file with a size limit for each read, as zipfile trusts the declared directory size."""

    def read(self, size: int | None = -1, /) -> bytes:
        if size is None or size < 0:
            here = self.tell()
            size = self.seek(0, os.SEEK_END) - here
            self.seek(here)
        if size > LONGEST_DIRECTORY:
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
                raise unreadable(self.path, _reason(problem)) from None
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
            raise unreadable(self.path, _reason(problem)) from None
        status = os.fstat(file.fileno())
        if (status.st_size, status.st_mtime_ns) != self._stamp:
            file.close()
            raise FormatError(Diagnostic("F002.changed", self.path))
        return file

    def fault(self, key: str, problem: Phrase) -> FormatError:
        """Return an error that states the file and the key."""
        values = {"item": printable(key, 60), "problem": problem}
        return FormatError(Diagnostic("F002.archive-value", self.path, values=values))


def _reason(problem: Exception) -> object:
    return getattr(problem, "strerror", None) or problem
