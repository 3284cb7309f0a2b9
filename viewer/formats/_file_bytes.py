"""File reading: size limits, file types, and errors about unreadable files."""

from __future__ import annotations

import os
import stat
from itertools import islice
from pathlib import Path

from viewer.diagnostics import Diagnostic
from viewer.errors import FormatError

__all__ = [
    "FOLDER",
    "MAX_SIZE",
    "kind_of",
    "no_file",
    "read_bytes",
    "read_head",
    "read_part",
    "unreadable",
]

MAX_SIZE = 2 << 30
"""Default size limit for files, bytes."""

FOLDER = "a folder"
"""Name of a folder in the result of ``kind_of``."""

# Maximum number of names in a folder that are compared with the name of a missing file.
_MOST_FILES = 2000
_ALIKE = 0.8  # minimum similarity; high, because many file names share a suffix and more
_KINDS = {
    stat.S_IFDIR: FOLDER,
    stat.S_IFIFO: "a pipe",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
}


def read_bytes(path: Path, max_size: int = MAX_SIZE) -> bytes:
    """Read a whole regular file.

    Parameters
    ----------
    path : Path
        The file.
    max_size : int
        Larger files, in bytes, are refused before they are read.

    Raises
    ------
    FormatError
        If the file is missing, unreadable, not a regular file, or too large.
    """
    kind = kind_of(path, max_size)
    if kind is not None:
        raise no_file(path, kind)
    return read_head(path)


def kind_of(path: Path, max_size: int) -> str | None:
    """Return the kind of file at a path without opening it; None for a regular file."""
    try:
        status = path.stat()
    except (OSError, ValueError) as problem:
        raise _unreadable(path, problem) from None
    if not stat.S_ISREG(status.st_mode):
        return _KINDS.get(stat.S_IFMT(status.st_mode), "an unknown kind of file")
    if status.st_size > max_size:
        values = {"most": max_size, "size": status.st_size}
        raise FormatError(Diagnostic("F001.too-large", path, values=values))
    return None


def read_head(path: Path, size: int = -1) -> bytes:
    return read_part(path, 0, size)


def read_part(path: Path, start: int, size: int) -> bytes:
    """Return the bytes from an offset; a size of -1 means all."""
    try:
        with path.open("rb") as stream:
            stream.seek(start)
            return stream.read(size)
    except (OSError, ValueError) as problem:
        raise _unreadable(path, problem) from None


def _unreadable(path: Path, problem: Exception) -> FormatError:
    reason = getattr(problem, "strerror", None) or problem
    near = _near_files(path) if isinstance(problem, FileNotFoundError) else ""
    return unreadable(path, reason, near)


def unreadable(path: Path, reason: object, near: str = "") -> FormatError:
    """Return the error for a file that cannot be read."""
    return FormatError(
        Diagnostic("F001.unreadable", path, values={"reason": str(reason), "near": near})
    )


def no_file(path: Path, kind: str) -> FormatError:
    return FormatError(Diagnostic("F001.no-file", path, values={"found": kind}))


def _near_files(path: Path) -> str:
    """Return a question that suggests files with similar names; empty if there are none."""
    try:
        with os.scandir(path.parent) as entries:
            names = [entry.name for entry in islice(entries, _MOST_FILES)]
    except OSError:  # the folder is missing too, or cannot be listed
        return ""
    from viewer.near_names import did_you_mean

    # A dangling link has exactly the missing name.
    return did_you_mean(path.name, [name for name in names if name != path.name], _ALIKE)
