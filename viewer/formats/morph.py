r"""Read ``.morph`` targets (UCSD course CSE169).

::

    morph = "positions" n "{" (index x y z)*n "}"  "normals" n "{" (index x y z)*n "}"

Positions and normals are absolute, not offsets, for the listed vertices of one ``.skin``; all
others stay. The two sections may come in either order and list their vertices in any; normals may
be left out.
"""

from __future__ import annotations

import re

import numpy as np

from viewer.errors import FormatError
from viewer.formats._numbers import to_number
from viewer.formats._skin.blocks import (
    Block,
    block_rows,
    find_block,
    opened,
    to_whole,
    word_at,
)
from viewer.formats._source import Source
from viewer.phrases import quoted
from viewer.rig.arrays import Floats, Ints
from viewer.rig.morph_target import MorphTarget

__all__ = ["read"]

_WIDTH = 4  # an index, x, y, z
_SECTIONS = (b"positions", b"normals")

Rows = tuple[Ints, Floats, Block]


def read(source: Source) -> MorphTarget:
    """Read a target.

    Parameters
    ----------
    source : Source
        The file; what is odd but readable is added to its warnings.

    Returns
    -------
    MorphTarget
        Named after the file; its vertices ascend.

    Raises
    ------
    FormatError
        With file and line, if the text breaks the grammar, or the sections list other vertices.
    """
    sections: dict[bytes, Rows] = {}
    position = 0
    while (word := source.next_word(position)) is not None:
        name = word.group()
        if name not in _SECTIONS or name in sections:
            raise _unexpected(source, word, name in sections)
        sections[name], position = _section(source, name.decode(), word)
    if b"positions" not in sections:
        looks = source.looks_like()
        hint = f" ({looks})" if looks else ""
        raise source.error(f"no positions section{hint}", None if looks else source.end)
    vertices, positions, _ = sections[b"positions"]
    if not len(vertices):
        source.warn("moves no vertex")
    if b"normals" not in sections:
        source.warn("no normals section: normals stay as they are")
        return MorphTarget(source.path.stem, vertices, positions)
    _check_same(source, sections)
    return MorphTarget(source.path.stem, vertices, positions, sections[b"normals"][1])


def _unexpected(source: Source, word: re.Match[bytes], is_repeated: bool) -> FormatError:
    if is_repeated:
        return source.error(
            f"expected one section of {word.group().decode()}, found another", word.start()
        )
    return source.error(
        f"expected positions or normals, found {quoted(word.group())}", word.start()
    )


def _section(source: Source, name: str, header: re.Match[bytes]) -> tuple[Rows, int]:
    """Read a section: its vertices in ascending order, their numbers, and where it ends."""
    count, position = _count(source, name, header)
    block = find_block(source, name, header, position)
    rows = block_rows(source, block, count, _WIDTH)
    vertices, wrong = to_whole(rows[:, 0])
    if wrong < 0 and len(vertices) and vertices.min() < 0:
        wrong = int(vertices.argmin())
    if wrong >= 0:
        offset, word = word_at(source, block, _WIDTH * wrong)
        raise source.error(f"{name}: expected a vertex index, found {quoted(word)}", offset)
    order = np.argsort(vertices, kind="stable")
    vertices = vertices[order]
    twice = np.flatnonzero(np.diff(vertices) == 0)
    if len(twice):
        offset, word = word_at(source, block, _WIDTH * int(order[twice[0] + 1]))
        raise source.error(f"{name}: vertex {quoted(word)} is listed twice", offset)
    if not block.closed:
        source.warn(f'the last "}}" is missing: {name} ends with the file')
    return (vertices, rows[order, 1:], block), block.end + block.closed


def _count(source: Source, name: str, header: re.Match[bytes]) -> tuple[int, int]:
    """Read a section's count; refuse one that the rest of the file cannot hold."""
    word = source.next_word(header.end())
    if word is None:
        raise source.error(f"{name}: expected a count, found the end of the file", header.start())
    value, left = to_number(word.group()), len(source.data) - word.end()
    if value is None or value != int(value) or value < 0:
        raise source.error(f"{name}: expected a count, found {quoted(word.group())}", word.start())
    # Even an entry of one letter needs white space before it.
    if value * 2 > left + 1:
        raise source.error(
            f"{name}: expected a count that the file can hold, found {int(value)} entries "
            f"in {left} bytes",
            word.start(),
        )
    return int(value), word.end()


def _check_same(source: Source, sections: dict[bytes, Rows]) -> None:
    """Refuse positions and normals of different vertices."""
    (first, _, block), (second, _, other) = (sections[name] for name in _SECTIONS)
    if len(first) != len(second):
        raise source.error(
            f"{opened(source, block)} has {len(first)} vertices, "
            f"{opened(source, other)} has {len(second)}",
            other.header,
        )
    differs = np.flatnonzero(first != second)
    if len(differs):
        row = int(differs[0])
        raise source.error(
            f"normals: expected the vertices that positions has, found "
            f"{second[row]} instead of {first[row]}",
            other.header,
        )
