"""Lines of an ``.obj``, grouped by keyword: the numbers of elements, and the corners of faces.

All lines with the same keyword in a piece of a few hundred thousand bytes are parsed together.
Pieces that fit into the processor's cache make this several times faster than parsing whole files.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Part, Phrase, wording
from viewer.formats._polygons import first_known, triangles_of
from viewer.formats._source import Source
from viewer.formats._text.numbers import (
    are_blank,
    line_ends,
    parse_words,
    to_number,
    word_begins,
)
from viewer.formats._text.words import Words, refuse_words
from viewer.phrases import counted, quoted
from viewer.rigs.arrays import Bools, Floats

KEYWORDS = ("v", "vt", "vn", "f")
"""Keywords of the lines that contain numbers."""
_PIECE = 1 << 18  # bytes per piece
_PAD = b"\n\n\n"  # padding, so that three characters can be read at the start of every line
_CONTINUED = re.compile(rb"\\(?:\r*\n|\r)")
_CONTINUES = re.compile(rb"\\(?:\r*\n|\r+)\Z")
_COMMENT = re.compile(rb"#[^\r\n]*")
_OPEN_END = re.compile(rb"(?<=\d)/+(?=\s)")  # as in 1/2/ or 1//, which some programs write
_OPEN_ENDS = b"/ ", b"/\n", b"/\r", b"/\t"
_ITEMS = {"v": "v of vertex {index}", "vt": "vt {index}", "vn": "vn {index}"}
_CORNER_NAMES = {"v": "vertex", "vt": "texture coordinate", "vn": "normal"}
"""Elements that the three numbers of a corner index, by keyword."""
_FEWEST = 3  # corners of a face
_SLASH = ord("/")
_LOST = -(2**40)  # represents an unknown vertex; no file has this many vertices
_Corners = NDArray[np.integer]
Places = NDArray[np.int64]
_Letters = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Lines:
    """Some lines of a file."""

    base: int
    """Offset of the first line in the file."""
    data: bytes
    """Text of the lines; continued lines are joined with spaces."""
    letters: _Letters
    """(N,) uint8. ``data`` as an array."""
    starts: Places
    ends: Places
    """(L,). First non-blank character of each line, and the offset after its end."""
    of: dict[str, Places]
    """Indices of the lines with each of ``KEYWORDS``."""
    others: Places
    """(n,). Indices of all other lines, without comments and empty lines."""

    def text(self, line: int) -> bytes:
        """Return one line without surrounding white space."""
        return self.data[self.starts[line] : self.ends[line]].strip()


@dataclass(frozen=True, slots=True)
class _Rows:
    """The text after the keyword of all lines with the same keyword."""

    body: bytes
    """One line after the other."""
    letters: _Letters
    """(N,) uint8. ``body`` as an array."""
    starts: Places
    """(n + 1,). Start of each line in ``body``."""
    origins: Places
    """(n,). Start of each line in the file."""

    def offset(self, place: int) -> int:
        """Return the offset in the file of a position in the body."""
        row = int(np.searchsorted(self.starts, place, side="right")) - 1
        return int(self.origins[row] + place - self.starts[row])


_NumberRows = tuple[Floats, Places, Floats, _Rows]
"""The first numbers of each line, (n, width), how many it has, (n,), all numbers, and the text."""


def pieces(source: Source) -> Iterator[Lines]:
    """Yield the whole file, piece by piece, with offsets relative to the file."""
    start = 0
    for data in _joined(source.line_parts(_PIECE)):
        if b"\\" in data:
            data = _CONTINUED.sub(_blanks, data)
        yield _split(data + _PAD, start)
        start += len(data)


def _joined(parts: Iterator[bytes]) -> Iterator[bytes]:
    """Join a part that ends within a continued line with the next one."""
    held: list[bytes] = []
    for part in parts:
        held.append(part)
        if not _CONTINUES.search(part):
            yield b"".join(held)
            held = []
    if held:
        yield b"".join(held)


def _split(data: bytes, base: int) -> Lines:
    letters = np.frombuffer(data, dtype=np.uint8)
    ends = line_ends(letters) + 1
    starts = np.concatenate([[0], ends[:-1]])
    indented = np.flatnonzero(are_blank(letters[starts]))
    if len(indented):
        inked = np.append(np.flatnonzero(~are_blank(letters)), len(letters))
        first = inked[np.searchsorted(inked, starts[indented])]
        starts[indented] = np.minimum(first, ends[indented] - 1)  # the end of an empty line
    first, second, third = (letters.take(starts + k, mode="clip") for k in range(3))
    ends_at_1, ends_at_2 = are_blank(second), are_blank(third)
    is_v = first == ord("v")
    known = {
        "v": is_v & ends_at_1,
        "vt": is_v & (second == ord("t")) & ends_at_2,
        "vn": is_v & (second == ord("n")) & ends_at_2,
        # "fo" is an obsolete keyword for "f".
        "f": (first == ord("f")) & (ends_at_1 | ((second == ord("o")) & ends_at_2)),
    }
    rest = ~(are_blank(first) | (first == ord("#")))
    for chosen in known.values():
        rest &= ~chosen
    of = {keyword: np.flatnonzero(chosen) for keyword, chosen in known.items()}
    return Lines(base, data, letters, starts, ends, of, np.flatnonzero(rest))


def number_rows(source: Source, lines: Lines, keyword: str, width: int, first: int) -> _NumberRows:
    """Parse the numbers after a keyword; NaN in rows too short and for invalid words."""
    rows = _rows_of(lines, keyword)
    begins = word_begins(rows.letters)
    values = parse_words(rows.body, 0, len(rows.body))
    firsts = np.searchsorted(begins, rows.starts)
    counts = np.diff(firsts)
    if np.isnan(values.sum()) or (counts < width).any():
        owners = np.repeat(np.arange(len(counts)), counts)
        offsets = rows.origins[owners] + begins - rows.starts[owners]
        words = Words(source.data, values, offsets, owners)
        part: Part = "positions" if keyword == "v" else ""
        bad = words.bad
        is_used = bad - firsts[owners[bad]] < width
        parts: tuple[Part, Part] = (part, "")  # only these numbers are checked
        for chosen, whose in zip((is_used, ~is_used), parts, strict=True):
            refuse_words(
                source,
                words,
                bad[chosen],
                lambda word: Phrase(_ITEMS[keyword], index=int(owners[word]) + first),
                whose,
                owners[bad[chosen]] + first,
            )
        short = np.flatnonzero(counts < width)
        if len(short):
            row = int(short[0])
            source.refuse(
                wording.WIDTH,
                int(rows.origins[row]) - 1,
                len(short),
                part,
                short + first,
                item=Phrase(_ITEMS[keyword], index=row + first),
                expected=counted(width, "number"),
                found=int(counts[row]),
            )
    if (counts == width).all():
        return values.reshape(-1, width), counts, values, rows
    table = np.full((len(counts), width), np.nan)
    long = counts >= width
    table[long] = values[firsts[:-1][long, None] + np.arange(width)]
    return table, counts, values, rows


def _rows_of(lines: Lines, keyword: str) -> _Rows:
    """Return the text after a keyword in all lines that have it."""
    chosen = lines.of[keyword]
    starts = lines.starts[chosen] + len(keyword)
    if keyword == "f":
        starts = starts + (lines.letters[starts] == ord("o"))
    ends = lines.ends[chosen]
    # Neighbours lose the line ends between them, where comments end.
    is_plain = b"#" not in lines.data
    if is_plain and len(chosen) and chosen[-1] - chosen[0] == len(chosen) - 1:
        first = int(lines.starts[chosen[0]])
        letters = lines.letters[first : ends[-1]].copy()
        places = starts - first
        # A keyword has at most two characters; any before the first one ends another line.
        for back in (1, 2):
            letters[np.maximum(places - back, 0)] = ord(" ")
        return _plain_rows(letters, np.append(places, len(letters)), starts + lines.base, keyword)
    steps = np.zeros(len(lines.letters) + 1, dtype=np.int8)
    steps[starts] += 1
    steps[ends] -= 1
    letters = lines.letters[np.cumsum(steps[:-1], dtype=np.int8).view(np.bool_)]
    places = np.concatenate([[0], np.cumsum(ends - starts)])
    return _plain_rows(letters, places, starts + lines.base, keyword)


def _plain_rows(letters: _Letters, starts: Places, origins: Places, keyword: str) -> _Rows:
    """Return rows with blanks in place of comments and of slashes without a number after them."""
    body = letters.tobytes()
    # Comments may follow the numbers of a line.
    plain = _COMMENT.sub(_blanks, body) if b"#" in body else body
    if keyword == "f" and any(end in plain for end in _OPEN_ENDS):
        plain = _OPEN_END.sub(_blanks, plain)
    if plain is not body:
        letters = np.frombuffer(plain, dtype=np.uint8)
    return _Rows(plain, letters, starts, origins)


def _blanks(found: re.Match[bytes]) -> bytes:
    return b" " * len(found.group())


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
    rows = _rows_of(lines, "f")
    begins = word_begins(rows.letters)
    counts = np.diff(np.searchsorted(begins, rows.starts))
    empty = np.flatnonzero(counts == 0)
    if len(empty):
        source.refuse(
            "F002.obj-face: f: expected at least {least} corners, found {found}",
            int(rows.origins[empty[0]]) - 1,
            len(empty),
            least=_FEWEST,
            found=0,
        )
    kept = counts >= _FEWEST
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
    for column, keyword in enumerate(_CORNER_NAMES):
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


def _corners(rows: _Rows, begins: Places) -> tuple[_Corners, Bools]:
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
    # Which corners are v, v/vt, v//vn or v/vt/vn, how many numbers they have, which are v//vn.
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


def _common_columns(rows: _Rows, begins: Places) -> list[int] | None:
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
    limits = np.array([ends[keyword] for keyword in _CORNER_NAMES])
    largest = [column.max(initial=-1) for column in corners.T]
    if not faults and (largest < limits).all():
        return corners
    for fault in faults:
        triangles = triangles_of(counts, fault.faces)
        source.refuse(
            fault.key, fault.offset, len(fault.faces), "triangles", triangles, **fault.values
        )
    owners = np.repeat(np.arange(len(counts)), counts)
    for column, keyword in enumerate(_CORNER_NAMES):
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
