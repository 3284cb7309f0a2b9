"""Parser for the ``f`` lines of an ``.obj``: vertex, texture coordinate and normal of corners."""

from __future__ import annotations

from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.formats._mesh.polygons import first_known, triangles_of
from viewer.formats._source import Source
from viewer.formats._text.numbers import parse_words, to_number, word_begins
from viewer.formats.obj.lines import Lines, Places, Rows, rows_of
from viewer.phrases import quoted
from viewer.rig.arrays import Bools

_CORNER_KINDS = ("v", "vt", "vn")
_CORNER_NAMES = {"v": "vertex", "vt": "texture coordinate", "vn": "normal"}
"""Keywords of the elements that the three numbers of a corner index."""
FEWEST = 3
"""Corners of a face."""
_SLASH = ord("/")
_LOST = -(2**40)
"""Represents an unknown vertex; no file has this many vertices."""
_Corners = NDArray[np.integer]


@dataclass(frozen=True, slots=True, eq=False)
class CornerFault:
    """Invalid corners with the same error."""

    key: str
    offset: int
    values: dict[str, Any]
    """The first error, as arguments of ``Source.refuse``."""
    faces: Places
    """(n,). Face of each corner."""


@dataclass(frozen=True, slots=True)
class FaceRows:
    """The corners of some faces, face after face."""

    counts: NDArray[np.integer]
    """(F,). Corners of each face, 3 or more."""
    corners: _Corners
    """(C, 3). 0-based vertex, texture coordinate and normal of each corner; -1 if missing. The
    range can be checked only when the whole file has been read."""
    offsets: Places
    """(F,). Offset of each face in the file."""
    faults: tuple[CornerFault, ...] = ()
    """Errors to record when the triangles of the faces are known."""
    edges: Places = field(default_factory=lambda: np.zeros(0, np.int64))
    """(E,). Which of the lines have one or two corners: Blender once wrote loose edges so."""


def read_faces(source: Source, lines: Lines, before: dict[str, int]) -> FaceRows:
    """Read the faces of some lines, without invalid ones; ``before``: elements before them."""
    rows = rows_of(lines, "f")
    begins = word_begins(rows.letters)
    counts = np.diff(np.searchsorted(begins, rows.starts))
    empty = np.flatnonzero(counts == 0)
    if len(empty):
        source.refuse(
            "F002.obj-face: f: expected at least {least} corners, found {found}",
            int(rows.origins[empty[0]]) - 1,
            len(empty),
            least=FEWEST,
            found=0,
        )
    kept = counts >= FEWEST
    owners = np.repeat(np.arange(len(counts)), counts)
    written, lost = _corners(rows, begins)
    is_kept = kept[owners]
    lost &= is_kept
    places = (np.cumsum(kept) - 1)[owners]
    faults = []
    broken = np.flatnonzero(lost)
    if len(broken):
        offset = rows.offset(int(begins[broken[0]]))
        faults.append(_corner_fault(source, offset, places[broken]))
    for column, keyword in enumerate(_CORNER_KINDS):
        numbers = written[:, column]
        back = np.flatnonzero((numbers < 0) & is_kept)
        if len(back) == 0:
            continue
        # Negative indices count back from the last element before the face.
        known = before[keyword] + np.searchsorted(lines.of[keyword], lines.of["f"])[owners[back]]
        far = np.flatnonzero((-numbers[back] > known) & ~lost[back])
        if len(far):
            kind, first = _CORNER_NAMES[keyword], int(back[far[0]])
            values = {"least": -int(known[far[0]]), "found": int(numbers[first])}
            key = (
                f"F002.obj-{keyword}-back: f: expected a {kind} index from -1 to {{least}}, found "
                "{found}"
                if known[far[0]]
                else f"F002.obj-{keyword}-early: f: expected a {kind} defined before this line, "
                "found {found}"
            )
            offset = rows.offset(int(begins[first]))
            faults.append(CornerFault(key, offset, values, places[back[far]]))
            lost[back[far]] = True
        numbers[back] += (known + 1).astype(numbers.dtype)
    if lost.any():
        written = written.astype(np.int64)
        written[lost] = _LOST, 0, 0
    if not kept.all():
        written = written[is_kept]
    edges = np.flatnonzero((counts > 0) & ~kept)
    return FaceRows(counts[kept], written - 1, rows.origins[kept] - 1, tuple(faults), edges)


