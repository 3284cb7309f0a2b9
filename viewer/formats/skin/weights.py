"""Reader and writer of the ``skinweights`` section of a ``.skin`` file.

It has a count for each vertex, followed by as many pairs of joint and weight. Valid numbers are
parsed together; otherwise every word is examined, and an unreadable vertex gets no influence.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from viewer.diagnostics import Phrase, wording
from viewer.errors import FormatError
from viewer.formats._source import Source
from viewer.formats._text.number_text import dumped
from viewer.formats._text.numbers import parse_numbers
from viewer.formats.skin.tables import Block, OffsetOf, to_whole, words_of
from viewer.phrases import bare, quoted
from viewer.rig.arrays import Floats, Ints
from viewer.rig.skin import Skin

if TYPE_CHECKING:
    from viewer.formats._text.words import Words

_LEAP = 16  # number of vertices that each step of the Python loop skips
_SMALL = 1 << 29  # maximum count of numbers for which three times the count fits into an int32
_AT_ONCE = 2048  # number of vertices that are formatted together
_Places = NDArray[np.int64]
Influences = tuple[Ints, Ints, Floats, OffsetOf]


def read_weights(source: Source, block: Block, count: int) -> Influences:
    """Parse the influences of all vertices; an unreadable vertex has none, recorded as an error."""
    values, bad = parse_numbers(source.data, block.start, block.end)
    heads = _find_heads(values, count) if bad < 0 else None
    found = None if heads is None else _whole_influences(source, block, values, heads)
    return _faulty_influences(source, block, count) if found is None else found


def _find_heads(values: Floats, count: int) -> NDArray[np.integer] | None:
    """Return the positions of the vertices' counts (V,); None if they do not fill the block."""
    size = len(values)
    if count == 0:
        return None if size else np.zeros(0, np.int32)
    # There are two extra positions, the end of the block and one beyond it; both map to the second.
    kind: type[np.int32] | type[np.int64] = np.int32 if size < _SMALL else np.int64
    after = np.full(size + 2, size + 1, dtype=kind)
    counts: NDArray[Any] = np.clip(values, 0, size).astype(kind)
    is_count = counts == values
    counts *= 2
    counts += np.arange(1, size + 1, dtype=kind)
    is_count &= counts <= size
    np.copyto(after[:size], counts, where=is_count)
    # Each count determines the position of the next: a linked list. The map from each position to
    # the next, composed with itself four times, lets a step of the loop skip 16 vertices.
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


def _whole_influences(
    source: Source, block: Block, values: Floats, heads: NDArray[np.integer]
) -> Influences | None:
    """Return all influences, or None if a joint is not an integer."""
    is_pair = np.ones(len(values), dtype=bool)
    is_pair[heads] = False
    pairs = values[is_pair].reshape(-1, 2)
    joints, wrong = to_whole(pairs[:, 0])
    if wrong >= 0:
        return None
    starts = np.zeros(len(heads) + 1, dtype=np.int32)
    np.cumsum(values[heads].astype(np.int32), out=starts[1:])
    weights = pairs[:, 1].copy()
    # The skin can use read-only arrays without a copy.
    starts.flags.writeable = weights.flags.writeable = False
    begin, end = block.start, block.end

    def offset_of(vertex: int) -> int:
        # The vertex's words follow one count per earlier vertex and two words per earlier
        # influence.
        return source.number_offset(begin, end, vertex + 2 * int(starts[vertex]))

    return starts, joints, weights, offset_of


def _faulty_influences(source: Source, block: Block, count: int) -> Influences:
    words = words_of(source, block)
    known = np.where(np.isnan(words.values), -1.0, words.values)
    found = _find_heads(known, count)
    if found is not None:
        heads = found.astype(np.int64)
        fits = np.ones(len(heads), dtype=np.bool_)
    else:
        heads, sizes = words.rows()
        # Each line has a count, followed by pairs.
        fits = known[heads] * 2 + 1 == sizes
        if not block.closed or fits.sum() * 2 <= len(fits):
            raise _no_influences(source, block, words, known, count)
    after = np.append(heads[1:], len(words.values))
    _refuse_lines(source, words, heads, np.flatnonzero(~fits), after)
    counts = np.where(fits, known[heads], 0).astype(np.int32)
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    owners = np.repeat(np.arange(len(heads)), counts)
    # The joint of an influence comes after the vertex's count and two words per earlier influence.
    places = heads[owners] + 1 + 2 * (np.arange(len(owners)) - starts[owners])
    joints, weights = _faulty_pairs(source, words, places, owners)
    offsets = words.offsets[heads]
    return starts, joints, weights, lambda vertex: int(offsets[vertex])


