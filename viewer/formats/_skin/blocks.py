"""Blocks of numbers in a ``.skin`` file."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import FormatError
from viewer.formats._source import Source
from viewer.formats._text.numbers import to_number
from viewer.rig.arrays import Floats, Ints

if TYPE_CHECKING:
    from viewer.formats._text.words import Words

__all__ = ["KEYWORDS", "Block", "find_block", "read_count", "to_whole", "unclosed", "words_of"]

KEYWORDS = frozenset(
    (b"positions", b"normals", b"texcoords", b"skinweights", b"material", b"triangles", b"bindings")
)
"""Keywords of sections."""

_INT32 = 2.0**31

Word = re.Match[bytes]


@dataclass(frozen=True, slots=True)
class Block:
    """Range of a section's numbers, from which the line of an error is determined.

    Attributes
    ----------
    name : str
        Keyword of the section.
    header, count : int
        Offsets of the keyword and of the number of entries.
    start, end : int
        Range of the numbers.
    closed : bool
        Whether a closing brace follows them.
    """

    name: str
    header: int
    count: int
    start: int
    end: int
    closed: bool


def find_block(source: Source, name: str, header: Word, position: int) -> Block:
    """Return the range of a section's numbers; only weights may omit the opening brace.

    ``position`` is the offset after the section's count, or after its keyword if there is no count.
    """
    stated = position - 1
    brace = source.next_word(position)
    if brace is not None and brace.group() == b"{":
        position = brace.end()
    elif name != "skinweights":
        where = header.start() if brace is None else brace.start()
        raise source.fault("F002.skin-brace", where, section=name, found=brace and brace.group())
    end = source.data.find(b"}", position)
    closed = end >= 0
    return Block(
        name, header.start(), stated, position, end if closed else len(source.data), closed
    )


def read_count(source: Source, name: str, word: Word) -> tuple[int, int]:
    """Return a section's count and the offset after it; refuse counts that do not fit the file."""
    found = source.next_word(word.end())
    value = None if found is None else to_number(found.group())
    if found is None or value is None or value != int(value) or value < 0:
        at = word.start() if found is None else found.start()
        raise source.fault("F002.count", at, item=name, found=found and found.group())
    # An entry takes at least two bytes: one character, and white space before it.
    left = len(source.data) - found.end()
    if value * 2 > left + 1:
        raise source.fault(
            "F002.skin-too-many", found.start(), section=name, found=int(value), size=left
        )
    return int(value), found.end()


def words_of(source: Source, block: Block) -> Words:
    """Return the words of a block, which must not contain the keyword of another section.

    Raises
    ------
    FormatError
        If the block is not closed before another section begins.
    """
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
    return source.fault("F002.unclosed", offset, section=block.name, line=line, found=found)


def to_whole(values: Floats) -> tuple[Ints, int]:
    """Return numbers as int32, and the index of the first number that conversion changed, or -1."""
    whole = np.clip(values, -_INT32, _INT32 - 1).astype(np.int32)
    differs = whole != values
    whole.flags.writeable = False  # a read-only array need not be copied
    return whole, int(differs.argmax()) if differs.any() else -1
