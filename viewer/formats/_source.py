"""A file that is being read: its bytes, its warnings, and line numbers when an error needs one."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from viewer.errors import FormatError, printable
from viewer.formats._faults import Fault, Part
from viewer.formats._numbers import LARGEST, is_too_large, word_begins
from viewer.near_names import did_you_mean
from viewer.rig.arrays import Ints

if TYPE_CHECKING:
    from viewer.formats._archive import Archive

__all__ = ["MAX_SIZE", "Source", "no_number", "read_bytes", "shown"]

MAX_SIZE = 2 << 30
"""Largest file that is read, in bytes, unless the caller says otherwise."""

_MAX_WARNINGS = 100  # a file that earns more is no figure; nobody reads on
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_CONTROL_Z = b"\x1a"  # ends a text file written under CP/M or DOS
_ANY_END = (b"ply\n", b"ply\r")  # numbers follow, whose last byte may be any
_WORD = re.compile(rb"[{}]|[^{} \t\n\r\v\f]+")
_CARRIAGE_RETURNS = re.compile(rb"\r+\n?")
_MAGIC = (
    (b"\x1f\x8b", "gzip data"),
    (b"\x7fELF", "a program (ELF)"),
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"BM", "a BMP picture"),
    (b"GIF8", "a GIF picture"),
    (b"PK\x03\x04", "a ZIP archive"),
    (b"%PDF", "a PDF document"),
    (b"glTF", "a binary glTF file"),
    (b"\xff\xfe", "UTF-16 text"),
    (b"\xfe\xff", "UTF-16 text"),
    (b"\x93NUMPY", "a numpy array"),
)
_MOST_FILES = 2000  # of a folder that are compared with the name of a missing one
_ALIKE = 0.8  # names of files share their suffixes, and often more
_LOOK = 4096  # bytes that show what a file is
_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
}


def read_bytes(path: Path, max_size: int = MAX_SIZE) -> bytes:
    """Read a regular file whole.

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
    kind = _check(path, max_size)
    if kind is not None:
        raise FormatError(path, f"expected a file, found {kind}")
    return _read(path)


def _check(path: Path, max_size: int) -> str | None:
    """Look before opening, as a pipe would block: return what it is, None for a file."""
    try:
        status = path.stat()
    except (OSError, ValueError) as problem:
        raise _unreadable(path, problem) from None
    if not stat.S_ISREG(status.st_mode):
        return _KINDS.get(stat.S_IFMT(status.st_mode), "something else")
    if status.st_size > max_size:
        raise FormatError(
            path, f"expected at most {max_size} bytes, found {status.st_size} (--max-size)"
        )
    return None


def _read(path: Path, size: int = -1) -> bytes:
    try:
        with path.open("rb") as stream:
            return stream.read(size)
    except (OSError, ValueError) as problem:
        raise _unreadable(path, problem) from None


def _unreadable(path: Path, problem: Exception) -> FormatError:
    reason = getattr(problem, "strerror", None) or problem
    near = _near_files(path) if isinstance(problem, FileNotFoundError) else ""
    return FormatError(path, f"cannot be read: {reason}{near}")


def _near_files(path: Path) -> str:
    """Return a question that offers files with a similar name, "" if there are none."""
    try:
        with os.scandir(path.parent) as entries:
            names = [entry.name for entry in islice(entries, _MOST_FILES)]
    except OSError:  # the folder is missing too, or may not be listed
        return ""
    # A link that leads nowhere has this name itself.
    near = did_you_mean(path.name, [name for name in names if name != path.name], _ALIKE)
    return f"; {near}" if near else ""


