"""Lines of an ``.obj``, grouped by keyword, in pieces of a few hundred thousand bytes.

All lines of a piece with the same keyword are parsed together. Pieces that fit into the processor's
cache make this several times faster than parsing whole files.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Part, Phrase, wording
from viewer.formats._source import Source
from viewer.formats._text.numbers import parse_words, word_begins
from viewer.formats._text.words import Words, refuse_words
from viewer.phrases import counted
from viewer.rig.arrays import Bools, Floats

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
Places = NDArray[np.int64]
Letters = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Lines:
    """Some lines of a file."""

    base: int
    """Offset of the first line in the file."""
    data: bytes
    """Text of the lines; continued lines are joined with spaces."""
    letters: Letters
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
class Rows:
    """The text after the keyword of all lines with the same keyword."""

    body: bytes
    """One line after the other."""
    letters: Letters
    """(N,) uint8. ``body`` as an array."""
    starts: Places
    """(n + 1,). Start of each line in ``body``."""
    origins: Places
    """(n,). Start of each line in the file."""

    def offset(self, place: int) -> int:
        """Return the offset in the file of a position in the body."""
        row = int(np.searchsorted(self.starts, place, side="right")) - 1
        return int(self.origins[row] + place - self.starts[row])


NumberRows = tuple[Floats, Places, Floats, Rows]
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
    ends = np.flatnonzero((letters == 10) | (letters == 13)) + 1
    starts = np.concatenate([[0], ends[:-1]])
    indented = np.flatnonzero(_is_blank(letters[starts]))
    if len(indented):
        inked = np.append(np.flatnonzero(~_is_blank(letters)), len(letters))
        first = inked[np.searchsorted(inked, starts[indented])]
        starts[indented] = np.minimum(first, ends[indented] - 1)  # the end of an empty line
    first, second, third = (letters.take(starts + k, mode="clip") for k in range(3))
    ends_at_1, ends_at_2 = _is_blank(second), _is_blank(third)
    is_v = first == ord("v")
    known = {
        "v": is_v & ends_at_1,
        "vt": is_v & (second == ord("t")) & ends_at_2,
        "vn": is_v & (second == ord("n")) & ends_at_2,
        # "fo" is an obsolete keyword for "f".
        "f": (first == ord("f")) & (ends_at_1 | ((second == ord("o")) & ends_at_2)),
    }
    rest = ~(_is_blank(first) | (first == ord("#")))
    for chosen in known.values():
        rest &= ~chosen
    of = {keyword: np.flatnonzero(chosen) for keyword, chosen in known.items()}
    return Lines(base, data, letters, starts, ends, of, np.flatnonzero(rest))


def _is_blank(letters: Letters) -> Bools:
    # The subtraction wraps around, so that one comparison finds the characters 9 to 13.
    return (letters == 32) | (letters - np.uint8(9) < 5)


def number_rows(source: Source, lines: Lines, keyword: str, width: int, first: int) -> NumberRows:
    """Parse the numbers after a keyword; NaN in rows too short and for invalid words."""
    rows = rows_of(lines, keyword)
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


def rows_of(lines: Lines, keyword: str) -> Rows:
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


def _plain_rows(letters: Letters, starts: Places, origins: Places, keyword: str) -> Rows:
    """Return rows with blanks in place of comments and of slashes without a number after them."""
    body = letters.tobytes()
    plain = without_comments(body)
    if keyword == "f" and any(end in plain for end in _OPEN_ENDS):
        plain = _OPEN_END.sub(_blanks, plain)
    if plain is not body:
        letters = np.frombuffer(plain, dtype=np.uint8)
    return Rows(plain, letters, starts, origins)


def without_comments(text: bytes) -> bytes:
    """Return numbers with blanks in place of comments, which may follow them in a line."""
    return _COMMENT.sub(_blanks, text) if b"#" in text else text


def _blanks(found: re.Match[bytes]) -> bytes:
    return b" " * len(found.group())
