"""Text tables without header: numbers in columns, one row a line."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from viewer.diagnostics import Part
from viewer.errors import FormatError
from viewer.formats._numbers import parse_numbers
from viewer.formats._source import Source, no_number
from viewer.formats._tolerant import read_words, refuse_words
from viewer.rig.arrays import Floats

__all__ = ["read_broken_table", "read_numbers", "read_table", "row_error"]

Places = NDArray[np.int64]


def read_table(source: Source, columns: int) -> Floats:
    """Read a table of numbers.

    Parameters
    ----------
    source : Source
        The file; blank lines are skipped.
    columns : int
        Numbers in every row.

    Returns
    -------
    (N, columns)
        As written.

    Raises
    ------
    FormatError
        With the line of a row that has more or fewer numbers, or a word that is none.
    """
    values = read_numbers(source)
    if len(values) == 0:
        raise source.error(f"expected rows of {columns} numbers, found {source.looks_like()}")
    _check_rows(source, columns, len(values))
    return values.reshape(-1, columns)


def read_numbers(source: Source) -> Floats:
    """Read all numbers of a text, no matter how they are spread over lines: (N,).

    Raises
    ------
    FormatError
        With the line of a word that is no number.
    """
    data = source.data
    values, bad = parse_numbers(data, 0, len(data))
    if bad >= 0:
        offset = source.word_offset(0, bad)
        word = source.next_word(offset)
        raise source.error(no_number(word.group() if word else None), offset)
    return values


def _check_rows(source: Source, columns: int, count: int) -> None:
    """Hold every line to its number of words; lines end with LF, CR or both."""
    letters = np.frombuffer(source.data, dtype=np.uint8)
    is_space = letters <= 32  # control characters were refused with the numbers
    begins = np.flatnonzero(~is_space & np.concatenate([[True], is_space[:-1]]))
    # Each run of `columns` words must lie on a line of its own.
    ends = np.flatnonzero((letters == 10) | (letters == 13))
    lines = np.searchsorted(ends, begins)
    if count % columns == 0:
        rows = lines.reshape(-1, columns)
        if (rows[:, 0] == rows[:, -1]).all() and (rows[1:, 0] > rows[:-1, -1]).all():
            return
    _, first, counts = np.unique(lines, return_index=True, return_counts=True)
    wrong = int(np.flatnonzero(counts != columns)[0])
    raise source.error(
        f"expected {columns} numbers in a row, found {counts[wrong]}", int(begins[first[wrong]])
    )


def read_broken_table(source: Source, columns: int, part: Part) -> tuple[Floats, Places]:
    """Read a table, noting all faults; see ``read_table``.

    Parameters
    ----------
    source : Source
        Takes the faults.
    columns : int
        Numbers in every row.
    part : str
        What of a figure the rows are, see ``Fault``.

    Returns
    -------
    rows : (N, columns)
        NaN in rows that cannot be used.
    offsets : (N,)
        Where each is in the file.
    """
    words = read_words(source.data, 0, len(source.data))
    begins, sizes = words.rows()
    fits = sizes == columns
    if not fits.any():
        read_table(source, columns)  # refuses it
    owners = np.repeat(np.arange(len(begins)), sizes)
    bad = words.bad
    refuse_words(source, words, bad, lambda word: f"row {owners[word]}", part, owners[bad])
    wrong = np.flatnonzero(~fits)
    if len(wrong):
        error = source.error(
            f"expected {columns} numbers in a row, found {sizes[wrong[0]]}",
            int(words.offsets[begins[wrong[0]]]),
        )
        source.refuse_error(error, len(wrong), part, wrong)
    rows = np.full((len(begins), columns), np.nan)
    rows[fits] = words.values[begins[fits, None] + np.arange(columns)]
    return rows, words.offsets[begins]


def row_error(source: Source, row: int, columns: int, message: str) -> FormatError:
    """Return an error with the line of a row."""
    return source.error(message, source.word_offset(0, row * columns))
