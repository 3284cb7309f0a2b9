"""File reading: size limits, file types, and errors about unreadable files."""

from __future__ import annotations

import os
import stat
from itertools import islice
from pathlib import Path

from viewer.diagnostics import Diagnostic, wording
from viewer.errors import FormatError
from viewer.interrupts import raising
from viewer.phrases import Remedy, optional

MAX_SIZE = 2 << 30
"""Default size limit for files, bytes."""

FOLDER = "a folder"
"""Name of a folder in the result of ``kind_of``."""

# Maximum number of names in a folder that are compared with the name of a missing file.
_MOST_FILES = 2000
_ALIKE = 0.8  # minimum similarity; high, because many file names share a suffix and more
_MOST_LINKS = 8  # links to a descriptor: /dev/stdin has one, and users may add some
_DESCRIPTORS = ("/dev/fd", "/proc/self/fd")
_PIECE = 1 << 20  # bytes read from a pipe at once
_KINDS = {
    stat.S_IFDIR: FOLDER,
    stat.S_IFIFO: "a pipe",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
}


def read_bytes(path: Path, max_size: int = MAX_SIZE) -> bytes:
    """Read a whole regular file; if it has more than ``max_size`` bytes, it is refused unread."""
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
        values = {
            "most": max_size,
            "size": status.st_size,
            "remedy": Remedy("", " (see --max-size)"),
        }
        raise FormatError(Diagnostic(wording.TOO_LARGE, path, values=values))
    return None


def read_pipe(path: Path, max_size: int) -> bytes | None:
    """Return what a pipe that this process was given delivers; None for any other file."""
    # A pipe is an open descriptor: /dev/stdin, or /dev/fd/63 of <(…) in a shell. It can be read
    # once only, so its bytes are kept for all readers. Other pipes in the file system are not read:
    # without a writer, opening one waits forever.
    number = _descriptor(path)
    try:
        status = None if number is None else os.fstat(number)
    except OSError:
        status = None
    if number is None or status is None or not stat.S_ISFIFO(status.st_mode):
        return None
    key = status.st_dev, status.st_ino
    if key not in _piped:
        parts, size = [], 0
        try:
            with raising():
                while part := os.read(number, _PIECE):
                    parts.append(part)
                    size += len(part)
                    if size > max_size:
                        values = {"most": max_size, "remedy": Remedy("", " (see --max-size)")}
                        raise FormatError(
                            Diagnostic(
                                "F001.pipe-too-large: expected at most {most:,.0f} bytes, found "
                                "more{remedy}",
                                path,
                                values=values,
                            )
                        )
        except OSError as problem:
            raise _unreadable(path, problem) from None
        _piped[key] = b"".join(parts)
    return _piped[key]


_piped: dict[tuple[int, int], bytes] = {}


def _descriptor(path: Path) -> int | None:
    """Return the descriptor of this process that a path stands for, following links."""
    here = Path(os.path.abspath(path))  # noqa: PTH100 (links are followed one by one)
    for _ in range(_MOST_LINKS):
        if str(here.parent) in _DESCRIPTORS and here.name.isdigit():
            return int(here.name)
        try:
            here = here.parent / here.readlink()
        except (OSError, ValueError):
            return None
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
        Diagnostic(
            "F001.unreadable: cannot be read: {reason}{near}",
            path,
            values={"reason": str(reason), "near": optional("; {}", near)},
        )
    )


def no_file(path: Path, kind: str) -> FormatError:
    return FormatError(
        Diagnostic("F001.no-file: expected a file, found {found}", path, values={"found": kind})
    )


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