class Source:
    """One file, or folder of files, with the warnings that its reader adds.

    Attributes
    ----------
    path : Path
        Where the bytes come from; texture names are relative to its folder.
    is_folder : bool
        Whether it is a folder: then there are no bytes.
    max_size : int
        Largest size of a file, in bytes, also of those inside a folder or archive.
    warnings : list of str
        One line each, none twice.
    also_read : list of Path
        Other files that its reader was led to: pictures, material libraries.
    faults : list of Fault or None
        None where the first fault ends the reading; a list takes in all that can be gone on from.
    """

    def __init__(
        self, path: str | Path, data: bytes | None = None, max_size: int = MAX_SIZE
    ) -> None:
        self.path = Path(path)
        self.is_folder = False
        self.max_size = max_size
        self.warnings: list[str] = []
        self.also_read: list[Path] = []
        self.faults: list[Fault] | None = None
        self.archive: Archive | None = None  # opened once, by whoever asks first
        self._data = None if data is None else _without_marks(data)
        self._warned: set[str] = set()
        self._counted = (0, 1)  # an offset whose line is known, and that line
        self._offsets: dict[str, tuple[Source, Callable[[int], int]]] = {}

    @classmethod
    def open(cls, path: str | Path, max_size: int = MAX_SIZE) -> Source:
        """Look at a file or folder; see ``read_bytes`` for what it raises."""
        source = cls(path, max_size=max_size)
        kind = _check(source.path, max_size)
        source.is_folder = kind == _KINDS[stat.S_IFDIR]
        if kind is not None and not source.is_folder:
            raise FormatError(source.path, f"expected a file, found {kind}")
        return source

    @property
    def data(self) -> bytes:
        """The whole file, without a UTF-8 byte order mark and a closing Ctrl-Z; read once."""
        if self._data is None:
            self._data = _without_marks(read_bytes(self.path, self.max_size))
        return self._data

    def peek(self, size: int) -> bytes:
        """Return the first bytes, without reading the others if nobody has."""
        return _read(self.path, size) if self._data is None else self._data[:size]

    def inside(self, name: str) -> Source:
        """Return a file of this folder; its warnings are this source's own."""
        return self._related(self.path / name)

    def beside(self, name: str) -> Source:
        """Return a file next to this one; its warnings are this source's own."""
        return self._related(self.path.parent / name)

    def _related(self, path: Path) -> Source:
        source = Source(path, max_size=self.max_size)
        source.warnings, source._warned = self.warnings, self._warned
        source.also_read = self.also_read
        self.also_read.append(path)
        source.faults, source._offsets = self.faults, self._offsets
        return source

    def words(self, start: int = 0, end: int | None = None) -> Iterator[re.Match[bytes]]:
        """Yield words and braces, braces always on their own, with their offsets."""
        return _WORD.finditer(self.data, start, len(self.data) if end is None else end)

    def next_word(self, start: int) -> re.Match[bytes] | None:
        """Return the first word at or after an offset, or None at the end of the file."""
        return _WORD.search(self.data, start)

    def number_offset(self, start: int, end: int, index: int) -> int:
        """Return the offset of the index-th word of a part without braces; for errors only."""
        letters = np.frombuffer(self.data, dtype=np.uint8, count=end - start, offset=start)
        return start + int(word_begins(letters)[index])

    def word_offset(self, start: int, index: int) -> int:
        """Return the offset of the index-th word after ``start``; slow, for errors only."""
        for number, word in enumerate(self.words(start)):
            if number == index:
                return word.start()
        return len(self.data)

    def line(self, offset: int) -> int:
        """Return the line of an offset, counted from 1; looked for only when it is needed.

        CR CR LF, seen in real files, is one line end; so is a CR alone.
        """
        start, line = self._counted
        if offset < start:
            start, line = 0, 1
        line += self.data.count(b"\n", start, offset)
        lone = self.data.count(b"\r", start, offset) - self.data.count(b"\r\n", start, offset)
        if lone:
            runs = (run.group() for run in _CARRIAGE_RETURNS.finditer(self.data, start, offset))
            line += sum(len(run) for run in runs if not run.endswith(b"\n"))
        self._counted = offset, line
        return line

    @property
    def end(self) -> int:
        """Offset behind the last word: where a file lacks something."""
        return len(self.data.rstrip())

    def error(self, message: str, offset: int | None = None) -> FormatError:
        """Return an error that names the file, and the line of ``offset``."""
        return FormatError(self.path, message, None if offset is None else self.line(offset))

    def warn(self, message: str, offset: int | None = None) -> None:
        """Add a warning that names the file, and the line of ``offset``; each text only once."""
        if message in self._warned or len(self._warned) > _MAX_WARNINGS:
            return
        self._warned.add(message)
        if len(self._warned) > _MAX_WARNINGS:
            message, offset = "further warnings are left out", None
        self.warnings.append(str(self.error(message, offset)))

    def refuse(
        self, error: FormatError, count: int = 1, part: Part = "", places: ArrayLike = ()
    ) -> None:
        """Raise an error; where all faults are wanted, note it, so that the reader goes on.

        Parameters
        ----------
        error : FormatError
            The first of its kind.
        count : int
            How many there are.
        part, places : str, (N,)
            What the reader replaces by something neutral, see ``Fault``.
        """
        if self.faults is None:
            raise error
        self.faults.append(Fault(error, count, part, _indices(places)))

    def remember(self, kind: str, offset_of: Callable[[int], int]) -> None:
        """Keep how to find the offset of the index-th thing of a kind, for whoever asks.

        Parameters
        ----------
        kind : str
            ``"positions"``, ``"normals"``, ``"weights"``, ``"triangles"``, ``"bindings"``,
            ``"joints"``, ``"channels"`` or ``"frames"``.
        offset_of : callable
            Called only when somebody asks; may be slow.
        """
        self._offsets[kind] = self, offset_of

    def offset_of(self, kind: str, index: int) -> int:
        """Return the offset of a thing that the reader remembers; slow, for errors only."""
        return self._offsets[kind][1](index)

    def place(self, kind: str, index: int) -> tuple[Path, int] | None:
        """Return the file and line of a thing; None if the reader does not remember such."""
        if kind not in self._offsets:
            return None
        source, offset_of = self._offsets[kind]
        return source.path, source.line(offset_of(index))

    def head(self, size: int) -> bytes:
        """Return up to ``size`` bytes from the first word on."""
        first = self.next_word(0)
        return b"" if first is None else self.data[first.start() : first.start() + size]

    def looks_like(self) -> str | None:
        """Return what the bytes look like if they are no text of ours, e.g. ``"gzip data"``."""
        head = self.head(_LOOK)
        if not head:
            return "only white space" if self.data else "an empty file"
        for magic, kind in _MAGIC:
            if self.data.startswith(magic):
                return kind
        if re.match(rb"<(!doctype|html|\?xml)", head, re.IGNORECASE):
            return "HTML or XML (a failed download?)"
        if not head.strip(b"\0"):
            return "zeros"
        if not self.data[1:_LOOK:2].strip(b"\0") or not self.data[:_LOOK:2].strip(b"\0"):
            return "UTF-16 text"
        return "binary data" if head.count(0) * 3 > len(head) else None


def _indices(places: ArrayLike) -> Ints:
    """Return indices once each, rising: (N,) int32."""
    return np.unique(np.asarray(places, dtype=np.int32))


def _without_marks(data: bytes) -> bytes:
    if data.startswith(_ANY_END):
        return data
    return data.removeprefix(_BYTE_ORDER_MARK).rstrip(_CONTROL_Z)


def shown(word: bytes) -> str:
    r"""Return a word of a file in quotes, on one line and not too long.

    >>> shown(b"up\x00")
    '"up\\x00"'
    """
    return f'"{printable(word[:200].decode("utf-8", "replace"), 40)}"'


def no_number(word: bytes | None) -> str:
    """Return what was expected and found where a number should be, None for the end of the file.

    >>> no_number(b"up"), no_number(b"1e300")
    ('expected a number, found "up"', 'expected a number below 3.4e+38, found "1e300"')
    """
    if word is None:
        return "expected a number, found the end of the file"
    # What is too large is written as a number is: it says what is wrong with it.
    below = f" below {LARGEST:.1e}" if is_too_large(word) else ""
    return f"expected a number{below}, found {shown(word)}"
