"""A file being read: its bytes and their limits, its diagnostics, and lines found on demand."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike

from viewer.diagnostics import Collector, Diagnostic, Part, Phrase, note, wording
from viewer.errors import FormatError, reason_of
from viewer.formats._text.numbers import word_begins
from viewer.interrupts import raising
from viewer.phrases import Remedy, optional, quoted
from viewer.progress import report_bytes

_Content = TypeVar("_Content")
_WORD = re.compile(rb"[{}]|[^{} \t\n\r\v\f]+")
_MAGIC = (
    (b"\x1f\x8b", "gzip data"),
    (b"\x7fELF", "a program (ELF)"),
    (b"\x89PNG", "a PNG image"),
    (b"\xff\xd8\xff", "a JPEG image"),
    (b"BM", "a BMP image"),
    (b"GIF8", "a GIF image"),
    (b"PK\x03\x04", "a ZIP archive"),
    (b"%PDF", "a PDF document"),
    (b"\xff\xfe", "UTF-16 text"),
    (b"\xfe\xff", "UTF-16 text"),
    (b"\x93NUMPY", "a numpy array"),
)
_LOOK = 4096  # number of bytes that identify a file
_LONG = 1 << 24  # bytes; reading shorter files as a whole takes little memory
_BLOCK = 1 << 20  # bytes per part in which line endings are counted
_MARKED = 8  # number of bytes with a mark at the start
_TAIL = 4096  # number of bytes of which each read at the end removes the marks
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_CONTROL_Z = b"\x1a"  # end-of-file character of CP/M and DOS

# Files with these first bytes are binary and may end with any byte.
_ANY_END = (b"ply\n", b"ply\r", b"glTF", b"\x80", b"x", b"\x1f\x8b", b"BZh", b"\xfd", b"\x5d\x00")
MAX_SIZE = 2 << 30
"""Default size limit for files, bytes."""
FOLDER = "a folder"
"""Name of a folder in the result of ``_kind_of``."""

# Maximum number of names in a folder that are compared with the name of a missing file.
_MOST_FILES = 2000
_ALIKE = 0.8  # minimum similarity; high, because many file names share a suffix and more
_HINTED = 100  # diagnostics after which keywords are no longer compared: few of them are shown
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


class Source:
    """One file, or folder of files, with the diagnostics that its reader records.

    ``is_folder``: whether it is a folder, which has no bytes. ``max_size``: largest size of a file
    in bytes, including those inside a folder or archive. ``options``: options that select among the
    contents of a file (``"rig"`` for Anny, ``"lod"``, the level of detail, for MHR) or replace what
    the file lacks (``"up"``, ``"unit"``). ``frame_faults``: the first error in frames of a motion
    that become gaps, see ``_frame_gaps.py``.
    """

    def __init__(
        self,
        path: str | Path,
        data: bytes | None = None,
        max_size: int = MAX_SIZE,
        diagnostics: Collector | None = None,
    ) -> None:
        self.path = Path(path)
        self.is_folder = False
        self.max_size = max_size
        self.diagnostics = Collector() if diagnostics is None else diagnostics
        self.also_read: list[Path] = []
        self.options: dict[str, str] = {}
        self.used_options: set[str] = set()
        self.frame_faults: list[Diagnostic] = []
        self._opened: dict[Callable[[Source], object], object] = {}
        self._data = None if data is None else without_marks(data)
        self._is_stored = data is None  # whether the data can be read again
        self._counted = (0, 1)  # an offset and its line number, where counting of lines continues
        self._offsets: dict[str, tuple[Source, Callable[[int], int]]] = {}

    @classmethod
    def open(
        cls, path: str | Path, max_size: int = MAX_SIZE, diagnostics: Collector | None = None
    ) -> Source:
        """Open a file, folder or pipe, see ``_read_pipe``; errors as in ``read_bytes``."""
        piped = _read_pipe(Path(path), max_size)
        source = cls(path, piped, max_size=max_size, diagnostics=diagnostics)
        if piped is not None:
            return source
        kind = _kind_of(source.path, max_size)
        source.is_folder = kind == FOLDER
        if kind is not None and not source.is_folder:
            raise _no_file(source.path, kind)
        return source

    @property
    def data(self) -> bytes:
        """The whole file, without a UTF-8 byte order mark and a final Ctrl-Z; read once."""
        if self._data is None:
            name = f"reading {self.path.name}"
            report_bytes(0, 0, name)
            self._data = without_marks(read_bytes(self.path, self.max_size))
            report_bytes(0, len(self._data), name)
        return self._data

    def line_parts(self, length: int, start: int = 0) -> Iterator[bytes]:
        """Yield the data in parts of whole lines, ``length`` bytes or more, and report progress."""
        text = self._text()
        total, done = len(text), start
        report_bytes(done, total, f"reading {self.path.name}")
        for part in line_parts(text, length, start):
            yield part
            done += len(part)
            report_bytes(done, total)

    def _text(self) -> bytes | LongText:
        """Return the data, which stays on disk if it is long and not in memory yet."""
        if self._data is None:
            found = LongText.open(self.path, self.max_size)
            if found is not None:
                return found
        return self.data

    def release(self) -> None:
        """Release the memory of the data, which is read again when an error needs its line."""
        if self._is_stored:
            self._data = None

    @property
    def is_piped(self) -> bool:
        """Whether there is no file from which the data could be read again."""
        return not self._is_stored

    def option(self, name: str) -> str:
        """Return an option that the reader considers; empty for the default."""
        self.used_options.add(name)
        return self.options.get(name, "")

    def peek(self, size: int) -> bytes:
        """Return the first bytes of the file; no more is read."""
        return _read_part(self.path, 0, size) if self._data is None else self._data[:size]

    def once(self, opened: Callable[[Source], _Content]) -> _Content:
        """Return the cached result of a function of this file, which is called on first use."""
        if opened not in self._opened:
            self._opened[opened] = opened(self)
        return cast("_Content", self._opened[opened])

    def inside(self, name: str) -> Source:
        """Return a file of this folder, which shares the diagnostics of this source."""
        return self._related(self.path / name)

    def beside(self, name: str) -> Source:
        """Return a file next to this one, which shares the diagnostics of this source."""
        return self._related(self.path.parent / name)

    def _related(self, path: Path) -> Source:
        source = Source(path, max_size=self.max_size, diagnostics=self.diagnostics)
        source.also_read = self.also_read
        source.frame_faults = self.frame_faults
        self.also_read.append(path)
        source._offsets = self._offsets
        return source

    def words(self, start: int = 0, end: int | None = None) -> Iterator[re.Match[bytes]]:
        """Yield words and braces as matches; a brace is always a separate word."""
        return _WORD.finditer(self.data, start, len(self.data) if end is None else end)

    def next_word(self, start: int) -> re.Match[bytes] | None:
        """Return the first word at or after an offset, or None at the end of the file."""
        return _WORD.search(self.data, start)

    def number_offset(self, start: int, end: int, index: int) -> int:
        """Return the offset of the index-th word in a part without braces; for errors only."""
        letters = np.frombuffer(self.data, dtype=np.uint8, count=end - start, offset=start)
        return start + int(word_begins(letters)[index])

    def word_offset(self, start: int, index: int) -> int:
        """Return the offset of the index-th word after ``start``; slow, for errors only."""
        for number, word in enumerate(self.words(start)):
            if number == index:
                return word.start()
        return len(self.data)

    def line(self, offset: int) -> int:
        """Return the line of an offset, counted from 1; slow, for errors only."""
        start, line = self._counted
        if offset < start:
            start, line = 0, 1
        line += count_line_ends(self._text(), start, offset)
        self._counted = offset, line
        return line

    @property
    def end(self) -> int:
        """Offset after the last word, at which missing items are reported."""
        return len(self.data.rstrip())

    def fault(self, key: str, offset: int | str | None = None, **values: object) -> FormatError:
        """Return the exception for an error after which the reader cannot continue."""
        return FormatError(self._diagnostic(key, offset, values))

    def refuse(
        self,
        key: str,
        offset: int | str | None = None,
        count: int = 1,
        part: Part = "",
        places: ArrayLike | None = None,
        **values: object,
    ) -> None:
        """Record an error that makes the file invalid but after which the reader can continue.

        ``offset``: position in the file, or a JSON pointer, if known; of several errors, the first
        position. ``part``, ``places``: str, (N,), the data that the reader replaces with neutral
        values, see ``Diagnostic``. Raises ``FormatError``: immediately, if the collector does not
        collect errors.
        """
        found = self._diagnostic(key, offset, values, count, part, places)
        found = replace(found, is_refusal=True)
        if not self.diagnostics.keeps_errors:
            raise FormatError(found)
        self.diagnostics.add(found)

    def warn(
        self,
        key: str,
        offset: int | str | None = None,
        count: int = 1,
        part: Part = "",
        places: ArrayLike | None = None,
        **values: object,
    ) -> None:
        """Record a warning or note that leaves the file valid; arguments as for ``refuse``."""
        self.diagnostics.add(self._diagnostic(key, offset, values, count, part, places))

    def warn_unknown(self, word: bytes, offset: int, keywords: Iterable[bytes] = ()) -> None:
        """Warn that a word which begins no item is skipped, and name the keywords like it."""
        near = ""
        if len(self.diagnostics) < _HINTED:
            from viewer.near_names import near_names, question

            known = [key.decode() for key in keywords]
            near = question(near_names(word.decode(errors="replace"), known)[:1])
        found = Phrase("{word} ({near})", word=quoted(word), near=near) if near else quoted(word)
        self.warn(wording.UNKNOWN, offset, found=found)

    def _diagnostic(
        self,
        key: str,
        offset: int | str | None,
        values: dict[str, object],
        count: int = 1,
        part: Part = "",
        places: ArrayLike | None = None,
    ) -> Diagnostic:
        line = None if offset is None or isinstance(offset, str) else self.line(offset)
        indices = None if places is None else np.unique(np.asarray(places, dtype=np.int32))
        pointer = offset if isinstance(offset, str) else ""
        return Diagnostic(key, self.path, line, part, indices, values, count, pointer=pointer)

    @property
    def warnings(self) -> list[str]:
        """Warnings as lines of text."""
        return [str(found) for found in self.diagnostics.warnings]

    def remember(self, kind: str, offset_of: Callable[[int], int]) -> None:
        """Register a function that finds the offset of the index-th element of a kind."""
        self._offsets[kind] = self, offset_of

    def offset_of(self, kind: str, index: int) -> int:
        """Return the offset of an element of a registered kind; slow, for errors only."""
        return self._offsets[kind][1](index)

    @property
    def has_places(self) -> bool:
        """Whether the lines of its elements are known."""
        return bool(self._offsets)

    def knows(self, kind: str) -> bool:
        """Return whether the lines of elements of a kind are known."""
        return kind in self._offsets

    def place(self, kind: str, index: int) -> tuple[Path, int] | None:
        """Return the file and line of an element; None if its kind is not registered."""
        if kind == "normals" and not self.knows(kind):
            kind = "positions"  # the normals were computed: only the vertices can be corrected
        if not self.knows(kind):
            return None
        source, offset_of = self._offsets[kind]
        return source.path, source.line(offset_of(index))

    def head(self, size: int) -> bytes:
        """Return up to ``size`` bytes, starting at the first word."""
        text = self._text()
        if isinstance(text, LongText):
            start = text.part(0, 2 * size)
            first = _WORD.search(start)
            if first is not None and first.start() <= size:
                return start[first.start() : first.start() + size]
        first = self.next_word(0)
        return b"" if first is None else self.data[first.start() : first.start() + size]

    def looks_like(self) -> str | None:
        """Return the apparent type of a file in an unsupported format, e.g. ``"gzip data"``."""
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


class InvalidValueError(Exception):
    """An invalid value, with a sentence ``expected …, found …``; the caller adds file and line."""

    def __init__(self, problem: str | Phrase, **values: object) -> None:
        self.problem = phrased(problem, values)
        super().__init__(str(self.problem))


def phrased(problem: str | Phrase, values: Mapping[str, object]) -> Phrase:
    """Return a sentence with its values, or a whole phrase unchanged."""
    return problem if isinstance(problem, Phrase) else Phrase(problem, **values)


def remark_on(key: str, fault: Diagnostic) -> Diagnostic:
    """Return a note at the location of an error, which its message includes as ``problem``."""
    problem = replace(fault, path=None, line=None)
    return Diagnostic(key, fault.path, fault.line, values={"problem": problem})


def without_marks(data: bytes) -> bytes:
    """Return the bytes of a file without a UTF-8 byte order mark and final Ctrl-Zs."""
    if data.startswith(_ANY_END):
        return data
    return data.removeprefix(_BYTE_ORDER_MARK).rstrip(_CONTROL_Z)


class LongText:
    """A text in a regular file that stays on disk; offsets are those of ``without_marks``."""

    __slots__ = ("_end", "_first", "_path")

    def __init__(self, path: Path, size: int) -> None:
        self._path, self._first, self._end = path, 0, size
        head = _read_part(path, 0, _MARKED)
        if not head.startswith(_ANY_END):
            self._first = len(head) - len(head.removeprefix(_BYTE_ORDER_MARK))
            while (tail := self.part(max(len(self) - _TAIL, 0), len(self))).endswith(_CONTROL_Z):
                self._end -= len(tail) - len(tail.rstrip(_CONTROL_Z))

    @classmethod
    def open(cls, path: Path, max_size: int) -> LongText | None:
        """Return a long regular file; None for all others, which are to be read as a whole."""
        if _kind_of(path, max_size) is not None:
            return None
        size = path.stat().st_size
        return cls(path, size) if size > _LONG else None

    def __len__(self) -> int:
        return self._end - self._first

    def part(self, start: int, end: int) -> bytes:
        """Return the bytes between two offsets."""
        return _read_part(self._path, self._first + start, max(min(end, len(self)) - start, 0))


def line_parts(text: bytes | LongText, length: int, start: int = 0) -> Iterator[bytes]:
    """Yield parts of whole lines, ``length`` bytes or more; no line ending is divided."""
    offset, rest = start, b""
    # Reading as much as is left over keeps the cost of a long line proportional to its length.
    while new := _between(text, offset, offset + max(length, len(rest))):
        offset += len(new)
        # Carriage returns at the end may belong to a line feed that has not been read yet.
        end = max(new.rfind(b"\n"), new.rstrip(b"\r").rfind(b"\r")) + 1
        if end:
            yield rest + new[:end]
        rest = new[end:] if end else rest + new
    if rest:
        yield rest


def count_line_ends(text: bytes | LongText, start: int, end: int) -> int:
    """Return the number of line endings between two offsets: LF, CR LF, CR CR LF or a single CR."""
    count, returns = 0, 0  # carriage returns at the end of a block, which a line feed may follow
    for first in range(start, end, _BLOCK):
        block = _between(text, first, min(first + _BLOCK, end))
        body = block.lstrip(b"\r")
        returns += len(block) - len(body)
        if not body:
            continue
        count += 0 if body.startswith(b"\n") else returns
        block = body.rstrip(b"\r")
        returns = len(body) - len(block)
        count += block.count(b"\n")
        if block.count(b"\r") > block.count(b"\r\n"):
            count += _lone_returns(block)
    # Returns at the end count as not followed by a line feed.
    return count + returns


def _between(text: bytes | LongText, start: int, end: int) -> bytes:
    return text[start:end] if isinstance(text, bytes) else text.part(start, end)


def _lone_returns(block: bytes) -> int:
    """Return the number of carriage returns, none at an end, in runs that no line feed follows."""
    letters = np.frombuffer(block, dtype=np.uint8)
    is_return = np.concatenate([letters == ord("\r"), [False]])
    begins, ends = np.flatnonzero(is_return[1:] != is_return[:-1]).reshape(-1, 2).T
    return int((ends - begins)[letters[ends + 1] != ord("\n")].sum())


def read_bytes(path: Path, max_size: int = MAX_SIZE) -> bytes:
    """Read a whole regular file; if it has more than ``max_size`` bytes, it is refused unread."""
    kind = _kind_of(path, max_size)
    if kind is not None:
        raise _no_file(path, kind)
    return _read_part(path, 0, -1)


def _kind_of(path: Path, max_size: int) -> str | None:
    """Return the kind of file at a path without opening it; None for a regular file."""
    try:
        status = path.stat()
    except (OSError, ValueError) as problem:
        raise _unreadable(path, problem) from None
    if not stat.S_ISREG(status.st_mode):
        return _KINDS.get(stat.S_IFMT(status.st_mode), "an unknown kind of file")
    if status.st_size > max_size:
        raise too_large(path, status.st_size, max_size)
    return None


def too_large(path: Path, size: int, most: int) -> FormatError:
    """Return the error for a file, or its unpacked content, of more than ``most`` bytes."""
    remedy = Remedy("", " (see --max-size)")
    return FormatError(note(wording.TOO_LARGE, path, most=most, size=size, remedy=remedy))


def _read_pipe(path: Path, max_size: int) -> bytes | None:
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
                        raise FormatError(
                            note(
                                "F001.pipe-too-large: expected at most {most:,.0f} bytes, found "
                                "more{remedy}",
                                path,
                                most=max_size,
                                remedy=Remedy("", " (see --max-size)"),
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


def _read_part(path: Path, start: int, size: int) -> bytes:
    """Return the bytes from an offset; a size of -1 means all."""
    try:
        with path.open("rb") as stream:
            stream.seek(start)
            return stream.read(size)
    except (OSError, ValueError) as problem:
        raise _unreadable(path, problem) from None


def _unreadable(path: Path, problem: Exception) -> FormatError:
    near = _near_files(path) if isinstance(problem, FileNotFoundError) else ""
    return unreadable(path, reason_of(problem), near)


def unreadable(path: Path, reason: object, near: str = "") -> FormatError:
    """Return the error for a file that cannot be read."""
    return FormatError(
        note(
            "F001.unreadable: cannot be read: {reason}{near}",
            path,
            reason=str(reason),
            near=optional("; {}", near),
        )
    )


def _no_file(path: Path, kind: str) -> FormatError:
    return FormatError(note("F001.no-file: expected a file, found {found}", path, found=kind))


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
