"""The ``bindings`` section of a ``.skin`` file."""

from __future__ import annotations

import re

import numpy as np

from viewer.formats._skin_blocks import block_numbers, find_block, opened
from viewer.formats._source import Source, shown
from viewer.rig.arrays import Floats

__all__ = ["read_bindings"]

Word = re.Match[bytes]


def read_bindings(source: Source, count: int, header: Word, position: int) -> tuple[Floats, int]:
    """Return B = [a b c d; 0 0 0 1] for each binding, (count, 4, 4), and the offset behind."""
    word = source.next_word(position)
    if word is not None and word.group() == b"{":
        position = word.end()
    matrices: list[Floats] = []
    while (word := source.next_word(position)) is not None and word.group() == b"matrix":
        rows, position = _read_matrix(source, len(matrices), word)
        matrices.append(rows)
    if len(matrices) != count:
        found = f"{len(matrices)} matrices, then " + (
            "the end of the file" if word is None else shown(word.group())
        )
        where = len(source.data.rstrip()) if word is None else word.start()
        raise source.error(
            f"bindings (line {source.line(header.start())}): expected {count} matrices, "
            f"found {found}",
            where,
        )
    if word is None:
        source.warn('the last "}" is missing: bindings ends with the file')
    elif word.group() != b"}":
        raise source.error(f'bindings: expected "}}", found {shown(word.group())}', word.start())
    bindings = np.tile(np.eye(4), (count, 1, 1))
    if matrices:
        bindings[:, :3, :] = np.array(matrices).reshape(-1, 4, 3).transpose(0, 2, 1)
    return bindings, len(source.data) if word is None else word.end()


def _read_matrix(source: Source, index: int, word: Word) -> tuple[Floats, int]:
    block = find_block(source, f"matrix {index} of bindings", word, word.end())
    values = block_numbers(source, block)
    if not block.closed:
        raise source.error(
            f'expected "}}" to close {opened(source, block)}, found the end of the file',
            len(source.data.rstrip()),
        )
    if len(values) != 12:
        raise source.error(
            f"matrix {index} of bindings: expected 12 numbers, found {len(values)}", word.start()
        )
    return values, block.end + 1
