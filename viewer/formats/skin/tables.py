"""Blocks of numbers in a ``.skin`` file: positions, normals, texture coordinates, triangles.

A valid block is parsed as a whole. Otherwise every word is examined: each error is recorded and the
value replaced by NaN. Line breaks have no meaning in the format, but most files have one vertex or
triangle per line. In this case, a line of the wrong length does not affect the others.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Part, Phrase, wording
from viewer.errors import FormatError
from viewer.formats._source import Source
from viewer.formats._text.numbers import parse_numbers, to_number
from viewer.phrases import counted, optional, quoted
from viewer.rig.arrays import Floats, Ints

if TYPE_CHECKING:
    from viewer.formats._text.words import Words

KEYWORDS = frozenset(
    (b"positions", b"normals", b"texcoords", b"skinweights", b"material", b"triangles", b"bindings")
)
"""Keywords of sections."""
LOST = -(2**31)
"""Placeholder for a corner that is not an integer."""
_INT32 = 2.0**31  # numbers below it, and at least its negative, fit into an int32
_PARTS: dict[str, Part] = {"positions": "positions", "triangles": "triangles"}
_Word = re.Match[bytes]
_Places = NDArray[np.int64]
OffsetOf = Callable[[int], int]
"""Returns the offset of the element with an index; slow, for errors only."""


@dataclass(frozen=True, slots=True)
class Block:
    """Range of a section's numbers, from which the line of an error is determined."""

    name: str
    """Keyword of the section."""
    header: int
    count: int
    """Offsets of the keyword and of the number of entries."""
    start: int
    end: int
    """Range of the numbers."""
    closed: bool
    """Whether a closing brace follows them."""


def find_block(source: Source, name: str, header: _Word, position: int) -> Block:
    """Return the range of a section's numbers; weights may omit the opening brace."""
    stated = position - 1
    brace = source.next_word(position)
    if brace is not None and brace.group() == b"{":
        position = brace.end()
    elif name != "skinweights":
        where = header.start() if brace is None else brace.start()
        raise source.fault(
            wording.SKIN_BRACE, where, section=name, found=quoted(brace and brace.group())
        )
    end = source.data.find(b"}", position)
    closed = end >= 0
    return Block(
        name, header.start(), stated, position, end if closed else len(source.data), closed
    )


def read_count(source: Source, name: str, word: _Word) -> tuple[int, int]:
    """Return a section's count and the offset after it; refuse counts that do not fit the file."""
    found = source.next_word(word.end())
    value = None if found is None else to_number(found.group())
    if found is None or value is None or value != int(value) or value < 0:
        at = word.start() if found is None else found.start()
        raise source.fault(
            wording.COUNT, at, item=name, found=quoted(found.group() if found else None)
        )
    # An entry takes at least two bytes: one character, and white space before it.
    left = len(source.data) - found.end()
    if value * 2 > left + 1:
        raise source.fault(
            "F002.skin-too-many: {section}: expected a count that fits the file, found {found} "
            "entries in {size} bytes",
            found.start(),
            section=name,
            found=int(value),
            size=left,
        )
    return int(value), found.end()


def read_rows(
    source: Source,
    block: Block,
    count: int,
    width: int,
    first: int = 0,
    item: str = "{section} of vertex {index}",
) -> tuple[Floats, OffsetOf]:
    """Parse rows (N, width), NaN in invalid ones; returns also what finds a row's offset."""
    values, bad = parse_numbers(source.data, block.start, block.end)
    if bad < 0 and len(values) == count * width:
        values.flags.writeable = False  # the mesh can use a read-only array without a copy
        begin, end = block.start, block.end
        return values.reshape(count, width), lambda row: source.number_offset(
            begin, end, width * row
        )
    rows, offsets = _faulty_rows(source, block, count, width, first, item)
    return rows, lambda row: int(offsets[row])


