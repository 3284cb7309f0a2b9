"""Text files that are read part by part, without the marks that some programs add to them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from viewer.formats._file_bytes import kind_of, read_part

__all__ = ["LongText", "count_line_ends", "line_parts", "without_marks"]

_LONG = 1 << 24  # bytes; reading shorter files as a whole takes little memory
_MARKED = 8  # number of bytes with a mark at the start
_TAIL = 4096  # number of bytes of which each read at the end removes the marks
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_CONTROL_Z = b"\x1a"  # end-of-file character of CP/M and DOS
# Files with these first bytes are binary and may end with any byte.
_ANY_END = (b"ply\n", b"ply\r", b"glTF", b"\x80", b"x", b"\x1f\x8b", b"BZh", b"\xfd", b"\x5d\x00")
_BLOCK = 1 << 20  # bytes per part in which line endings are counted


def without_marks(data: bytes) -> bytes:
    """Return the bytes of a file without a UTF-8 byte order mark and final Ctrl-Zs."""
    if data.startswith(_ANY_END):
        return data
    return data.removeprefix(_BYTE_ORDER_MARK).rstrip(_CONTROL_Z)


class LongText:
    """A text file that stays on disk; offsets are those of ``without_marks``.

    Parameters
    ----------
    path : Path
        A regular file; errors as in ``read_part``.
    size : int
        Its size in bytes.
    """

    __slots__ = ("_end", "_first", "_path")

    def __init__(self, path: Path, size: int) -> None:
        self._path, self._first, self._end = path, 0, size
        head = read_part(path, 0, _MARKED)
        if not head.startswith(_ANY_END):
            self._first = len(head) - len(head.removeprefix(_BYTE_ORDER_MARK))
            while (tail := self.part(max(len(self) - _TAIL, 0), len(self))).endswith(_CONTROL_Z):
                self._end -= len(tail) - len(tail.rstrip(_CONTROL_Z))

    @classmethod
    def open(cls, path: Path, max_size: int) -> LongText | None:
        """Return a long regular file; None for all others, which are to be read as a whole."""
        if kind_of(path, max_size) is not None:
            return None
        size = path.stat().st_size
        return cls(path, size) if size > _LONG else None

    def __len__(self) -> int:
        return self._end - self._first

    def part(self, start: int, end: int) -> bytes:
        """Return the bytes between two offsets."""
        return read_part(self._path, self._first + start, max(min(end, len(self)) - start, 0))


def line_parts(text: bytes | LongText, length: int) -> Iterator[bytes]:
    """Yield a text in parts of whole lines, which end with LF or CR; only the last may not.

    A line ending is never divided.

    Parameters
    ----------
    text : bytes or LongText
        The text.
    length : int
        Size of a part in bytes, unless one of its lines is longer.
    """
    offset, rest = 0, b""
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
    """Return the number of carriage returns in runs that no line feed follows.

    The block neither begins nor ends with a carriage return.
    """
    letters = np.frombuffer(block, dtype=np.uint8)
    is_return = np.concatenate([letters == ord("\r"), [False]])
    begins, ends = np.flatnonzero(is_return[1:] != is_return[:-1]).reshape(-1, 2).T
    return int((ends - begins)[letters[ends + 1] != ord("\n")].sum())
