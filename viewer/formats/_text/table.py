"""Text tables without a header: numbers in columns, one row per line."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from viewer.diagnostics import Part, Phrase, wording
from viewer.formats._source import Source
from viewer.formats._text.numbers import parse_numbers
from viewer.formats._text.words import number_key, read_words, refuse_words
from viewer.phrases import quoted
from viewer.rig.arrays import Floats

Places = NDArray[np.int64]


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
    is_space = letters <= 32  # control characters have been refused with the numbers
    begins = np.flatnonzero(~is_space & np.concatenate([[True], is_space[:-1]]))
    # Each run of `columns` words must be on a separate line.
    ends = np.flatnonzero((letters == 10) | (letters == 13))
    rows = np.searchsorted(ends, begins).reshape(-1, columns)
    return bool((rows[:, 0] == rows[:, -1]).all() and (rows[1:, 0] > rows[:-1, -1]).all())
