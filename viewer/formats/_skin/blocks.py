"""Blocks of numbers in a ``.skin`` file: found, parsed, and every fault put into words."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from viewer.errors import FormatError
from viewer.formats._numbers import parse_numbers
from viewer.formats._source import Source, no_number
from viewer.phrases import quoted
from viewer.rig.arrays import Floats, Ints

__all__ = [
    "KEYWORDS",
    "Block",
    "block_numbers",
    "block_rows",
    "find_block",
    "opened",
    "to_whole",
    "unclosed",
    "whole_numbers",
    "word_at",
]

KEYWORDS = frozenset(
    (b"positions", b"normals", b"texcoords", b"skinweights", b"material", b"triangles", b"bindings")
)
"""Words that begin a section."""

_INT32 = 2.0**31

Word = re.Match[bytes]


@dataclass(frozen=True, slots=True)
class Block:
    """Where the numbers of a section are, to find a word again when an error needs its line.

    Attributes
    ----------
    name : str
        The section's.
    header, count : int
        Where its keyword and the number of its entries are.
    start, end : int
        Of the numbers.
    closed : bool
        Whether a brace follows them.
    """

    name: str
    header: int
    count: int
    start: int
    end: int
    closed: bool


def find_block(source: Source, name: str, header: Word, position: int) -> Block:
    """Return where a section's numbers are; only weights may leave out the opening brace.

    ``position`` is behind the section's count, or behind its keyword if it has none.
    """
    stated = position - 1
    brace = source.next_word(position)
    if brace is not None and brace.group() == b"{":
        position = brace.end()
    elif name != "skinweights":
        found = "the end of the file" if brace is None else quoted(brace.group())
        where = header.start() if brace is None else brace.start()
        raise source.error(f'{name}: expected "{{", found {found}', where)
    end = source.data.find(b"}", position)
    closed = end >= 0
    return Block(
        name, header.start(), stated, position, end if closed else len(source.data), closed
    )


def block_numbers(source: Source, block: Block) -> Floats:
    """Parse all numbers of a block."""
    values, bad = parse_numbers(source.data, block.start, block.end)
    if bad < 0:
        return values
    offset, word = word_at(source, block, bad)
    if word in KEYWORDS or word == b"{":
        raise unclosed(source, block, offset, word)
    raise source.error(f"{block.name}: {no_number(word)}", offset)


def unclosed(source: Source, block: Block, offset: int, word: bytes) -> FormatError:
    """Return the error that a word begins something else before a block ends."""
    return source.error(
        f'expected "}}" to close {opened(source, block)}, found {quoted(word)}', offset
    )


def opened(source: Source, block: Block) -> str:
    """Return what an error calls a block: its name and the line of its header."""
    return f"{block.name} (line {source.line(block.header)})"


def word_at(source: Source, block: Block, index: int) -> tuple[int, bytes]:
    """Return a word of a block and its offset; slow, for errors only."""
    offset = source.word_offset(block.start, index)
    word = source.next_word(offset)
    return offset, b"" if word is None else word.group()


def block_rows(source: Source, block: Block, count: int, width: int) -> Floats:
    """Parse a block of ``count`` rows of ``width`` numbers: (count, width)."""
    values = block_numbers(source, block)
    if len(values) == count * width:
        values.flags.writeable = False  # so that nobody has to copy it
        return values.reshape(count, width)
    if not block.closed:
        raise source.error(
            f'expected "}}" to close {opened(source, block)}, found the end of the file '
            f"after {len(values) // width} of {count} rows",
            len(source.data.rstrip()),
        )
    _raise_for_short_line(source, block, width)
    raise source.error(
        f"{block.name}: expected {count} rows of {width} numbers, "
        f"found {len(values) // width}"
        + (f" and {len(values) % width} numbers" if len(values) % width else "")
        + f" (to line {source.line(block.end)})",
        block.count,
    )


def _raise_for_short_line(source: Source, block: Block, width: int) -> None:
    """Find the line at fault: in files written row by row, the one that is not a row."""
    text = source.data[block.start : block.end]
    offset = block.start
    lines = text.splitlines(keepends=True)
    lengths = [len(line.split()) for line in lines]
    filled = [length for length in lengths if length]
    # Lines mean nothing to the format; only a file that keeps to them tells more this way.
    if sum(length == width for length in filled) * 2 < len(filled):
        return
    for line, length in zip(lines, lengths, strict=True):
        if length % width:
            start = offset + len(line) - len(line.lstrip())
            raise source.error(f"expected {width} numbers, found {length} ({block.name})", start)
        offset += len(line)


def whole_numbers(source: Source, block: Block, values: Floats, what: str) -> Ints:
    """Return whole numbers of a block as int32; what is none is an error."""
    whole, wrong = to_whole(values)
    if wrong >= 0:
        offset, word = word_at(source, block, wrong)
        raise source.error(f"{block.name}: expected {what}, found {quoted(word)}", offset)
    return whole


def to_whole(values: Floats) -> tuple[Ints, int]:
    """Return numbers as int32, and the place of the first that this changes, -1 for none."""
    whole = np.clip(values, -_INT32, _INT32 - 1).astype(np.int32)
    differs = whole != values
    whole.flags.writeable = False  # so that nobody has to copy it
    return whole, int(differs.argmax()) if differs.any() else -1
