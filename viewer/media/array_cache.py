"""Persistent cache of arrays parsed from text or decoded from images, in the user's cache folder.

An entry contains its source bytes, and is used only if they equal the bytes at hand, so it is never
stale. Its name is their checksum, so processes need no coordination. An entry that is damaged,
foreign or from another version is replaced; without a readable and writable folder, nothing is
cached.

::

    entry   header (56 bytes) · bytes that were read · array, little-endian
    header  version · checksum of array and axes · length of the bytes · item type · axes (up to 3)
"""

from __future__ import annotations

import contextlib
import io
import math
import os
import stat
import struct
import sys
import threading
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.version import VERSION

VARIABLE = "VIEWER_CACHE"
"""Environment variable: a folder for the cache, or ``off``."""

LIMIT = 1 << 29
"""Maximum size of all entries in bytes; beyond it, the least recently used ones are removed."""

_OFF = ("off", "0", "no", "none")
_LEAST = 1 << 15  # minimum bytes: parsing shorter text is faster than opening an entry
_LARGEST = 1 << 25  # maximum bytes of an entry; larger ones would evict all others
_SUFFIX = ".array"
_HEADER = struct.Struct("<16sIQ4s3Q")
_BINARY = getattr(os, "O_BINARY", 0)
# A link could lead to a device or to another user's file; opening a pipe would block forever.
_READING = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | _BINARY
_MAGIC = f"viewer {zlib.crc32(VERSION.encode()):08x}".encode().ljust(16, b"\0")
_is_off = False


def cache_folder() -> Path | None:
    """Return the folder of the cache, which need not exist; None if it is switched off."""
    asked = os.environ.get(VARIABLE, "")
    if _is_off or asked.lower() in _OFF:
        return None
    if asked:
        return Path(os.path.abspath(os.path.expanduser(asked)))  # noqa: PTH100, PTH111
    if sys.platform.startswith("linux"):
        # As in platformdirs, whose import takes longer than reading a small entry.
        base = os.environ.get("XDG_CACHE_HOME", "").strip()
        home = base if os.path.isabs(base) else os.path.expanduser("~/.cache")  # noqa: PTH111, PTH117
        return Path(home) / "viewer" / "arrays"
    import platformdirs

    return Path(platformdirs.user_cache_dir("viewer", appauthor=False)) / "arrays"


@contextlib.contextmanager
def without_cache() -> Iterator[None]:
    """Disable the cache within the block, in all threads."""
    global _is_off
    before, _is_off = _is_off, True
    try:
        yield
    finally:
        _is_off = before


def cache_use() -> tuple[int, int]:
    """Return the number of entries, and their size in bytes."""
    folder = cache_folder()
    entries = [] if folder is None else _entries(folder)
    return len(entries), sum(size for _, size, _ in entries)


def slot_of(kind: str, data: bytes, start: int, end: int) -> Slot | None:
    """Return where the cache keeps an array; None if caching is not worthwhile or disabled."""
    # The kind of result is part of the file name, and must change whenever the conversion changes.
    if not _LEAST <= end - start <= _LARGEST // 2:
        return None
    folder = cache_folder()
    if folder is None:
        return None
    return Slot(folder, kind, bytes(data[start:end]))


