"""Output file of a video encoder, which stores write errors and hides them from FFmpeg.

libavformat does not survive every failed write: if the header could not be written, the next packet
makes PyAV write it again, and ``avformat_init_output`` reads freed memory. So writes always succeed
for the library, and the owner of the file checks for an error after each step.
"""

from __future__ import annotations

import contextlib
import io
from pathlib import Path
from typing import BinaryIO

__all__ = ["VideoFile"]


class VideoFile:
    """A seekable file object for PyAV that drops everything after the first error.

    Parameters
    ----------
    path : Path
        Existing file.

    Attributes
    ----------
    name : str
        Path of the file, an attribute that PyAV requires.
    problem : OSError or None
        First error.
    closed : bool
        Whether it is closed; PyAV then writes no trailer.

    Raises
    ------
    OSError
        If the file cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self.name, self.problem, self.closed = str(path), None, False
        self._path = path
        self._file: io.RawIOBase = path.open("r+b", buffering=0)
        self._place = self._size = 0

    problem: OSError | None

    def write(self, data: bytes) -> int:
        """Write all bytes, or drop them after an error; success is reported either way."""
        if self.problem is None and not self.closed:
            try:
                self._write_all(data)
            except OSError as problem:
                self.problem = problem
        self._place += len(data)
        self._size = max(self._size, self._place)
        return len(data)

    def _write_all(self, data: bytes) -> None:
        self._file.seek(self._place)
        rest = memoryview(data)
        while rest:
            # A nearly full disk accepts a part of the bytes, and only the next call fails.
            rest = rest[self._file.write(rest) or 0 :]

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Change the position, as ``io.IOBase.seek``; takes effect at the next write."""
        base = {io.SEEK_SET: 0, io.SEEK_CUR: self._place, io.SEEK_END: self._size}[whence]
        self._place = base + offset
        return self._place

    def tell(self) -> int:
        """Return the position of the next write."""
        return self._place

    def reopen(self, url: str, flags: int, options: dict[str, str]) -> BinaryIO:
        """Open the same file for reading, which FFmpeg does to move MP4's index to the front."""
        return self._path.open("rb")

    def finish(self) -> None:
        """Close the file.

        Raises
        ------
        OSError
            The first error, possibly from closing the file.
        """
        self.closed = True
        try:
            self._file.close()
        except OSError as problem:
            self.problem = self.problem or problem
        if self.problem is not None:
            raise self.problem

    def drop(self) -> None:
        """Close the file of a discarded video."""
        self.closed = True
        with contextlib.suppress(OSError):
            self._file.close()
