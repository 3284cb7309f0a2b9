"""Parser for invalid lines of an ``.obj``: records errors and substitutes neutral values."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from viewer.diagnostics import Part, Phrase
from viewer.formats._mesh.polygons import first_known, triangles_of
from viewer.formats._obj.faces import CORNER_KINDS, FEWEST, CornerFault, FaceRows, fits_corner
from viewer.formats._obj.lines import Lines, NumberRows, Places, Rows, rows_of
from viewer.formats._source import Source
from viewer.formats._text.numbers import parse_words, to_number, word_begins
from viewer.formats._text.words import Words, refuse_words
from viewer.rig.arrays import Bools

__all__ = ["checked_corners", "faulty_faces", "faulty_rows"]

_LOST = -(2**40)
"""Represents an unknown vertex; no file has this many vertices."""


def faulty_rows(source: Source, lines: Lines, keyword: str, width: int, first: int) -> NumberRows:
    """Parse the numbers after a keyword; see ``number_rows``.

    Parameters
    ----------
    source : Source
        The file, which records the errors.
    lines : Lines
        Lines of the file.
    keyword : str
        v, vt or vn.
    width : int
        Minimum number of values in a line.
    first : int
        Number of earlier lines with this keyword.

    Returns
    -------
    table, counts, values, rows
        As for ``number_rows``, with NaN for words that are not numbers and in rows that are too
        short.
    """
    rows = rows_of(lines, keyword)
    begins = word_begins(rows.letters)
    values = parse_words(rows.body, 0, len(rows.body))
    firsts = np.searchsorted(begins, rows.starts)
    counts = np.diff(firsts)
    owners = np.repeat(np.arange(len(counts)), counts)
    words = Words(source.data, values, rows.origins[owners] + begins - rows.starts[owners], owners)
    part: Part = "positions" if keyword == "v" else ""
    bad = words.bad
    is_used = bad - firsts[owners[bad]] < width
    parts: tuple[Part, Part] = (part, "")  # only these numbers are checked
    for chosen, whose in zip((is_used, ~is_used), parts, strict=True):
        owned = owners[bad[chosen]] + first
        refuse_words(
            source,
            words,
            bad[chosen],
            lambda word: Phrase(f"obj-{keyword}", index=int(owners[word]) + first),
            whose,
            owned,
        )
    short = np.flatnonzero(counts < width)
    if len(short):
        row = int(short[0])
        source.refuse(
            "F002.width",
            int(rows.origins[row]) - 1,
            len(short),
            part,
            short + first,
            item=Phrase(f"obj-{keyword}", index=row + first),
            expected=width,
            found=int(counts[row]),
        )
    table = np.full((len(counts), width), np.nan)
    long = counts >= width
    table[long] = values[firsts[:-1][long, None] + np.arange(width)]
    return table, counts, values, rows


def faulty_faces(source: Source, lines: Lines, before: dict[str, int]) -> FaceRows:
    """Read the faces of some lines; see ``read_faces``.

    Parameters
    ----------
    source : Source
        The file, which records the errors of omitted faces.
    lines : Lines
        Lines of the file.
    before : dict of str to int
        Number of earlier lines with each keyword.

    Returns
    -------
    FaceRows
        Faces, with the errors to record when their triangles are known.
    """
    rows = rows_of(lines, "f")
    begins = word_begins(rows.letters)
    counts = np.diff(np.searchsorted(begins, rows.starts))
    owners = np.repeat(np.arange(len(counts)), counts)
    small = np.flatnonzero(counts < FEWEST)
    if len(small):
        offset = int(rows.origins[small[0]]) - 1
        found = int(counts[small[0]])
        source.refuse("F002.obj-face", offset, len(small), least=FEWEST, found=found)
    written, lost = _corners(rows, begins)
    kept = counts >= FEWEST
    places = (np.cumsum(kept) - 1)[owners]
    faults = []
    broken = np.flatnonzero(lost & kept[owners])
    if len(broken):
        offset = rows.offset(int(begins[broken[0]]))
        faults.append(_corner_fault(source, offset, places[broken]))
    for column, keyword in enumerate(CORNER_KINDS):
        numbers = written[:, column]
        known = before[keyword] + np.searchsorted(lines.of[keyword], lines.of["f"])[owners]
        far = np.flatnonzero((-numbers > known) & ~lost & kept[owners])
        if len(far):
            values = {"least": -int(known[far[0]]), "found": int(numbers[far[0]])}
            key = f"F002.obj-{keyword}-back" if known[far[0]] else f"F002.obj-{keyword}-early"
            offset = rows.offset(int(begins[far[0]]))
            faults.append(CornerFault(key, offset, values, places[far]))
            lost[far] = True
        numbers[numbers < 0] += known[numbers < 0] + 1
    written[lost] = _LOST, 0, 0
    return FaceRows(counts[kept], written[kept[owners]] - 1, rows.origins[kept] - 1, tuple(faults))


def _corner_fault(source: Source, offset: int, faces: Places) -> CornerFault:
    found = source.next_word(offset)
    word = b"" if found is None else found.group()
    if any(to_number(number) == 0.0 for number in word.split(b"/")):
        return CornerFault("F002.obj-zero", offset, {}, faces)
    return CornerFault("F002.obj-corner", offset, {"found": word}, faces)


def _corners(rows: Rows, begins: Places) -> tuple[Places, Bools]:
    """Return the numbers of every corner, 0 if missing, (C, 3), and a mask of invalid corners."""
    values = parse_words(rows.body.replace(b"/", b" "), 0, len(rows.body))
    fits, n_numbers, has_gap = fits_corner(rows, begins)
    firsts = np.cumsum(n_numbers) - n_numbers
    numbers = np.zeros((len(begins), 3))
    numbers[fits, 0] = values[firsts[fits]]
    for chosen, column, place in (
        (fits & (n_numbers > 1) & ~has_gap, 1, 1),
        (fits & has_gap, 2, 1),
        (fits & (n_numbers > 2), 2, 2),
    ):
        given = values[firsts[chosen] + place]
        # Indices count from 1, so an explicit 0 is invalid and differs from a missing index.
        numbers[chosen, column] = np.where(given == 0.0, np.nan, given)
    whole = np.clip(np.nan_to_num(numbers), -(2.0**40), 2.0**40).astype(np.int64)
    lost = ~fits | (whole != numbers).any(axis=1) | (whole[:, 0] == 0)
    return whole, lost


def checked_corners(
    source: Source, faces: FaceRows, faults: list[CornerFault], ends: dict[str, int]
) -> NDArray[np.integer]:
    """Return the corners of all faces, with invalid corners replaced by others of their face.

    Parameters
    ----------
    source : Source
        The file, which records the errors.
    faces : FaceRows
        All faces of the file; their corners are changed.
    faults : list of CornerFault
        Errors in these faces, which the caller records.
    ends : dict of str to int
        Number of lines with each keyword.

    Returns
    -------
    (C, 3)
        Corners; -1 for invalid indices of texture coordinates and normals.
    """
    corners, counts = faces.corners, faces.counts
    limits = np.array([ends[keyword] for keyword in CORNER_KINDS])
    largest = [column.max(initial=-1) for column in corners.T]
    if not faults and (largest < limits).all():
        return corners
    for fault in faults:
        triangles = triangles_of(counts, fault.faces)
        source.refuse(
            fault.key, fault.offset, len(fault.faces), "triangles", triangles, **fault.values
        )
    owners = np.repeat(np.arange(len(counts)), counts)
    for column, keyword in enumerate(CORNER_KINDS):
        wrong = np.flatnonzero(corners[:, column] >= ends[keyword])
        if len(wrong):
            source.refuse(
                f"F002.obj-{keyword}-range" if ends[keyword] else f"F002.obj-{keyword}-none",
                int(faces.offsets[owners[wrong[0]]]),
                len(wrong),
                "triangles" if column == 0 else "",
                triangles_of(counts, owners[wrong]),
                limit=ends[keyword],
                found=int(corners[wrong[0], column]) + 1,
            )
            corners[wrong, column] = -1
    corners[:, 0] = first_known(corners[:, 0], counts, owners)
    return corners
