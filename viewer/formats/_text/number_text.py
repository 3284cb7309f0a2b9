"""Vectorised formatting of many numbers, composed from their digits with numpy.

Eight digits are written at a time, right-aligned, with leading zeros. These zeros overwrite the end
of the previous number, so numbers are written from the last to the first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import field
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.formats._text.swar import Indices, Words, eight_letters
from viewer.rig.arrays import Bools

__all__ = ["Digits", "joined", "row_texts"]

Number = TypeVar("Number", bound=np.generic)

_U = np.uint64
_EIGHT = _U(10**8)
_PAD = 32  # bytes before the text for the leading zeros of the first number
_AT_ONCE = 1 << 13  # numbers per batch, whose temporary arrays stay in the processor's cache
_TENS = [_U(10**k) for k in range(1, 20)]


@dataclass(slots=True, eq=False)
class Digits:
    """Decimal digits of numbers.

    Attributes
    ----------
    minus : (N,) bool
        Whether a minus sign precedes the number.
    whole, fraction : (N,)
        Digits before and after the point, as integers.
    decimals : (N,)
        Number of digits after the point; 0 for a number without a point.
    tails : (N,) or None
        Four characters after the digits in the upper half of a little-endian word, or 0.
    odd : dict of int to bytes
        Texts of numbers whose digits are unknown; their digits are 0.
    """

    minus: Bools
    whole: Words
    fraction: Words
    decimals: Indices
    tails: Words | None = None
    odd: dict[int, bytes] = field(default_factory=dict)

    def put(self, other: Digits, places: Indices) -> None:
        """Replace the digits of the numbers at some indices by the digits of other numbers."""
        for name in ("minus", "whole", "fraction", "decimals"):
            getattr(self, name)[places] = getattr(other, name)
        if other.tails is not None:
            self.tails = np.zeros(len(self.whole), np.uint64) if self.tails is None else self.tails
            self.tails[places] = other.tails
        self.odd.update({int(places[index]): text for index, text in other.odd.items()})


def joined(digits: Digits, separators: Sequence[bytes], which: NDArray[np.uint8]) -> bytes:
    """Return the text of numbers, each followed by a separator.

    Parameters
    ----------
    digits : Digits
        The N numbers.
    separators : sequence of bytes
        Texts of any length.
    which : (N,)
        Index of the separator after each number.
    """
    sizes = np.array([len(text) for text in separators], dtype=np.intp).take(which)
    n_whole = _count_digits(digits.whole)
    has_point = digits.decimals > 0
    lengths = n_whole + digits.minus + digits.decimals + has_point + sizes
    if digits.tails is not None:
        lengths += np.where(digits.tails != 0, 4, 0)
    for index, text in digits.odd.items():
        lengths[index] = len(text) + sizes[index]
    ends = np.cumsum(lengths) + _PAD
    out = np.empty(int(ends[-1]) if len(ends) else _PAD, dtype=np.uint8)
    stops = ends - sizes
    points = _write_digits(out, digits, stops, int(n_whole.max(initial=1)))
    out[points if has_point.all() else points[has_point]] = ord(".")
    starts = ends - lengths
    out[starts[digits.minus]] = ord("-")
    for index, text in digits.odd.items():
        out[starts[index] : stops[index]] = np.frombuffer(text, dtype=np.uint8)
    _write_separators(out, separators, which, stops)
    return out[_PAD:].tobytes()


def row_texts(
    rows: NDArray[Number],
    digits_of: Callable[[NDArray[Number]], Digits],
    between: bytes | Sequence[bytes] = b" ",
    end: bytes = b"\n",
    start: bytes = b"",
) -> Iterator[bytes]:
    """Yield the text of a table in parts.

    Parameters
    ----------
    rows : (N, C)
        Numbers.
    digits_of : callable
        Returns the digits of numbers, (n,): ``fixed``, ``shortest``, ``significant``, ``integers``.
    between : bytes, or C - 1 of them
        Separators of the numbers in a row.
    end, start : bytes
        Text after and before each row.
    """
    width = rows.shape[1]
    separators = [between] if isinstance(between, bytes) else [*between]
    columns = np.zeros(width, dtype=np.uint8) if isinstance(between, bytes) else np.arange(width)
    columns[-1] = len(separators)
    step = max(_AT_ONCE // width, 1)
    for first in range(0, len(rows), step):
        part = rows[first : first + step]
        which = np.tile(columns.astype(np.uint8), len(part))
        text = joined(digits_of(part.ravel()), [*separators, end + start], which)
        yield start + text[: len(text) - len(start)]


def _count_digits(values: Words) -> Indices:
    counts = np.ones(len(values), dtype=np.intp)
    largest = values.max(initial=0)
    for ten in _TENS:
        if largest < ten:
            break
        counts += values >= ten
    return counts


def _write_digits(out: NDArray[np.uint8], digits: Digits, stops: Indices, longest: int) -> Indices:
    """Write all digits and the tails before ``stops``; return the positions of the points."""
    pieces: list[tuple[Indices, Words]] = []
    if digits.tails is not None:
        pieces.append((stops, digits.tails))
        stops = stops - np.where(digits.tails != 0, 4, 0)
    points = stops - digits.decimals - (digits.decimals > 0)
    n_decimals = int(digits.decimals.max(initial=0))
    for ends, values, count in (
        (stops, digits.fraction, n_decimals),
        (points, digits.whole, longest),
    ):
        for place in range(-(-count // 8)):
            is_last = 8 * place + 8 >= count
            upper = values if is_last else values // _EIGHT
            pieces.append(
                (ends - 8 * place, eight_letters(values if is_last else values - upper * _EIGHT))
            )
            values = upper
    # V8 has alignment 1, so eight characters can be written at any address.
    windows = np.ndarray(len(out) - 7, dtype="<u8", buffer=out.data, strides=(1,))
    places = np.empty((len(stops), len(pieces)), dtype=np.intp)
    words = np.empty((len(stops), len(pieces)), dtype=np.uint64)
    for column, (ends, letters) in enumerate(pieces):
        places[:, column], words[:, column] = ends[::-1], letters[::-1]
    places -= 8
    windows[places.ravel()] = words.ravel()
    return points


def _write_separators(
    out: NDArray[np.uint8], separators: Sequence[bytes], which: NDArray[np.uint8], stops: Indices
) -> None:
    for place in range(max(map(len, separators))):
        letters = np.array(
            [text[place] if place < len(text) else 0 for text in separators], np.uint8
        )
        shown = letters.take(which)
        if all(place < len(text) for text in separators):
            out[stops + place] = shown
        else:
            some = np.flatnonzero(shown)
            out[stops[some] + place] = shown[some]
