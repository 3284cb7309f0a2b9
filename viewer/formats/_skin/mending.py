"""Numbers of a broken ``.skin`` file: every fault is noted, and NaN stands where one was.

Lines mean nothing to the format, but most files have a vertex or triangle a line: there, one that
is too short or too long costs no other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from viewer.diagnostics import Part
from viewer.formats._skin.blocks import KEYWORDS, Block, block_rows, to_whole, unclosed
from viewer.formats._skin.weights import find_heads, read_weights
from viewer.formats._source import Source
from viewer.formats._tolerant import Words, read_words, refuse_words
from viewer.phrases import quoted
from viewer.rig.arrays import Floats, Ints

__all__ = ["LOST", "mended_rows", "mended_weights", "whole_corners"]

LOST = -(2**31)
"""In place of a corner that is no whole number."""

Places = NDArray[np.int64]

_PARTS: dict[str, Part] = {"positions": "positions", "triangles": "triangles"}


def mended_rows(
    source: Source, block: Block, count: int, width: int, first: int = 0
) -> tuple[Floats, Places]:
    """Parse a block of rows; see ``block_rows``.

    Parameters
    ----------
    source : Source
        Takes the faults.
    block : Block
        Where the numbers are.
    count : int
        Rows that the file declares; if it has others, those count.
    width : int
        Numbers in a row.
    first : int
        What the first row is called.

    Returns
    -------
    rows : (N, width)
        NaN for numbers that are none, and in rows with more or fewer numbers.
    offsets : (N,)
        Where each row is in the file.

    Raises
    ------
    FormatError
        If it cannot be told which numbers make a row.
    """
    words = _words(source, block)
    begins, sizes = _row_begins(source, block, words, count, width)
    fits = sizes == width
    rows = np.full((len(begins), width), np.nan)
    rows[fits] = words.values[begins[fits, None] + np.arange(width)]
    part = _PARTS.get(block.name, "")
    item = "triangle" if block.name == "triangles" else f"{block.name} of vertex"
    owners = np.repeat(np.arange(len(begins)), sizes) + first
    bad = words.bad
    refuse_words(source, words, bad, lambda word: f"{item} {owners[word]}", part, owners[bad])
    wrong = np.flatnonzero(~fits)
    if len(wrong):
        found = f"expected {width} numbers, found {sizes[wrong[0]]}"
        offset = int(words.offsets[begins[wrong[0]]])
        error = source.error(f"{item} {wrong[0] + first}: {found}", offset)
        source.refuse_error(error, len(wrong), part, wrong + first)
    if block.name == "triangles" and len(begins) != count:
        found = f"triangles: expected {count} rows of 3 numbers, found {len(begins)}"
        source.refuse_error(source.error(found, block.header))
    return rows, words.offsets[begins]


def _words(source: Source, block: Block) -> Words:
    words = read_words(source.data, block.start, block.end)
    for index in words.bad.tolist():
        word = words.word(index)
        if word in KEYWORDS or b"{" in word:
            raise unclosed(source, block, int(words.offsets[index]), word)
    return words


def _row_begins(
    source: Source, block: Block, words: Words, count: int, width: int
) -> tuple[Places, Places]:
    """Return the first word of each row, and how many words it has."""
    total = len(words.values)
    if total != count * width:
        begins, sizes = words.rows()
        if block.closed and (sizes == width).sum() * 2 > len(sizes):
            return begins, sizes
        if not block.closed or total % width:
            block_rows(source, block, count, width)  # refuses it
    begins = np.arange(0, total, width)
    return begins, np.full(len(begins), width)


def whole_corners(source: Source, rows: Floats, offsets: Places, first: int) -> Ints:
    """Return triangles as whole numbers, ``LOST`` for corners that are none: (T, 3).

    Parameters
    ----------
    source : Source
        Takes the faults.
    rows, offsets : (T, 3), (T,)
        As ``mended_rows`` gives them: its own faults are known.
    first : int
        What the first triangle is called.
    """
    known = ~np.isnan(rows)
    corners, _ = to_whole(np.where(known, rows, LOST))
    wrong = known & (corners != rows)
    triangles = np.flatnonzero(wrong.any(axis=1))
    if len(triangles):
        row = int(triangles[0])
        found = f"{rows[row][wrong[row]][0]:g}"
        message = f"triangle {row + first}: expected a vertex index, found {found}"
        error = source.error(message, int(offsets[row]))
        source.refuse_error(error, int(wrong.sum()), "triangles", triangles + first)
    return np.where(wrong, LOST, corners).astype(np.int32)


def mended_weights(source: Source, block: Block, count: int) -> tuple[Ints, Ints, Floats, Places]:
    """Parse the influences of all vertices; see ``read_weights``.

    Parameters
    ----------
    source : Source
        Takes the faults.
    block : Block
        Where the numbers are.
    count : int
        Vertices that the file declares; if it has others, those count.

    Returns
    -------
    starts : (N + 1,)
        Where the influences of each vertex begin; one that cannot be told has none.
    joints, weights : (M,)
        Both 0 where one is no number.
    offsets : (N,)
        Where each vertex is in the file.

    Raises
    ------
    FormatError
        If it cannot be told which numbers belong to which vertex.
    """
    words = _words(source, block)
    known = np.where(np.isnan(words.values), -1.0, words.values)
    found = find_heads(known, count)
    if found is not None:
        heads = found.astype(np.int64)
        fits = np.ones(len(heads), dtype=np.bool_)
    else:
        heads, sizes = words.rows()
        # A line holds how many follow, and pairs.
        fits = known[heads] * 2 + 1 == sizes
        if not block.closed or fits.sum() * 2 <= len(fits):
            read_weights(source, block, count)  # refuses it
    after = np.append(heads[1:], len(words.values))
    _say_lines(source, words, heads[~fits], np.flatnonzero(~fits), after[~fits])
    counts = np.where(fits, known[heads], 0).astype(np.int32)
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    owners = np.repeat(np.arange(len(heads)), counts)
    # The joint of each influence follows the head of its vertex and two words for each before it.
    places = heads[owners] + 1 + 2 * (np.arange(len(owners)) - starts[owners])
    joints, weights = _influences(source, words, places, owners)
    return starts, joints, weights, words.offsets[heads]


def _say_lines(
    source: Source, words: Words, heads: Places, vertices: Places, after: Places
) -> None:
    """Refuse lines whose number of words is not what their first word says."""
    if len(vertices):
        pairs, found = words.word(int(heads[0])), int(after[0] - heads[0]) - 1
        error = source.error(
            f"skinweights of vertex {vertices[0]}: expected a count and as many pairs of joint "
            f"and weight, found {quoted(pairs)} and {found} numbers",
            int(words.offsets[heads[0]]),
        )
        source.refuse_error(error, len(vertices), "weights", vertices)


def _influences(
    source: Source, words: Words, places: Places, owners: Places
) -> tuple[Ints, Floats]:
    """Return joints and weights, both 0 where one is no number."""
    joints, weights = words.values[places], words.values[places + 1]
    bad = np.flatnonzero(np.isnan(np.stack([joints, weights], axis=1)).any(axis=1))
    at = np.where(np.isnan(joints[bad]), places[bad], places[bad] + 1)
    names = dict(zip(at.tolist(), owners[bad].tolist(), strict=True))
    refuse_words(
        source, words, at, lambda word: f"skinweights of vertex {names[word]}", "weights",
        owners[bad],
    )  # fmt: skip
    whole, _ = to_whole(np.nan_to_num(joints, nan=0.0))
    wrong = np.flatnonzero(~np.isnan(joints) & (whole != joints))
    if len(wrong):
        place = int(places[wrong[0]])
        error = source.error(
            f"skinweights of vertex {owners[wrong[0]]}: expected a joint index, "
            f"found {quoted(words.word(place))}",
            int(words.offsets[place]),
        )
        source.refuse_error(error, len(wrong), "weights", owners[wrong])
    lost = np.isnan(joints) | np.isnan(weights) | (whole != joints)
    return np.where(lost, 0, whole).astype(np.int32), np.where(lost, 0.0, weights)