def _refuse_lines(
    source: Source, words: Words, heads: _Places, vertices: _Places, after: _Places
) -> None:
    """Refuse lines whose number of words contradicts their first word."""
    if len(vertices) == 0:
        return
    vertex = int(vertices[0])
    head = int(heads[vertex])
    is_count = words.values[head] >= 0 and words.values[head] % 1 == 0
    if is_count:
        source.refuse(
            "F002.skin-influences: skinweights of vertex {vertex}: expected {pairs} "
            "joint-weight pairs, found {found} numbers on the line",
            int(words.offsets[head]),
            len(vertices),
            "weights",
            vertices,
            vertex=vertex,
            pairs=bare(words.word(head)),
            found=int(after[vertex]) - head - 1,
        )
    else:
        source.refuse(
            wording.SKIN_INFLUENCE_COUNT,
            int(words.offsets[head]),
            len(vertices),
            "weights",
            vertices,
            vertex=vertex,
            found=quoted(words.word(head)),
        )


def _faulty_pairs(
    source: Source, words: Words, places: _Places, owners: _Places
) -> tuple[Ints, Floats]:
    """Return joints and weights; both are 0 if either is not a number."""
    from viewer.formats._text.words import refuse_words

    joints, weights = words.values[places], words.values[places + 1]
    bad = np.flatnonzero(np.isnan(np.stack([joints, weights], axis=1)).any(axis=1))
    at = np.where(np.isnan(joints[bad]), places[bad], places[bad] + 1)
    vertices = dict(zip(at.tolist(), owners[bad].tolist(), strict=True))
    refuse_words(
        source,
        words,
        at,
        lambda word: Phrase(
            "{section} of vertex {index}", section="skinweights", index=vertices[word]
        ),
        "weights",
        owners[bad],
    )
    whole, _ = to_whole(np.nan_to_num(joints, nan=0.0))
    wrong = np.flatnonzero(~np.isnan(joints) & (whole != joints))
    if len(wrong):
        place = int(places[wrong[0]])
        source.refuse(
            "F002.skin-joint: skinweights of vertex {vertex}: expected a joint index, found "
            "{found}",
            int(words.offsets[place]),
            len(wrong),
            "weights",
            owners[wrong],
            vertex=int(owners[wrong[0]]),
            found=quoted(words.word(place)),
        )
    lost = np.isnan(joints) | np.isnan(weights) | (whole != joints)
    return np.where(lost, 0, whole).astype(np.int32), np.where(lost, 0.0, weights)


def _no_influences(
    source: Source, block: Block, words: Words, known: Floats, count: int
) -> FormatError:
    """Return the error for the first wrong count, found by following the counts one by one."""
    numbers = known.tolist()
    heads: list[int] = []
    position = 0
    while position < len(numbers) and len(heads) < count:
        heads.append(position)
        length = numbers[position]
        if length < 0 or length != int(length):
            return source.fault(
                wording.SKIN_INFLUENCE_COUNT,
                int(words.offsets[position]),
                vertex=len(heads) - 1,
                found=quoted(words.word(position)),
            )
        position += 1 + 2 * int(length)
    if not block.closed:
        return source.fault(
            'F002.skin-weights-end: expected "}}" to close skinweights (line {line}), found '
            "the end of the file after {found} of {expected} vertices",
            source.end,
            line=source.line(block.header),
            found=len(heads),
            expected=count,
        )
    if len(heads) < count:
        end = source.line(block.end)
        return source.fault(
            "F002.skin-weights: skinweights: expected {expected} vertices, found {found} (to "
            "line {end})",
            block.count,
            expected=count,
            found=len(heads),
            end=end,
        )
    if count == 0:
        return source.fault(
            "F002.skin-no-weights: skinweights: expected no vertices, found {found} numbers",
            block.count,
            found=len(words.values),
        )
    head = heads[-1]
    return source.fault(
        "F002.skin-influences-end: skinweights of last vertex {vertex}: expected {pairs} "
        "joint-weight pairs, found {found} numbers before the closing brace",
        int(words.offsets[head]),
        vertex=count - 1,
        pairs=bare(words.word(head)),
        found=len(words.values) - head - 1,
    )


def weights_lines(skin: Skin) -> Iterator[bytes]:
    """Yield the lines of the section in parts: a count, and pairs of a joint and a weight."""
    for first in range(0, skin.n_vertices, _AT_ONCE):
        starts = skin.starts[first : first + _AT_ONCE + 1]
        used = slice(int(starts[0]), int(starts[-1]))
        words = [b""] * (2 * (used.stop - used.start))
        words[0::2] = _words(skin.joints[used])
        words[1::2] = _words(skin.weights[used])
        ends = (2 * (starts - starts[0])).tolist()
        lines = [
            b" ".join([b"  %d" % ((last - begin) // 2), *words[begin:last]])
            for begin, last in pairwise(ends)
        ]
        yield b"\n".join([*lines, b""])


def _words(values: Ints | Floats) -> list[bytes]:
    return dumped(values)[1:-1].split(b",") if len(values) else []
