"""Untrusted zip archives: names and sizes are checked before anything is unpacked."""

from __future__ import annotations

import errno
import re
import shutil
import stat
import zipfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase
from viewer.errors import FormatError
from viewer.formats import Source
from viewer.formats._archive.stored_file import StoredFile
from viewer.formats._archive.zip_directory import DAMAGE, MAX_RATIO, SMALL
from viewer.phrases import printable

__all__ = ["MOST_BYTES", "MOST_FILES", "Archive", "open_archive"]

MOST_BYTES = 2 << 30
"""Maximum number of bytes unpacked from one archive."""

MOST_FILES = 5_000
"""Maximum number of files unpacked from one archive."""

_ENCRYPTED = 0x41  # bits 0 and 6 of the flags
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EMFILE, errno.ENFILE)
_DAMAGE = (*DAMAGE, NotImplementedError)
_QUOTED = re.compile(r"""'.*'|".*\"""", re.DOTALL)  # names in messages
# Parts of the messages of zipfile and zlib, and what they mean.
_REASONS = {
    "not a zip file": "zip-end",
    "truncated": "zip-short",
    "crc": "zip-checksum",
    "magic number": "zip-header",
    "differ": "zip-header",
    "overlap": "zip-overlap",
}


@dataclass(frozen=True, slots=True)
class Archive:
    """An open zip archive.

    Attributes
    ----------
    shown : Path
        Path for messages; that of a nested archive begins with that of the outer one.
    size : int
        Size of its file in bytes.
    archive : ZipFile
        The archive.
    members : dict of str to ZipInfo
        Files by path with slashes, without folders.
    """

    shown: Path
    size: int
    archive: zipfile.ZipFile
    members: dict[str, zipfile.ZipInfo]

    def unpack(self, names: Iterable[str], folder: Path) -> int:
        """Write members to an empty folder; return their total size in bytes.

        Raises
        ------
        FormatError
            If one of them is a link, encrypted or damaged, or they are too large.
        """
        members = {name: self.members[name] for name in names}
        self._check(members)
        try:
            for name, member in members.items():
                target = folder.joinpath(*name.split("/"))
                target.parent.mkdir(parents=True, exist_ok=True)
                with self.archive.open(member) as packed, target.open("xb") as file:
                    shutil.copyfileobj(packed, file, 1 << 20)
        except _DAMAGE as problem:
            if _is_full(problem):
                raise
            raise self._fault("F002.submission-zip", reason=_reason(problem)) from None
        return sum(member.file_size for member in members.values())

    def _check(self, members: dict[str, zipfile.ZipInfo]) -> None:
        for name, member in members.items():
            item = printable(name, 80)
            if member.flag_bits & _ENCRYPTED:
                raise self._fault("F002.submission-encrypted", item=item)
            if stat.S_ISLNK(member.external_attr >> 16):
                raise self._fault("F002.submission-link", item=item)
            if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                method = member.compress_type
                raise self._fault("F002.submission-method", item=item, method=method)
        # zipfile never returns more bytes of a member than the central directory states.
        total = sum(member.file_size for member in members.values())
        if len(members) > MOST_FILES:
            raise self._fault("F001.submission-count", most=MOST_FILES, found=len(members))
        if total > MOST_BYTES:
            raise self._fault("F001.submission-size", most=MOST_BYTES, found=total)
        if total > max(SMALL, MAX_RATIO * self.size):
            raise self._fault("F002.submission-ratio", most=MAX_RATIO, found=total, size=self.size)

    def _fault(self, key: str, **values: Any) -> FormatError:
        return FormatError(Diagnostic(key, self.shown, values=values))


@contextmanager
def open_archive(path: Path, shown: Path, is_junk: Callable[[str], bool]) -> Iterator[Archive]:
    """Open a zip archive whose paths all stay inside it.

    Parameters
    ----------
    path, shown : Path
        The file, and its path in messages.
    is_junk : function
        Whether a path is ignored.

    Raises
    ------
    FormatError
        If it is damaged, a path leads outside, or two files have the same path.
    """
    try:
        storage = StoredFile(Source(path))
        with storage.open() as file, zipfile.ZipFile(file) as archive:
            infos = [info for info in archive.infolist() if not info.is_dir()]
            pairs = [(_path_of(info, shown), info) for info in infos]
            pairs = [(name, info) for name, info in pairs if not is_junk(name)]
            for name, count in Counter(name for name, _ in pairs).items():
                if count > 1:
                    values = {"item": printable(name, 80), "found": count}
                    raise FormatError(Diagnostic("F002.submission-twice", shown, values=values))
            yield Archive(shown, storage.size, archive, dict(pairs))
    except _DAMAGE as problem:
        if _is_full(problem):
            raise
        values = {"reason": _reason(problem)}
        raise FormatError(Diagnostic("F002.submission-zip", shown, values=values)) from None


def _path_of(info: zipfile.ZipInfo, shown: Path) -> str:
    """Return a member's path; some Windows programs write backslashes.

    Raises FormatError if it leads outside the archive.
    """
    parts = PurePosixPath(info.filename.replace("\\", "/")).parts
    windows = PureWindowsPath(info.filename)
    if not parts or parts[0] == "/" or ".." in parts or windows.drive or windows.root:
        values = {"item": printable(info.filename, 80)}
        raise FormatError(Diagnostic("F002.submission-outside", shown, values=values))
    return "/".join(parts)


def _is_full(problem: Exception) -> bool:
    """Return whether an error was caused by the disk instead of the archive."""
    return isinstance(problem, OSError) and problem.errno in _FULL


def _reason(problem: Exception) -> str | Phrase:
    """Return what is wrong with an archive, without the terms of the library that reads it."""
    if isinstance(problem, OSError) and problem.strerror:
        return printable(problem.strerror, 100)
    if isinstance(problem, EOFError):  # it has no message
        return Phrase("zip-short")
    text = _QUOTED.sub("", str(problem)).lower()
    return Phrase(next((key for part, key in _REASONS.items() if part in text), "zip-data"))
