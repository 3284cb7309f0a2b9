"""The ``bindings`` section of a ``.skin`` file."""

from __future__ import annotations

import re

import numpy as np

from viewer.errors import counted
from viewer.formats._skin.blocks import Block, block_numbers, find_block, opened
from viewer.formats._source import Source
from viewer.formats._tolerant import read_words, refuse_words
from viewer.phrases import quoted
from viewer.rig.arrays import Floats

__all__ = ["read_bindings"]

_NEUTRAL: Floats = np.eye(4, 3).ravel()  # as the file has it, row by row

Word = re.Match[bytes]


def read_bindings(source: Source, count: int, position: int) -> tuple[Floats, int]:
    """Return B = [a b c d; 0 0 0 1] for each binding, (count, 4, 4), and the offset behind."""
    stated = position - 1
    word = source.next_word(position)
    if word is not None and word.group() == b"{":
        position = word.end()
    matrices: list[Floats] = []
    offsets: list[int] = []
    while (word := source.next_word(position)) is not None and word.group() == b"matrix":
        rows, position = _read_matrix(source, len(matrices), word)
        matrices.append(rows)
        offsets.append(word.start())
    source.remember("bindings", offsets.__getitem__)
    if len(matrices) != count:
        is_whole = word is not None and word.group() == b"}"
        there = "the end of the file" if word is None else quoted(word.group())
        end = source.end if word is None else word.start()
        # A count that is wrong is the fault; if the text breaks off, the end of it is.
        where, other = (stated, end) if is_whole else (end, stated)
        error = source.error(
            f"bindings ({'to' if is_whole else 'from'} line {source.line(other)}): expected "
            f"{counted(count, 'matrix')}, found {counted(len(matrices), 'matrix')}, then {there}",
            where,
        )
        if not is_whole:
            error.code = "F002"  # the text is broken, whatever was bound
            raise error
        source.refuse_error(error)
    if word is None:
        source.warn('the last "}" is missing: bindings ends with the file')
    elif word.group() != b"}":
        raise source.error(f'bindings: expected "}}", found {quoted(word.group())}', word.start())
    bindings = np.tile(np.eye(4), (len(matrices), 1, 1))
    if matrices:
        bindings[:, :3, :] = np.array(matrices).reshape(-1, 4, 3).transpose(0, 2, 1)
    return bindings, len(source.data) if word is None else word.end()


def _mended(source: Source, block: Block, index: int) -> Floats:
    """Return the numbers of a matrix, a neutral one if some are none."""
    words = read_words(source.data, block.start, block.end)
    bad = words.bad
    if len(bad) == 0 or any(b"{" in words.word(place) for place in bad.tolist()):
        return block_numbers(source, block)
    places = np.full(len(bad), index)
    refuse_words(source, words, bad, lambda _: block.name, "bindings", places)
    return _NEUTRAL


def _read_matrix(source: Source, index: int, word: Word) -> tuple[Floats, int]:
    block = find_block(source, f"matrix {index} of bindings", word, word.end())
    values = (
        block_numbers(source, block) if source.faults is None else _mended(source, block, index)
    )
    if not block.closed:
        raise source.error(
            f'expected "}}" to close {opened(source, block)}, found the end of the file',
            len(source.data.rstrip()),
        )
    if len(values) != 12:
        message = f"matrix {index} of bindings: expected 12 numbers, found {len(values)}"
        source.refuse_error(source.error(message, word.start()), 1, "bindings", [index])
        return _NEUTRAL, block.end + 1
    return values, block.end + 1
