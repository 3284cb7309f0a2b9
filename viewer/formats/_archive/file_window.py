"""Bytes of a large file, read in pages when they are first needed."""

from __future__ import annotations

from typing import overload

from viewer.diagnostics import Phrase
from viewer.formats._archive.stored_file import StoredFile

__all__ = ["Data", "FileWindow"]

_PAGE = 1 << 16  # number of bytes read at a time for small values
_PIECE = 1 << 20  # number of bytes read at a time for arrays


class FileWindow:
    """A file with the interface of bytes that the pickle machine uses.

    Parameters
    ----------
    storage : StoredFile
        The file; a change between two reads is reported as an error.
    """

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
                    raise self._storage.fault("", Phrase("npy-cut", expected=stop, found=start))
                pieces.append(piece)
                start += len(piece)
        return b"".join(pieces)


Data = bytes | FileWindow
"""The bytes of a pickle."""
