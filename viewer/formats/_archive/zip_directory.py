"""Zip archives: their directory, checked before anything is unpacked."""

from __future__ import annotations

import struct
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from viewer.data_classes import dataclass
from viewer.formats._archive.stored_file import StoredFile
from viewer.formats._source import Source
from viewer.phrases import printable

__all__ = ["DAMAGE", "MAX_RATIO", "SMALL", "ZipDirectory", "open_directory"]

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

_ENCRYPTED = 0x41  # flag bits 0 and 6
_METHODS = {12: "bzip2", 14: "LZMA", 93: "Zstandard"}


@dataclass(frozen=True, slots=True)
class ZipDirectory:
    """A zip archive that is open for reading.

    Attributes
    ----------
    source : Source
        The archive, for messages.
    storage : StoredFile
        Its file, which is opened again whenever a member is read later.
    archive : ZipFile
        The open archive.
    members : list of ZipInfo
        Its members, whose sizes have been checked by ``check``.
    """

    source: Source
    storage: StoredFile
    archive: zipfile.ZipFile
    members: list[zipfile.ZipInfo]

    def check(self, key_of: Callable[[zipfile.ZipInfo], str]) -> None:
        """Refuse unreadable or oversized members before anything is unpacked.

        Raises
        ------
        FormatError
            If two members have the same key, or one is encrypted, packed by an unsupported method,
            or too large.
        """
        source, size = self.source, self.storage.size
        for name, count in Counter(map(key_of, self.members)).items():
            if count > 1:
                raise source.fault("F002.npz-twice", item=printable(name, 60), found=count)
        for member in self.members:
            name, method = printable(key_of(member), 60), member.compress_type
            if member.flag_bits & _ENCRYPTED:
                raise source.fault("F002.npz-encrypted", item=name)
            if method in _METHODS:
                raise source.fault("F002.npz-method-name", item=name, method=_METHODS[method])
            if method not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise source.fault("F002.npz-method", item=name, method=method)
        total = sum(member.file_size for member in self.members)
        if total > source.max_size:
            raise source.fault("F001.too-large", most=source.max_size, size=total)
        if total > max(SMALL, MAX_RATIO * size):
            raise source.fault("F002.npz-ratio", most=MAX_RATIO, found=total, size=size)


@contextmanager
def open_directory(source: Source) -> Iterator[ZipDirectory]:
    """Open a zip archive; damage found while it is open is an error of the source.

    Raises
    ------
    FormatError
        If the archive is damaged.
    """
    storage = StoredFile(source)
    try:
        with storage.open() as file, zipfile.ZipFile(file) as archive:
            yield ZipDirectory(source, storage, archive, archive.infolist())
    except DAMAGE as problem:
        raise source.fault("F002.npz", reason=printable(problem, 100)) from None