class Slot:
    """Location of one array in the cache; ``content`` is the bytes that it is computed from."""

    __slots__ = ("_content", "path")

    def __init__(self, folder: Path, kind: str, content: bytes) -> None:
        self._content = content
        self.path = folder / f"{zlib.crc32(content):08x}-{len(content):x}-{kind}{_SUFFIX}"

    def load(self, kind: str, n_axes: int) -> NDArray[Any] | None:
        """Return the array of "<f8" or "|u1" items, writable; None if there is no valid entry."""
        try:
            number = os.open(self.path, _READING)
            with open(number, "rb", buffering=0) as stream:  # noqa: PTH123
                status = os.fstat(number)
                if not _is_own(status):
                    return None
                values = self._read(stream, status.st_size, kind, n_axes)
        except OSError:
            return None
        if values is not None:
            with contextlib.suppress(OSError):  # the folder is not writable
                os.utime(self.path)
        return values

    def _read(self, stream: io.FileIO, size: int, kind: str, n_axes: int) -> NDArray[Any] | None:
        """Return the array of an open entry, after verifying every byte."""
        header = stream.read(_HEADER.size)
        if len(header) < _HEADER.size:
            return None
        magic, checksum, length, found, *axes = _HEADER.unpack(header)
        if (magic, length, found) != (_MAGIC, len(self._content), _code(kind, n_axes)):
            return None
        if any(axes[n_axes:]) or max(axes) > size:
            return None
        shape, dtype = axes[:n_axes], np.dtype(kind)
        if _HEADER.size + length + math.prod(shape) * dtype.itemsize != size or size > _LARGEST:
            return None
        if stream.read(length) != self._content:
            return None
        values = np.empty(shape, dtype)
        flat = values.reshape(-1).view(np.uint8).data
        if stream.readinto(flat) != len(flat) or _checksum(flat, axes) != checksum:
            return None
        return values

    def store(self, values: NDArray[np.generic]) -> None:
        """Store float64 or uint8, at most three axes; failures are ignored: a cache is optional."""
        values = np.ascontiguousarray(values)
        total = _HEADER.size + len(self._content) + values.nbytes
        if total > _LARGEST:
            return
        flat = values.reshape(-1).view(np.uint8).data
        code = _code(values.dtype.str, values.ndim)
        axes = (*values.shape, 0, 0, 0)[:3]
        header = _HEADER.pack(_MAGIC, _checksum(flat, axes), len(self._content), code, *axes)
        mark = f"{os.getpid()}-{threading.get_ident()}"
        temporary = self.path.with_name(f".{self.path.name}.{mark}")
        try:
            self.path.parent.parent.mkdir(parents=True, exist_ok=True)
            with contextlib.suppress(FileExistsError):
                self.path.parent.mkdir(mode=0o700)
            flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | _BINARY
            with open(os.open(temporary, flags, 0o600), "wb") as stream:  # noqa: PTH123
                stream.writelines((header, self._content, flat))
            temporary.replace(self.path)
        except OSError:
            _remove(temporary)
            return
        except BaseException:  # including Ctrl-C
            _remove(temporary)
            raise
        # Listing the folder for each entry would slow down reading thousands of files.
        if zlib.crc32(header) % 16 == 0 or total > LIMIT // 64:
            _limit_size(self.path.parent)


def _checksum(data: memoryview, axes: Sequence[int]) -> int:
    """Return the checksum of an array and its axes, because arrays of other shapes may be equal."""
    return zlib.crc32(data, zlib.crc32(struct.pack("<3Q", *axes)))


def _code(kind: str, n_axes: int) -> bytes:
    """Return type and number of axes as encoded in a header."""
    return f"{kind}{n_axes}".encode()


def _is_own(status: os.stat_result) -> bool:
    """Return whether an entry is a regular file of this user that nobody else may write to."""
    if not stat.S_ISREG(status.st_mode):
        return False
    own = getattr(os, "getuid", None)
    return own is None or (status.st_uid == own() and not status.st_mode & 0o022)


def _entries(folder: Path) -> list[tuple[float, int, Path]]:
    """Return time of last use, size and path of each entry and of files left by crashes."""
    found = []
    with contextlib.suppress(OSError), os.scandir(folder) as listing:
        for entry in listing:
            with contextlib.suppress(OSError):
                if _SUFFIX in entry.name and entry.is_file(follow_symlinks=False):
                    status = entry.stat(follow_symlinks=False)
                    found.append((status.st_mtime, status.st_size, Path(entry.path)))
    return found


def _limit_size(folder: Path) -> None:
    """Remove the least recently used entries until the size is three quarters of the limit."""
    entries = sorted(_entries(folder))
    total = sum(size for _, size, _ in entries)
    if total <= LIMIT:
        return
    for _, size, path in entries:
        if total <= 0.75 * LIMIT:
            return
        _remove(path)
        total -= size


def _remove(path: Path) -> None:
    with contextlib.suppress(OSError):
        path.unlink()
