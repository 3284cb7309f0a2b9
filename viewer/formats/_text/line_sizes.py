"""Number of words in each line of a large text."""

from __future__ import annotations

import bisect
import re

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.formats._text.numbers import word_begins

__all__ = ["LineSizes", "line_sizes"]

_PIECE = 1 << 18  # bytes per piece, whose temporary arrays stay in the processor's cache
_LINE_END = re.compile(rb"[\r\n]")


@dataclass(frozen=True, slots=True, eq=False)
class LineSizes:
    """Non-blank lines of a text.

    Attributes
    ----------
    data : bytes
        The text.
    words : (L,)
        Number of words in each line.
    marks : list of (int, int)
        Offset of each piece of the text, and the number of lines before it.
    """

    data: bytes
    words: NDArray[np.int32]
    marks: list[tuple[int, int]]

    def offset(self, line: int) -> int:
        """Return an offset between the words of a line and the words of the previous line.

        The offset of the end of the text follows the last line.
        """
        if line >= len(self.words):
            return len(self.data)
        place = bisect.bisect_right(self.marks, line, key=lambda mark: mark[1]) - 1
        start, before = self.marks[place]
        end = self.marks[place + 1][0] if place + 1 < len(self.marks) else len(self.data)
        counts, ends = _counts(self.data, start, end)
        return start + int(np.append(0, ends)[np.flatnonzero(counts)[line - before]])


def line_sizes(data: bytes, start: int) -> LineSizes:
    r"""Return the number of words in each non-blank line, from an offset to the end.

    >>> found = line_sizes(b"1 2\r\n\n3", 0)
    >>> found.words.tolist(), found.offset(1)
    ([2, 1], 5)
    """
    sizes = [np.zeros(0, np.int32)]
    marks, n_lines = [(start, 0)], 0
    while start < len(data):
        found = _LINE_END.search(data, min(start + _PIECE, len(data)))
        end = found.end() if found else len(data)
        counts, _ = _counts(data, start, end)
        sizes.append(counts[counts > 0])
        n_lines += len(sizes[-1])
        start = end
        marks.append((start, n_lines))
    return LineSizes(data, np.concatenate(sizes), marks)


def _counts(data: bytes, start: int, end: int) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Return the number of words in each line of a piece, and the offsets of line ends in it."""
    letters = np.frombuffer(data, dtype=np.uint8, count=end - start, offset=start)
    begins = word_begins(letters)
    ends = np.append(np.flatnonzero((letters == 10) | (letters == 13)), len(letters))
    return np.diff(np.searchsorted(begins, ends), prepend=0).astype(np.int32), ends