def _faulty_rows(
    source: Source, block: Block, count: int, width: int, first: int, item: str
) -> tuple[Floats, _Places]:
    from viewer.formats._text.words import refuse_words

    def named(row: int) -> Phrase:
        return Phrase(item, section=block.name, index=row)

    words = words_of(source, block)
    begins, sizes = _row_begins(source, block, words, count, width)
    fits = sizes == width
    rows = np.full((len(begins), width), np.nan)
    rows[fits] = words.values[begins[fits, None] + np.arange(width)]
    part = _PARTS.get(block.name, "")
    owners = np.repeat(np.arange(len(begins)), sizes) + first
    bad = words.bad
    refuse_words(source, words, bad, lambda word: named(int(owners[word])), part, owners[bad])
    wrong = np.flatnonzero(~fits)
    if len(wrong):
        source.refuse(
            wording.WIDTH,
            int(words.offsets[begins[wrong[0]]]),
            len(wrong),
            part,
            wrong + first,
            item=named(int(wrong[0]) + first),
            expected=counted(width, "number"),
            found=int(sizes[wrong[0]]),
        )
    if block.name == "triangles" and len(begins) != count:
        source.refuse(
            "F002.skin-triangle-rows: triangles: expected {expected} rows of 3 numbers, found "
            "{found}",
            block.header,
            expected=count,
            found=len(begins),
        )
    return rows, words.offsets[begins]


def _row_begins(
    source: Source, block: Block, words: Words, count: int, width: int
) -> tuple[_Places, _Places]:
    """Return the first word and the number of words of each row."""
    total = len(words.values)
    if total != count * width:
        begins, sizes = words.rows()
        if block.closed and (sizes == width).sum() * 2 >= len(sizes):
            return begins, sizes
        if not block.closed:
            raise source.fault(
                'F002.skin-rows-end: expected "}}" to close {section} (line {line}), found the '
                "end of the file after {found} of {expected} rows",
                source.end,
                section=block.name,
                line=source.line(block.header),
                found=total // width,
                expected=count,
            )
        if total % width:
            raise source.fault(
                "F002.skin-rows: {section}: expected {expected} rows of {width} numbers, found "
                "{found}{rest} (to line {end})",
                block.count,
                section=block.name,
                expected=count,
                width=width,
                found=total // width,
                rest=optional(" and {} numbers", total % width),
                end=source.line(block.end),
            )
    begins = np.arange(0, total, width)
    return begins, np.full(len(begins), width)


def words_of(source: Source, block: Block) -> Words:
    """Return the words of a block, which must be closed before the keyword of another section."""
    from viewer.formats._text.words import read_words

    words = read_words(source.data, block.start, block.end)
    for index in words.bad.tolist():
        word = words.word(index)
        if word in KEYWORDS or b"{" in word:
            raise unclosed(source, block, int(words.offsets[index]), word)
    return words


def unclosed(source: Source, block: Block, offset: int, found: bytes | None) -> FormatError:
    """Return the error for a block interrupted by ``found``, or by the end of the file if None."""
    line = source.line(block.header)
    return source.fault(
        wording.UNCLOSED, offset, section=block.name, line=line, found=quoted(found)
    )


def whole_corners(source: Source, rows: Floats, offset_of: OffsetOf, first: int) -> Ints:
    """Return corners (T, 3) as integers; ``LOST`` for invalid ones, with their errors recorded."""
    known = ~np.isnan(rows)
    if known.all():
        corners, changed = to_whole(rows)
        if changed < 0:
            return corners
    corners, _ = to_whole(np.where(known, rows, LOST))
    wrong = known & (corners != rows)
    triangles = np.flatnonzero(wrong.any(axis=1))
    if len(triangles):
        row = int(triangles[0])
        source.refuse(
            "F002.skin-corner: triangle {triangle}: expected a vertex index, found {found:g}",
            offset_of(row),
            int(wrong.sum()),
            "triangles",
            triangles + first,
            triangle=row + first,
            found=float(rows[row][wrong[row]][0]),
        )
    return np.where(wrong, LOST, corners).astype(np.int32)


def to_whole(values: Floats) -> tuple[Ints, int]:
    """Return numbers as int32, and the index of the first number that conversion changed, or -1."""
    whole = np.clip(values, -_INT32, _INT32 - 1).astype(np.int32)
    differs = whole != values
    whole.flags.writeable = False  # a read-only array need not be copied
    return whole, int(differs.argmax()) if differs.any() else -1
