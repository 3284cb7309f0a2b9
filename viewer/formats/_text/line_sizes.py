"""Number of words in each line of a large text."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from viewer.formats._text.numbers import word_begins

__all__ = ["line_sizes"]

_PIECE = 1 << 18  # bytes per piece, whose temporary arrays stay in the processor's cache
_LINE_END = re.compile(rb"[\r\n]")


def line_sizes(data: bytes, start: int) -> NDArray[np.int32]:
    r"""Return the number of words in each non-blank line, from an offset to the end: (L,).

    >>> line_sizes(b"1 2\r\n\n3", 0).tolist()
    [2, 1]
    """
    sizes = [np.zeros(0, np.int32)]
    while start < len(data):
        found = _LINE_END.search(data, min(start + _PIECE, len(data)))
        end = found.end() if found else len(data)
        letters = np.frombuffer(data, dtype=np.uint8, count=end - start, offset=start)
        begins = word_begins(letters)
        ends = np.append(np.flatnonzero((letters == 10) | (letters == 13)), len(letters))
        counts = np.diff(np.searchsorted(begins, ends), prepend=0)
        sizes.append(counts[counts > 0].astype(np.int32))
        start = end
    return np.concatenate(sizes)
