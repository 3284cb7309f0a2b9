"""Words of a text that should be numbers, their positions, and errors for invalid words."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Part, Phrase
from viewer.formats._source import Source
from viewer.formats._text.numbers import is_infinite, is_too_large, parse_words, word_begins
from viewer.phrases import quoted
from viewer.rig.arrays import Floats

Places = NDArray[np.int64]

_WORD = re.compile(rb"[^ \t\n\r\v\f]+")


@dataclass(frozen=True, slots=True, eq=False)
class Words:
    """Words of a text that should be numbers."""

    data: bytes
    """The file."""
    values: Floats
    """(N,). Values; NaN for a word that is not a number."""
    offsets: Places
    """(N,). Position of each word in the file, in bytes."""
    lines: Places
    """(N,). Index of each word's line: equal for words on the same line, otherwise increasing."""

    @property
    def bad(self) -> Places:
        """Indices of the words that are not numbers."""
        return np.flatnonzero(np.isnan(self.values))

    def rows(self) -> tuple[Places, Places]:
        """Return the first word and the number of words of each non-empty line: (L,), (L,)."""
        begins = np.flatnonzero(np.diff(self.lines, prepend=-1))
        return begins, np.diff(np.append(begins, len(self.lines)))

    def word(self, index: int) -> bytes:
        """Return a word as written."""
        found = _WORD.match(self.data, int(self.offsets[index]))
        return b"" if found is None else found.group()


def read_words(data: bytes, start: int, end: int) -> Words:
    """Parse a part of a text that should contain only numbers."""
    letters = np.frombuffer(data, dtype=np.uint8, count=end - start, offset=start)
    begins = word_begins(letters)
    breaks = np.flatnonzero((letters == 10) | (letters == 13))
    values = parse_words(data, start, end)
    return Words(data, values, begins + start, np.searchsorted(breaks, begins))


def refuse_words(
    source: Source,
    words: Words,
    bad: Places,
    named: Callable[[int], Phrase | str],
    part: Part,
    places: NDArray[np.integer],
) -> None:
    """Record invalid words, infinite ones apart from others; ``places`` are their rows, (N,)."""
    infinite = [is_infinite(words.word(index)) for index in bad.tolist()]
    for is_chosen in (True, False):
        chosen = np.flatnonzero(np.array(infinite, dtype=np.bool_) == is_chosen)
        if len(chosen) == 0:
            continue
        first = int(bad[chosen[0]])
        source.refuse(
            number_key(words.word(first), part),
            int(words.offsets[first]),
            len(chosen),
            part,
            places[chosen],
            item=named(first),
            found=quoted(words.word(first)),
        )


def number_key(word: bytes, part: Part = "") -> str:
    """Return the message about a word that is not a finite number."""
    if not is_infinite(word):
        return "F002.number: {item}: expected a number, found {found}"
    code = "W003" if part == "weights" else "F003"
    if is_too_large(word):  # it is well-formed, so the message states the limit
        return f"{code}.too-large: {{item}}: expected a number within ±3.4e+38, found {{found}}"
    return f"{code}.number: {{item}}: expected a number, found {{found}}"