def _corners(rows: Rows, begins: Places) -> tuple[_Corners, Bools]:
    """Return the numbers of every corner, 0 if missing, (C, 3), and a mask of invalid corners."""
    text = rows.body.replace(b"/", b" ")
    values = parse_words(text, 0, len(text))
    columns = _common_columns(rows, begins)
    # Indices count from 1, so an explicit 0 is invalid and differs from a missing index.
    if columns is not None and values.all() and not np.isnan(values.sum()):
        whole = np.clip(values, -(2.0**30), 2.0**30).astype(np.int32)
        if len(whole) == len(columns) * len(begins) and (whole == values).all():
            table = np.zeros((len(begins), 3), dtype=np.int32)
            table[:, columns] = whole.reshape(-1, len(columns))
            return table, np.zeros(len(begins), np.bool_)
    fits, n_numbers, has_gap = _fits_corner(rows, begins)
    firsts = np.cumsum(n_numbers) - n_numbers
    numbers = np.zeros((len(begins), 3))
    numbers[fits, 0] = values[firsts[fits]]
    for chosen, column, place in (
        (fits & (n_numbers > 1) & ~has_gap, 1, 1),
        (fits & has_gap, 2, 1),  # a gap moves the second number to the third column
        (fits & (n_numbers > 2), 2, 2),
    ):
        given = values[firsts[chosen] + place]
        numbers[chosen, column] = np.where(given == 0.0, np.nan, given)
    whole = np.clip(np.nan_to_num(numbers), -(2.0**40), 2.0**40).astype(np.int64)
    lost = ~fits | (whole != numbers).any(axis=1) | (whole[:, 0] == 0)
    is_small = np.abs(whole).max(initial=0) <= 2**30
    return whole.astype(np.int32) if is_small else whole, lost


def _common_columns(rows: Rows, begins: Places) -> list[int] | None:
    """Return the columns of the numbers of all corners; None if corners differ or seem invalid."""
    slashes = np.flatnonzero(rows.letters == _SLASH)
    if len(slashes) == 0:
        return [0]
    n_slashes = len(slashes) // len(begins)
    if n_slashes > 2 or n_slashes * len(begins) != len(slashes):
        return None
    table = slashes.reshape(-1, n_slashes)
    after = rows.letters.take(table[:, -1] + 1, mode="clip")
    is_inside = (table[:, 0] > begins) & (np.append(begins[1:], len(rows.letters)) > table[:, -1])
    if not (is_inside & (after > ord(" ")) & (after != _SLASH)).all():
        return None
    if n_slashes == 1:
        return [0, 1]
    gaps = table[:, 1] - table[:, 0]
    if (gaps == 1).all():
        return [0, 2]
    return [0, 1, 2] if (gaps > 1).all() else None


def _fits_corner(rows: Rows, begins: Places) -> tuple[Bools, Places, Bools]:
    """Classify corners (C,): is it v, v/vt, v//vn or v/vt/vn, its count of numbers, is it v//vn."""
    number_begins = word_begins(np.where(rows.letters == _SLASH, np.uint8(32), rows.letters))
    slashes = np.flatnonzero(rows.letters == _SLASH)
    after = np.append(begins[1:], len(rows.letters))
    n_slashes = np.searchsorted(slashes, after) - np.searchsorted(slashes, begins)
    n_numbers = np.searchsorted(number_begins, after) - np.searchsorted(number_begins, begins)
    # Only the middle number may be missing, as in "1//3": "1/", "/1" and "1///2" are invalid.
    doubles = slashes[:-1][np.diff(slashes) == 1]
    has_gap = np.searchsorted(doubles, after) - np.searchsorted(doubles, begins) == 1
    fits = np.where(has_gap, (n_slashes == 2) & (n_numbers == 2), n_numbers == n_slashes + 1)
    fits &= (
        (n_slashes <= 2) & (rows.letters[begins] != _SLASH) & (rows.letters[after - 1] != _SLASH)
    )
    return fits, n_numbers, has_gap


def _corner_fault(source: Source, offset: int, faces: Places) -> CornerFault:
    found = source.next_word(offset)
    word = b"" if found is None else found.group()
    if any(to_number(number) == 0.0 for number in word.split(b"/")):
        return CornerFault("F002.obj-zero: f: indices start at 1, found 0", offset, {}, faces)
    return CornerFault(
        "F002.obj-corner: f: expected a corner v, v/vt, v//vn or v/vt/vn, found {found}",
        offset,
        {"found": quoted(word)},
        faces,
    )


def checked_corners(
    source: Source, faces: FaceRows, faults: list[CornerFault], ends: dict[str, int]
) -> NDArray[np.integer]:
    """Return the corners (C, 3) with valid ones for invalid vertices, -1 for invalid vt and vn."""
    corners, counts = faces.corners, faces.counts
    limits = np.array([ends[keyword] for keyword in _CORNER_KINDS])
    largest = [column.max(initial=-1) for column in corners.T]
    if not faults and (largest < limits).all():
        return corners
    for fault in faults:
        triangles = triangles_of(counts, fault.faces)
        source.refuse(
            fault.key, fault.offset, len(fault.faces), "triangles", triangles, **fault.values
        )
    owners = np.repeat(np.arange(len(counts)), counts)
    for column, keyword in enumerate(_CORNER_KINDS):
        kind = _CORNER_NAMES[keyword]
        wrong = np.flatnonzero(corners[:, column] >= ends[keyword])
        if len(wrong):
            source.refuse(
                f"F002.obj-{keyword}-range: f: expected a {kind} index from 1 to {{limit}}, found "
                "{found}"
                if ends[keyword]
                else f"F002.obj-{keyword}-none: f: {kind} {{found}} is not defined: the file has "
                f"no {'vertices' if keyword == 'v' else f'{kind}s'}",
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
