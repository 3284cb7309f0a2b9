"""Words of a text that should be numbers: their positions, errors for others, tables of rows."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Part, Phrase, wording
from viewer.formats._source import Source
from viewer.formats._text.numbers import (
    is_infinite,
    is_too_large,
    line_ends,
    parse_numbers,
    parse_words,
    word_begins,
)
from viewer.phrases import quoted
from viewer.rigs.arrays import Floats

_Places = NDArray[np.int64]
_WORD = re.compile(rb"[^ \t\n\r\v\f]+")


@dataclass(frozen=True, slots=True, eq=False)
class Words:
    """Words of a text that should be numbers."""

    data: bytes
    """The file."""
    values: Floats
    """(N,). Values; NaN for a word that is not a number."""
    offsets: _Places
    """(N,). Position of each word in the file, in bytes."""
    lines: _Places
    """(N,). Index of each word's line: equal for words on the same line, otherwise increasing."""

    @property
    def bad(self) -> _Places:
        """Indices of the words that are not numbers."""
        return np.flatnonzero(np.isnan(self.values))

    def rows(self) -> tuple[_Places, _Places]:
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
    values = parse_words(data, start, end)
    return Words(data, values, begins + start, np.searchsorted(line_ends(letters), begins))


def refuse_words(
    source: Source,
    words: Words,
    bad: _Places,
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


def read_table(
    source: Source, columns: int, part: Part = ""
) -> tuple[Floats, Callable[[int], int]]:
    """Read rows (N, columns), NaN in invalid ones, and a function that finds a row in the file."""
    rows = _regular_rows(source, columns)
    if rows is not None:
        return rows, lambda row: source.word_offset(0, row * columns)
    # An invalid table is read word by word.
    words = read_words(source.data, 0, len(source.data))
    if len(words.offsets) == 0:
        raise source.fault(
            "F002.table-empty: expected rows of {columns} numbers, found {found}",
            columns=columns,
            found=source.looks_like(),
        )
    begins, sizes = words.rows()
    fits = sizes == columns
    owners = np.repeat(np.arange(len(begins)), sizes)
    if not fits.any() and len(words.bad):
        first = int(words.bad[0])
        raise source.fault(
            number_key(words.word(first)),
            int(words.offsets[first]),
            item=Phrase("row {index}", index=int(owners[first])),
            found=quoted(words.word(first)),
        )
    bad = words.bad
    refuse_words(
        source,
        words,
        bad,
        lambda word: Phrase("row {index}", index=int(owners[word])),
        part,
        owners[bad],
    )
    wrong = np.flatnonzero(~fits)
    if len(wrong):
        offset, found = int(words.offsets[begins[wrong[0]]]), int(sizes[wrong[0]])
        values = {"expected": columns, "found": found}
        if not fits.any():
            raise source.fault(wording.TABLE_WIDTH, offset, **values)
        source.refuse(wording.TABLE_WIDTH, offset, len(wrong), part, wrong, **values)
    rows = np.full((len(begins), columns), np.nan)
    rows[fits] = words.values[begins[fits, None] + np.arange(columns)]
    offsets = words.offsets[begins]
    return rows, lambda row: int(offsets[row])


def _regular_rows(source: Source, columns: int) -> Floats | None:
    """Return the rows of a table without errors, (N, columns); None if it has errors."""
    from viewer.media.array_cache import slot_of

    data = source.data
    slot = slot_of(f"table{columns}-1", data, 0, len(data))
    kept = None if slot is None else slot.load("<f8", 2)
    if kept is not None:
        return kept
    values, bad = parse_numbers(data, 0, len(data), is_kept=False)
    if bad >= 0 or len(values) == 0 or not _is_regular(source, columns, len(values)):
        return None
    rows = values.reshape(-1, columns)
    if slot is not None:
        slot.store(rows)
    return rows


def read_numbers(source: Source) -> Floats:
    """Read all numbers of a text (N,), regardless of line breaks."""
    data = source.data
    values, bad = parse_numbers(data, 0, len(data))
    if bad >= 0:
        offset = source.word_offset(0, bad)
        word = source.next_word(offset)
        found = b"" if word is None else word.group()
        raise source.fault(
            number_key(found), offset, item=Phrase("word {index}", index=bad), found=quoted(found)
        )
    return values


def _is_regular(source: Source, columns: int, count: int) -> bool:
    """Return whether every line has this many words or is blank; lines end with LF, CR or both."""
    if count % columns:
        return False
    letters = np.frombuffer(source.data, dtype=np.uint8)
    # Each run of `columns` words must be on a separate line.
    rows = np.searchsorted(line_ends(letters), word_begins(letters)).reshape(-1, columns)
    return bool((rows[:, 0] == rows[:, -1]).all() and (rows[1:, 0] > rows[:-1, -1]).all())
