"""Numbers of broken texts: every word has its place, and what is no number is put into words."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from viewer.diagnostics import Part, Phrase
from viewer.formats._numbers import is_infinite, is_too_large, parse_words, word_begins
from viewer.formats._source import Source
from viewer.rig.arrays import Bools, Floats, Ints

__all__ = [
    "Words",
    "held_rows",
    "mended_corners",
    "mended_positions",
    "number_key",
    "read_words",
    "refuse_words",
]

Places = NDArray[np.int64]

_WORD = re.compile(rb"[^ \t\n\r\v\f]+")


@dataclass(frozen=True, slots=True, eq=False)
class Words:
    """Words of a text that should be numbers.

    Attributes
    ----------
    data : bytes
        The file.
    values : (N,)
        NaN for those that are none.
    offsets : (N,)
        Where each begins in the file.
    lines : (N,)
        A number that is the same for words of one line, and rises.
    """

    data: bytes
    values: Floats
    offsets: Places
    lines: Places

    @property
    def bad(self) -> Places:
        """Indices of the words that are no numbers."""
        return np.flatnonzero(np.isnan(self.values))

    def rows(self) -> tuple[Places, Places]:
        """Return the first word of each line that has some, and how many it has: (L,), (L,)."""
        begins = np.flatnonzero(np.diff(self.lines, prepend=-1))
        return begins, np.diff(np.append(begins, len(self.lines)))

    def word(self, index: int) -> bytes:
        """Return a word as written."""
        found = _WORD.match(self.data, int(self.offsets[index]))
        return b"" if found is None else found.group()


def read_words(data: bytes, start: int, end: int) -> Words:
    """Parse a part of a text that should hold nothing but numbers."""
    letters = np.frombuffer(data, dtype=np.uint8, count=end - start, offset=start)
    begins = word_begins(letters)
    breaks = np.flatnonzero((letters == 10) | (letters == 13))
    values = parse_words(data, start, end)
    return Words(data, values, begins + start, np.searchsorted(breaks, begins))


def refuse_words(
    source: Source,
    words: Words,
    bad: Places,
    named: Callable[[int], Phrase | str],
    part: Part,
    places: NDArray[np.integer],
) -> None:
    """Refuse words that are no numbers: those that are not finite, and apart from them others.

    Parameters
    ----------
    source : Source
        The file.
    words : Words
        Some of it.
    bad : (N,)
        Indices of the words.
    named : callable
        Gives for the index of a word what the number belongs to.
    part : str
        What of the figure it is, see ``Diagnostic``.
    places : (N,)
        Which vertex, triangle, joint or frame each belongs to.
    """
    lost = [is_infinite(words.word(index)) for index in bad.tolist()]
    for is_lost in (True, False):
        chosen = np.flatnonzero(np.array(lost, dtype=np.bool_) == is_lost)
        if len(chosen) == 0:
            continue
        first = int(bad[chosen[0]])
        source.refuse(
            number_key(words.word(first), part),
            int(words.offsets[first]),
            len(chosen),
            part,
            places[chosen],
            item=named(first),
            found=words.word(first),
        )


def number_key(word: bytes, part: Part = "") -> str:
    """Return the key of the message about a word that is no number."""
    if not is_infinite(word):
        return "F002.number"
    # What is too large is written as a number is: the message gives the limit.
    name = "too-large" if is_too_large(word) else "number"
    return f"{'W003' if part == 'weights' else 'F003'}.{name}"


def mended_positions(positions: Floats, triangles: Ints) -> Floats:
    """Return positions without NaN: a vertex that has one goes to the middle of its neighbours.

    Parameters
    ----------
    positions : (V, 3)
        NaN where they are not known.
    triangles : (T, 3)
        Say who is a neighbour; a vertex that has no known one goes to the middle of all.
    """
    if not np.isnan(positions.sum()):
        return positions  # nearly always, so this must cost nothing
    bad: Bools = np.isnan(positions.sum(axis=1))
    known = positions[~bad]
    result = positions.copy()
    result[bad] = known.mean(axis=0) if len(known) else 0.0
    ends = np.concatenate([triangles, triangles[:, [1, 2, 0]]]).ravel()
    others = np.concatenate([triangles[:, [1, 2, 0]], triangles]).ravel()
    counts = ~bad[others] & bad[ends]
    ends, others = ends[counts], others[counts]
    number = np.bincount(ends, minlength=len(positions))
    sums = [np.bincount(ends, result[others, k], minlength=len(positions)) for k in range(3)]
    found = bad & (number > 0)
    result[found] = np.stack(sums, axis=1)[found] / number[found, None]
    return result


def held_rows(rows: Floats, bad: Bools) -> Floats:
    """Return rows, those that are bad replaced by the last good one, or else by the first.

    Parameters
    ----------
    rows : (N, ...)
        Of a motion.
    bad : (N,)
        Which cannot be used; if none can, all become 0.
    """
    if not bad.any():
        return rows
    if bad.all():
        return np.zeros_like(rows)
    held = np.maximum.accumulate(np.where(bad, -1, np.arange(len(rows))))
    return rows[np.where(held < 0, int((~bad).argmax()), held)]


def mended_corners(corners: NDArray[np.integer], fits: Bools) -> Ints:
    """Return triangles in which corners that none can have are another corner, so without area.

    Parameters
    ----------
    corners : (T, 3)
        Vertex indices.
    fits : (T, 3)
        Which of them are vertices; of a triangle without any, all become vertex 0.
    """
    first = corners[np.arange(len(corners)), fits.argmax(axis=1)]
    usable = np.where(fits.any(axis=1), first, 0)
    return np.where(fits, corners, usable[:, None]).astype(np.int32)
