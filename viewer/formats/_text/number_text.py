"""Vectorised formatting of many numbers, identical to the output of Python's formatting.

To get their decimal digits, numbers are scaled to integers, to about 100 bits. The few numbers
whose rounding could be affected by the scaling error, and those out of range, are formatted by
Python, one by one.

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
from viewer.formats._text.swar import FARTHEST, Indices, Words, eight_letters, times_power
from viewer.rig.arrays import Bools, Floats

_Number = TypeVar("_Number", bound=np.generic)
_U = np.uint64
_EIGHT = _U(10**8)
_TENS = [_U(10**k) for k in range(1, 20)]
_POWERS_OF_TEN = np.array([10**k for k in range(20)], dtype=np.uint64)
_PAD = 32  # bytes before the text for the leading zeros of the first number
_AT_ONCE = 1 << 13  # numbers per batch, whose temporary arrays stay in the processor's cache
_MOST_DECIMALS = 15
"""Largest number of decimals of ``fixed``."""
_EXACT = 1e15  # integers of up to 15 digits survive the conversion to float64 and back
_NEAR = 1e-6  # minimum distance from a tie, relative to the last digit
_TAILS = np.array(
    [int.from_bytes(b"\0\0\0\0" + b"e%+03d" % e, "little") for e in range(-99, 100)],
    dtype=np.uint64,
)
_MANTISSA = np.uint64((1 << 52) - 1)


@dataclass(slots=True, eq=False)
class Digits:
    """Decimal digits of numbers."""

    minus: Bools
    """(N,) bool. Whether a minus sign precedes the number."""
    whole: Words
    fraction: Words
    """(N,). Digits before and after the point, as integers."""
    decimals: Indices
    """(N,). Number of digits after the point; 0 for a number without a point."""
    tails: Words | None = None
    """(N,) or None. Four characters after the digits in the upper half of a little-endian word, or
    0."""
    odd: dict[int, bytes] = field(default_factory=dict)
    """Texts of numbers whose digits are unknown; their digits are 0."""

    def put(self, other: Digits, places: Indices) -> None:
        """Replace the digits of the numbers at some indices by the digits of other numbers."""
        for name in ("minus", "whole", "fraction", "decimals"):
            getattr(self, name)[places] = getattr(other, name)
        if other.tails is not None:
            self.tails = np.zeros(len(self.whole), np.uint64) if self.tails is None else self.tails
            self.tails[places] = other.tails
        self.odd.update({int(places[index]): text for index, text in other.odd.items()})


def integers(values: NDArray[np.integer]) -> Digits:
    """Return the digits of integers below 10^16: (N,)."""
    count = len(values)
    whole = np.abs(values.astype(np.int64)).view(np.uint64)
    return Digits(values < 0, whole, np.zeros(count, np.uint64), np.zeros(count, np.intp))


def fixed(values: Floats, decimals: int) -> Digits:
    """Return the digits of ``f"{np.round(value, decimals) + 0.0:.{decimals}f}"``: (N,)."""
    with np.errstate(over="ignore"):
        scaled = np.rint(values * 10.0**decimals)
    is_odd = ~(np.abs(scaled) < _EXACT)
    if is_odd.any():
        scaled = np.where(is_odd, 0.0, scaled)
    numbers = np.abs(scaled).astype(np.uint64)
    whole = numbers // _POWERS_OF_TEN[decimals]
    # Texts formatted by Python include the decimal point, if any: NaN and infinity have none.
    count = np.where(is_odd, 0, decimals)
    odd = _texts(values, is_odd, lambda value: f"{np.round(value, decimals) + 0.0:.{decimals}f}")
    return Digits(scaled < 0.0, whole, numbers - whole * _POWERS_OF_TEN[decimals], count, None, odd)


def significant(values: Floats, count: int) -> Digits:
    """Return the digits of ``f"{value:.{count}g}"``, for up to 15 significant digits: (N,)."""
    positive, is_odd, exponents = _magnitudes(values)
    total, _ = times_power(positive, None, count - 1 - exponents)
    rounded = np.rint(total)
    is_odd |= np.abs(np.abs(total - rounded) - 0.5) < _NEAR
    # A number just below a power of ten is rounded up to it.
    is_odd |= (total < 10.0 ** (count - 1)) | (total >= 10.0**count)
    numbers = np.where(is_odd | (values == 0.0), 0.0, rounded).astype(np.uint64)
    decimals = count - 1 - exponents
    exponents += numbers >= _POWERS_OF_TEN[count]
    digits = _placed(numbers, exponents, decimals, count, 0)
    digits.minus = np.signbit(values) & ~is_odd
    digits.odd = _texts(values, is_odd, lambda value: f"{value:.{count}g}")
    return digits


def shortest(values: Floats) -> Digits:
    """Return the digits of ``repr(value)``, the shortest that round-trip: (N,).

    The number is scaled to 17 digits; candidates are the nearest multiples of 100, 10 and 1. The
    first candidate within half an ulp, 0.5 to 11.1, is the result.
    """
    positive, is_odd, exponents = _magnitudes(values)
    total, rest = times_power(positive, None, 16 - exponents)
    is_odd |= (total < 1e16) | (total >= 1e17)
    half, _ = times_power(0.5 * np.spacing(positive), None, 16 - exponents)
    numbers = np.where(is_odd, 0.0, total).astype(np.int64)
    by_hundred, distance = _nearest(numbers, rest, 100)
    by_ten, farther = _nearest(numbers, rest, 10)
    is_short, is_medium = distance < half, farther < half
    ones = np.rint(rest)
    numbers = np.where(
        is_short, by_hundred, np.where(is_medium, by_ten, numbers + ones.astype(np.int64))
    )
    # Whether the limits themselves round to the same float depends on its last bit.
    doubtful = (np.abs(distance - half) < _NEAR) | (np.abs(farther - half) < _NEAR)
    doubtful |= is_medium & (np.abs(farther - 5.0) < _NEAR)
    doubtful |= ~is_medium & (np.abs(np.abs(rest - ones) - 0.5) < _NEAR)
    # Below a power of two, floats are twice as dense as above.
    doubtful |= (positive.view(np.uint64) & _MANTISSA) == 0
    is_odd |= doubtful & (distance != 0.0)
    found = np.where(is_odd | (values == 0.0), 0, numbers).view(np.uint64)
    decimals = 16 - exponents
    exponents += found >= _POWERS_OF_TEN[17]
    exponents -= found < _POWERS_OF_TEN[16]
    digits = _placed(found, exponents, decimals, 16, 1)
    digits.minus = np.signbit(values) & ~is_odd
    digits.odd = _texts(values, is_odd, repr)
    return digits


def _magnitudes(values: Floats) -> tuple[Floats, Bools, Indices]:
    """Return magnitudes, a mask of those out of range, and their decimal exponents.

    Numbers out of range and 0 are replaced by 1.
    """
    positive = np.abs(values)
    limit = 10.0 ** (FARTHEST - 20)
    is_odd = ~((positive < limit) & (positive > 1.0 / limit))
    if is_odd.any():
        positive = np.where(is_odd, 1.0, positive)
        is_odd &= values != 0.0
    return positive, is_odd, np.floor(np.log10(positive)).astype(np.intp)


def _nearest(
    numbers: NDArray[np.int64], rests: Floats, step: int
) -> tuple[NDArray[np.int64], Floats]:
    """Return the multiples of a step that are nearest to sums, and their distances."""
    over = numbers % step
    beyond = over + rests
    up = np.rint(beyond / step)
    return numbers - over + step * up.astype(np.int64), np.abs(beyond - step * up)


def _placed(numbers: Words, exponents: Indices, decimals: Indices, most: int, least: int) -> Digits:
    """Place the point in numbers * 10^-decimals.

    ``exponents`` are the exponents of the first digits; from -4 to below ``most``, no exponent is
    written. ``least`` is the number of decimals of integers.
    """
    exponents = np.where(numbers == 0, 0, exponents)
    numbers, decimals = _stripped(numbers, decimals)
    is_exponential = (exponents < -4) | (exponents >= most)
    tails = None
    if is_exponential.any():
        # Write one digit before the point.
        decimals = np.where(is_exponential, decimals + exponents, decimals)
        tails = np.where(is_exponential, _TAILS.take(exponents + 99, mode="clip"), _U(0))
    numbers = numbers * _POWERS_OF_TEN.take(np.maximum(-decimals, 0))
    is_whole = decimals <= 0
    decimals = np.maximum(decimals, 0)
    powers = _POWERS_OF_TEN.take(np.minimum(decimals, 19))
    whole = numbers // powers
    fraction = numbers - whole * powers
    if least:
        decimals = np.where(is_whole & ~is_exponential, least, decimals)
    return Digits(np.zeros(0, np.bool_), whole, fraction, decimals, tails)


def _stripped(numbers: Words, decimals: Indices) -> tuple[Words, Indices]:
    """Remove trailing zeros."""
    for count in (16, 8, 4, 2, 1):
        upper = numbers // _POWERS_OF_TEN[count]
        is_multiple = (upper * _POWERS_OF_TEN[count] == numbers) & (numbers != 0)
        if is_multiple.any():
            numbers = np.where(is_multiple, upper, numbers)
            decimals = decimals - np.where(is_multiple, count, 0)
    # The only digit of 0 is before the point.
    return numbers, np.where(numbers == 0, 0, decimals)


def _texts(values: Floats, odd: Bools, text_of: Callable[[float], str]) -> dict[int, bytes]:
    """Return the texts of some numbers by index."""
    return {index: text_of(float(values[index])).encode() for index in np.flatnonzero(odd).tolist()}


def row_texts(
    rows: NDArray[_Number],
    digits_of: Callable[[NDArray[_Number]], Digits],
    between: bytes | Sequence[bytes] = b" ",
    end: bytes = b"\n",
    start: bytes = b"",
) -> Iterator[bytes]:
    """Yield the text of a table in parts.

    ``rows``: (N, C), numbers. ``digits_of``: returns the digits of numbers, (n,): ``fixed``,
    ``shortest``, ``significant``, ``integers``.
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


def joined(digits: Digits, separators: Sequence[bytes], which: NDArray[np.uint8]) -> bytes:
    """Return the text of numbers, each followed by a separator.

    ``which``: (N,), index of the separator after each number.
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
