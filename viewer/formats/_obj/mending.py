"""Lines of a broken ``.obj``: every fault is noted, and something neutral stands in its place."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

from viewer.diagnostics import Part
from viewer.errors import FormatError
from viewer.formats._numbers import parse_words, word_begins
from viewer.formats._obj.faces import CORNER, CORNER_KINDS, FEWEST, FaceRows, fits_corner
from viewer.formats._obj.lines import Lines, Places, Rows, rows_of
from viewer.formats._polygons import first_known, triangles_of
from viewer.formats._source import Source
from viewer.formats._tolerant import Words, refuse_words
from viewer.phrases import quoted
from viewer.rig.arrays import Bools, Floats

__all__ = ["mended_faces", "mended_rows", "settled_corners"]

_ITEMS = {"v": "v of vertex", "vt": "vt", "vn": "vn"}
_ZERO = re.compile(rb"(?:\A|/)[+-]?0+(?:\.0*)?(?:/|\Z)")
_NOTHING: Part = ""
_LOST = -(2**40)
"""In place of a vertex that cannot be told: no file has so many."""


def mended_rows(
    source: Source, lines: Lines, keyword: str, width: int, first: int
) -> tuple[Floats, Places, Floats, Rows]:
    """Parse the numbers behind a keyword; see ``number_rows``.

    Parameters
    ----------
    source : Source
        Takes the faults.
    lines : Lines
        Some lines of it.
    keyword : str
        v, vt or vn.
    width : int
        Numbers that every line must have at least.
    first : int
        How many lines of this keyword came before.

    Returns
    -------
    table, counts, values, rows
        As ``number_rows``, with NaN for words that are no numbers and in rows that are too short.
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
    for chosen, whose in ((is_used, part), (~is_used, _NOTHING)):
        refuse_words(
            source,
            words,
            bad[chosen],
            lambda word: f"{_ITEMS[keyword]} {owners[word] + first}",
            whose,
            owners[bad[chosen]] + first,
        )
    short = np.flatnonzero(counts < width)
    if len(short):
        error = source.error(
            f"{_ITEMS[keyword]} {short[0] + first}: expected {width} numbers, "
            f"found {counts[short[0]]}",
            int(rows.origins[short[0]]) - 1,
        )
        source.refuse_error(error, len(short), part, short + first)
    table = np.full((len(counts), width), np.nan)
    long = counts >= width
    table[long] = values[firsts[:-1][long, None] + np.arange(width)]
    return table, counts, values, rows


def mended_faces(source: Source, lines: Lines, before: dict[str, int]) -> FaceRows:
    """Read the faces of some lines; see ``read_faces``.

    Parameters
    ----------
    source : Source
        Takes the faults of faces that are left out.
    lines : Lines
        Some lines of it.
    before : dict of str to int
        How many lines of each keyword came before these.

    Returns
    -------
    FaceRows
        With what must be said when it is known which triangles a face becomes.
    """
    rows = rows_of(lines, "f")
    begins = word_begins(rows.letters)
    counts = np.diff(np.searchsorted(begins, rows.starts))
    owners = np.repeat(np.arange(len(counts)), counts)
    small = np.flatnonzero(counts < FEWEST)
    if len(small):
        found = f"f: expected {FEWEST} or more corners, found {counts[small[0]]}"
        source.refuse_error(source.error(found, int(rows.origins[small[0]]) - 1), len(small))
    written, lost = _corners(rows, begins)
    kept = counts >= FEWEST
    places = (np.cumsum(kept) - 1)[owners]
    faults = []
    broken = np.flatnonzero(lost & kept[owners])
    if len(broken):
        error = _corner_error(source, rows.offset(int(begins[broken[0]])))
        faults.append((error, len(broken), places[broken]))
    for column, (keyword, kind) in enumerate(CORNER_KINDS.items()):
        numbers = written[:, column]
        known = before[keyword] + np.searchsorted(lines.of[keyword], lines.of["f"])[owners]
        far = np.flatnonzero((-numbers > known) & ~lost & kept[owners])
        if len(far):
            limits = f"-1 to {-known[far[0]]}" if known[far[0]] else "after the first"
            offset = rows.offset(int(begins[far[0]]))
            error = _index_error(source, kind, limits, int(numbers[far[0]]), offset)
            faults.append((error, len(far), places[far]))
            lost[far] = True
        numbers[numbers < 0] += known[numbers < 0] + 1
    written[lost] = _LOST, 0, 0
    return FaceRows(counts[kept], written[kept[owners]] - 1, rows.origins[kept] - 1, tuple(faults))


def _corner_error(source: Source, offset: int) -> FormatError:
    word = source.next_word(offset)
    assert word is not None  # it was found there
    if _ZERO.search(word.group()):
        return source.error("f: expected an index from 1, found 0", offset)
    return source.error(f"f: {CORNER}, found {quoted(word.group())}", offset)


def _corners(rows: Rows, begins: Places) -> tuple[Places, Bools]:
    """Return the numbers of every corner, 0 where there is none, (C, 3), and which are broken."""
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
        # Indices count from 1: a 0 is none, and must not be taken for a missing one.
        numbers[chosen, column] = np.where(given == 0.0, np.nan, given)
    whole = np.clip(np.nan_to_num(numbers), -(2.0**40), 2.0**40).astype(np.int64)
    lost = ~fits | (whole != numbers).any(axis=1) | (whole[:, 0] == 0)
    return whole, lost


def settled_corners(
    source: Source, faces: list[FaceRows], ends: dict[str, int], limit: Callable[[str], str]
) -> Places:
    """Return the corners of all faces, those that nothing has replaced by others of their face.

    Parameters
    ----------
    source : Source
        Takes the faults.
    faces : list of FaceRows
        All of the file.
    ends : dict of str to int
        How many lines of each keyword there are.
    limit : callable
        Says which indices a keyword allows.

    Returns
    -------
    (C, 3)
        Of texture coordinates and normals -1 where the index is wrong.
    """
    counts = np.concatenate([np.zeros(0, np.int64), *(rows.counts for rows in faces)])
    corners = np.concatenate([np.zeros((0, 3), np.int64), *(rows.corners for rows in faces)])
    offsets = np.concatenate([np.zeros(0, np.int64), *(rows.offsets for rows in faces)])
    first = 0
    for rows in faces:
        for error, count, places in rows.faults:
            source.refuse_error(error, count, "triangles", triangles_of(counts, places + first))
        first += len(rows.counts)
    owners = np.repeat(np.arange(len(counts)), counts)
    for column, (keyword, kind) in enumerate(CORNER_KINDS.items()):
        wrong = np.flatnonzero(corners[:, column] >= ends[keyword])
        if len(wrong):
            error = _index_error(source, kind, limit(keyword), corners[wrong[0], column] + 1,
                                 int(offsets[owners[wrong[0]]]))  # fmt: skip
            part: Part = "triangles" if column == 0 else ""
            source.refuse_error(error, len(wrong), part, triangles_of(counts, owners[wrong]))
            corners[wrong, column] = -1
    corners[:, 0] = first_known(corners[:, 0], counts, owners)
    return corners


def _index_error(source: Source, kind: str, limits: str, found: int, offset: int) -> FormatError:
    return source.error(f"f: expected a {kind} {limits}, found {found}", offset)
