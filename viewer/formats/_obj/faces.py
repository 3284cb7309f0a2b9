"""The ``f`` lines of an ``.obj``: which vertex, texture coordinate and normal each corner has."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from viewer.errors import FormatError
from viewer.formats._numbers import parse_numbers, word_begins
from viewer.formats._obj.lines import Lines, Places, Rows, rows_of
from viewer.formats._source import Source
from viewer.phrases import quoted
from viewer.rig.arrays import Bools, Floats

__all__ = ["CORNER", "CORNER_KINDS", "FEWEST", "FaceRows", "fits_corner", "read_faces"]

CORNER_KINDS = {"v": "vertex", "vt": "texture coordinate", "vn": "normal"}
"""What the three numbers of a corner refer to."""

_SLASH = ord("/")
CORNER = "expected a corner v, v/vt, v//vn or v/vt/vn"
FEWEST = 3  # corners of a face


@dataclass(frozen=True, slots=True)
class FaceRows:
    """The corners of some faces, one face after the other.

    Attributes
    ----------
    counts : (F,)
        Corners of each face, 3 or more.
    corners : (C, 3)
        Vertex, texture coordinate and normal of each, from 0; -1 where it has none. Whether they
        exist is known only when the whole file is read.
    offsets : (F,)
        Where each face is in the file.
    faults : tuple of (FormatError, int, (n,))
        Broken corners that are gone on from: the first, how many, and the faces they are of.
    """

    counts: Places
    corners: Places
    offsets: Places
    faults: tuple[tuple[FormatError, int, Places], ...] = ()


def read_faces(source: Source, lines: Lines, before: dict[str, int]) -> FaceRows:
    """Read the faces of some lines.

    Negative indices count back from the last ``v``, ``vt`` or ``vn`` before the face.

    Parameters
    ----------
    source : Source
        For errors.
    lines : Lines
        Some lines of it.
    before : dict of str to int
        How many lines of each keyword came before these.

    Raises
    ------
    FormatError
        With the line of a corner that is none.
    """
    rows = rows_of(lines, "f")
    begins = word_begins(rows.letters)
    counts = np.diff(np.searchsorted(begins, rows.starts))
    small = np.flatnonzero(counts < FEWEST)
    if len(small):
        raise source.error(
            f"f: expected {FEWEST} or more corners, found {counts[small[0]]}",
            int(rows.origins[small[0]]) - 1,
        )
    written = _corner_numbers(source, rows, begins)
    for column, keyword in enumerate(CORNER_KINDS):
        numbers = written[:, column]
        back = np.flatnonzero(numbers < 0)
        if len(back):
            owners = np.repeat(np.arange(len(counts)), counts)[back]
            known = before[keyword] + np.searchsorted(lines.of[keyword], lines.of["f"])[owners]
            _check_back(source, rows, keyword, numbers[back], known, begins[back])
            numbers[back] += known + 1
    return FaceRows(counts, written - 1, rows.origins - 1)


def _check_back(
    source: Source, rows: Rows, keyword: str, numbers: Places, known: Places, begins: Places
) -> None:
    """Refuse negative indices that reach back behind the first."""
    wrong = np.flatnonzero(-numbers > known)
    if len(wrong):
        first = wrong[0]
        limits = f"-1 to {-known[first]}" if known[first] else "after the first"
        raise source.error(
            f"f: expected a {CORNER_KINDS[keyword]} {limits}, found {numbers[first]}",
            rows.offset(int(begins[first])),
        )


def _corner_numbers(source: Source, rows: Rows, begins: Places) -> Places:
    """Return the three numbers of every corner as written, 0 where there is none: (C, 3)."""
    values, bad = parse_numbers(rows.body.replace(b"/", b" "), 0, len(rows.body))
    zeros = np.flatnonzero(values == 0.0)
    if len(zeros):  # an index that nothing has; below, 0 means that there is none
        place = int(_number_begins(rows)[zeros[0]])
        raise source.error("f: expected an index from 1, found 0", rows.offset(place))
    slashes = np.flatnonzero(rows.letters == _SLASH)
    if len(slashes) == 0:
        # The most common file besides that of three numbers a corner: vertices alone.
        if bad >= 0:
            raise _corner_error(source, rows, int(begins[bad]))
        return _spread(source, rows, values, begins, np.ones(len(begins), np.int64), None)
    fits, n_numbers, has_gap = fits_corner(rows, begins)
    wrong = np.flatnonzero(~fits)
    first = int(wrong[0]) if len(wrong) else len(begins)
    if bad >= 0:
        number_begins = _number_begins(rows)
        owner = np.searchsorted(begins, number_begins[bad], side="right")
        first = min(first, int(owner) - 1)
    if first < len(begins):
        raise _corner_error(source, rows, int(begins[first]))
    return _spread(source, rows, values, begins, n_numbers, has_gap if has_gap.any() else None)


def _number_begins(rows: Rows) -> Places:
    return word_begins(np.where(rows.letters == _SLASH, np.uint8(32), rows.letters))


def fits_corner(rows: Rows, begins: Places) -> tuple[Bools, Places, Bools]:
    """Look at the slashes of corners.

    Parameters
    ----------
    rows : Rows
        Of faces.
    begins : (C,)
        Where each corner begins in their body.

    Returns
    -------
    fits : (C,) bool
        Which are v, v/vt, v//vn or v/vt/vn, whatever stands for a number.
    n_numbers : (C,)
        How many numbers each has.
    has_gap : (C,) bool
        Which are v//vn.
    """
    number_begins = _number_begins(rows)
    slashes = np.flatnonzero(rows.letters == _SLASH)
    after = np.append(begins[1:], len(rows.letters))
    n_slashes = np.searchsorted(slashes, after) - np.searchsorted(slashes, begins)
    n_numbers = np.searchsorted(number_begins, after) - np.searchsorted(number_begins, begins)
    # Of "1//3" the middle one is missing, and that alone: "1/", "/1" and "1///2" are no corners.
    doubles = slashes[:-1][np.diff(slashes) == 1]
    has_gap = np.searchsorted(doubles, after) - np.searchsorted(doubles, begins) == 1
    fits = np.where(has_gap, (n_slashes == 2) & (n_numbers == 2), n_numbers == n_slashes + 1)
    fits &= (
        (n_slashes <= 2) & (rows.letters[begins] != _SLASH) & (rows.letters[after - 1] != _SLASH)
    )
    return fits, n_numbers, has_gap


def _spread(
    source: Source, rows: Rows, values: Floats, begins: Places, counts: Places, gaps: Bools | None
) -> Places:
    """Put the numbers of each corner into its row; with a gap the second is the third."""
    whole = np.clip(values, -(2.0**40), 2.0**40).astype(np.int64)
    firsts = np.cumsum(counts) - counts
    odd = np.flatnonzero(whole != values)
    if len(odd):
        corner = int(np.searchsorted(firsts, odd[0], side="right")) - 1
        raise _corner_error(source, rows, int(begins[corner]))
    table = np.zeros((len(counts), 3), dtype=np.int64)
    if gaps is None and (counts == counts[0]).all():
        table[:, : counts[0]] = whole.reshape(len(counts), -1)
        return table
    gaps = np.zeros(len(counts), dtype=np.bool_) if gaps is None else gaps
    table[:, 0] = whole[firsts]
    middle, third = (counts > 1) & ~gaps, counts > 2
    table[middle, 1] = whole[firsts[middle] + 1]
    table[gaps, 2] = whole[firsts[gaps] + 1]
    table[third, 2] = whole[firsts[third] + 2]
    return table


def _corner_error(source: Source, rows: Rows, place: int) -> FormatError:
    offset = rows.offset(place)
    word = source.next_word(offset)
    assert word is not None  # it was found there
    return source.error(f"f: {CORNER}, found {quoted(word.group())}", offset)
