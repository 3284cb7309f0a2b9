"""Decimal digits of arrays of numbers, identical to the output of Python's formatting.

Numbers are scaled to integers, to about 100 bits. The few numbers whose rounding could be affected
by the scaling error, and those out of range, are formatted by Python, one by one.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from viewer.formats._text.number_text import Digits
from viewer.formats._text.powers import FARTHEST, times_power
from viewer.formats._text.swar import Indices, Words
from viewer.rig.arrays import Bools, Floats

__all__ = ["MOST_DECIMALS", "fixed", "integers", "shortest", "significant"]

MOST_DECIMALS = 15
"""Largest number of decimals of ``fixed``."""

_U = np.uint64
_TENS = np.array([10**k for k in range(20)], dtype=np.uint64)
_EXACT = 1e15  # integers of up to 15 digits survive the conversion to float64 and back
_NEAR = 1e-6  # minimum distance from a tie, relative to the last digit
_TAILS = np.array(
    [int.from_bytes(b"\0\0\0\0" + b"e%+03d" % e, "little") for e in range(-99, 100)],
    dtype=np.uint64,
)
_MANTISSA = np.uint64((1 << 52) - 1)


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
    whole = numbers // _TENS[decimals]
    # Texts formatted by Python include the decimal point, if any: NaN and infinity have none.
    count = np.where(is_odd, 0, decimals)
    odd = _texts(values, is_odd, lambda value: f"{np.round(value, decimals) + 0.0:.{decimals}f}")
    return Digits(scaled < 0.0, whole, numbers - whole * _TENS[decimals], count, None, odd)


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
    exponents += numbers >= _TENS[count]
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
    exponents += found >= _TENS[17]
    exponents -= found < _TENS[16]
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
    numbers = numbers * _TENS.take(np.maximum(-decimals, 0))
    is_whole = decimals <= 0
    decimals = np.maximum(decimals, 0)
    powers = _TENS.take(np.minimum(decimals, 19))
    whole = numbers // powers
    fraction = numbers - whole * powers
    if least:
        decimals = np.where(is_whole & ~is_exponential, least, decimals)
    return Digits(np.zeros(0, np.bool_), whole, fraction, decimals, tails)


def _stripped(numbers: Words, decimals: Indices) -> tuple[Words, Indices]:
    """Remove trailing zeros."""
    for count in (16, 8, 4, 2, 1):
        upper = numbers // _TENS[count]
        is_multiple = (upper * _TENS[count] == numbers) & (numbers != 0)
        if is_multiple.any():
            numbers = np.where(is_multiple, upper, numbers)
            decimals = decimals - np.where(is_multiple, count, 0)
    # The only digit of 0 is before the point.
    return numbers, np.where(numbers == 0, 0, decimals)


def _texts(values: Floats, odd: Bools, text_of: Callable[[float], str]) -> dict[int, bytes]:
    """Return the texts of some numbers by index."""
    return {index: text_of(float(values[index])).encode() for index in np.flatnonzero(odd).tolist()}
