"""The ``skinweights`` section of a ``.skin`` file."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.errors import FormatError
from viewer.formats._skin.blocks import Block, block_numbers, opened, to_whole, word_at
from viewer.formats._source import Source
from viewer.formats._tolerant import read_words
from viewer.phrases import quoted
from viewer.rig.arrays import Floats, Ints

__all__ = ["find_heads", "read_weights"]

_LEAP = 16  # vertices that one step of the Python loop passes over
_SMALL = 1 << 29  # numbers for which three times their count is an int32


def read_weights(source: Source, block: Block, count: int) -> tuple[Ints, Ints, Floats]:
    """Return where each vertex's influences start, their joints and their weights.

    Parameters
    ----------
    source : Source
        The file.
    block : Block
        Where the numbers are: a count and that many pairs of joint and weight per vertex.
    count : int
        Number of vertices.

    Raises
    ------
    FormatError
        With vertex and line.
    """
    values = block_numbers(source, block)
    heads = find_heads(values, count)
    if heads is None:
        raise _explain(source, block, values, count)
    is_pair = np.ones(len(values), dtype=bool)
    is_pair[heads] = False
    pairs = values[is_pair].reshape(-1, 2)
    joints, wrong = to_whole(pairs[:, 0])
    if wrong >= 0:
        place = int(np.flatnonzero(is_pair)[2 * wrong])
        vertex = int(np.searchsorted(heads, place)) - 1
        raise _error(source, block, vertex, place, "a joint index")
    starts = np.zeros(count + 1, dtype=np.int32)
    np.cumsum(values[heads].astype(np.int32), out=starts[1:])
    weights = pairs[:, 1].copy()
    starts.flags.writeable = weights.flags.writeable = False  # so that nobody has to copy them
    return starts, joints, weights


def find_heads(values: Floats, count: int) -> NDArray[np.integer] | None:
    """Return the places of the vertices' counts, (V,), or None if they do not fill the block.

    Each count tells where the next one is, so they can only be followed one by one. Squaring
    the map "place to next place" four times makes each step of that loop pass 16 vertices.
    """
    size = len(values)
    if count == 0:
        return None if size else np.zeros(0, np.int32)
    # Two places behind the last: the end of the block, and beyond it; they lead to the latter.
    kind: type[np.int32] | type[np.int64] = np.int32 if size < _SMALL else np.int64
    after = np.full(size + 2, size + 1, dtype=kind)
    counts: NDArray[Any] = np.clip(values, 0, size).astype(kind)
    is_count = counts == values
    counts *= 2
    counts += np.arange(1, size + 1, dtype=kind)
    is_count &= counts <= size
    np.copyto(after[:size], counts, where=is_count)
    leap = after
    for _ in range(_LEAP.bit_length() - 1):
        leap = leap[leap]
    anchors = [0]
    for _ in range((count - 1) // _LEAP):
        anchors.append(int(leap[anchors[-1]]))
    columns = [np.array(anchors, dtype=kind)]
    for _ in range(_LEAP - 1):
        columns.append(after[columns[-1]])
    heads = np.stack(columns, axis=1).ravel()[:count]
    fills = heads[-1] < size and after[heads[-1]] == size
    return heads if fills else None


def _explain(source: Source, block: Block, values: Floats, count: int) -> FormatError:
    """Follow the counts once more, slowly, to where they go wrong."""
    misstated = _misstated(source, block, count)
    if misstated is not None:
        return misstated
    numbers = values.tolist()
    heads: list[int] = []
    position = 0
    while position < len(numbers) and len(heads) < count:
        heads.append(position)
        length = numbers[position]
        if length < 0 or length != int(length):
            return _error(source, block, len(heads) - 1, position, "a number of influences")
        position += 1 + 2 * int(length)
    return _count_error(source, block, count, heads, len(numbers))


def _misstated(source: Source, block: Block, count: int) -> FormatError | None:
    """Return the error of a line whose count is not that of its pairs, or of too many lines.

    Lines mean nothing to the format. Only where most are a vertex each do they tell more than the
    counts, which all shift behind one that is wrong; None for other files.
    """
    words = read_words(source.data, block.start, block.end)
    heads, sizes = words.rows()
    fits = words.values[heads] * 2 + 1 == sizes
    if not block.closed or fits.sum() * 2 <= len(fits):
        return None
    wrong = np.flatnonzero(~fits)
    if len(wrong) == 0:
        return source.error(
            f"skinweights: expected {count} vertices, found {len(heads)} "
            f"(to line {source.line(block.end)})",
            block.count,
        )
    vertex = int(wrong[0])
    head = int(heads[vertex])
    stated = words.values[head]
    if stated < 0 or stated % 1:
        return _error(source, block, vertex, head, "a number of influences")
    return source.error(
        f"skinweights of vertex {vertex}: expected {quoted(words.word(head))[1:-1]} pairs of joint "
        f"and weight, found {int(sizes[vertex]) - 1} numbers in the line",
        int(words.offsets[head]),
    )


def _error(source: Source, block: Block, vertex: int, place: int, wanted: str) -> FormatError:
    offset, word = word_at(source, block, place)
    return source.error(
        f"skinweights of vertex {vertex}: expected {wanted}, found {quoted(word)}", offset
    )


def _count_error(
    source: Source, block: Block, count: int, heads: list[int], n_numbers: int
) -> FormatError:
    if not block.closed:
        return source.error(
            f'expected "}}" to close {opened(source, block)}, found the end of the file '
            f"after {len(heads)} of {count} vertices",
            len(source.data.rstrip()),
        )
    if len(heads) < count:
        return source.error(
            f"skinweights: expected {count} vertices, found {len(heads)} "
            f"(to line {source.line(block.end)})",
            block.count,
        )
    if count == 0:
        return source.error(
            f"skinweights: expected no vertices, found {n_numbers} numbers", block.count
        )
    offset, word = word_at(source, block, heads[-1])
    return source.error(
        f"skinweights of vertex {count - 1}, the last: expected {word.decode()} pairs of joint "
        f"and weight, found {n_numbers - heads[-1] - 1} numbers up to the closing brace",
        offset,
    )
