"""Eight characters of a text as one 64-bit word ("SIMD within a register").

A window of a padded text ends at any character: its last character is the most significant byte of
the little-endian word, so that numbers are aligned at their last digit.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from viewer.rig.arrays import Floats

_PAD = 24
"""Spaces before a text, so that 24 characters can be read before the end of the first number."""
Words = NDArray[np.uint64]
Indices = NDArray[np.intp]
_U = np.uint64
_ZEROS = _U(0x3030303030303030)
"""The character 0, eight times."""
_LOW7 = _U(0x7F7F7F7F7F7F7F7F)
_HIGH_NIBBLES = _U(0xF0F0F0F0F0F0F0F0)
_SIXES = _U(0x0606060606060606)

# Masks of the last k characters of a word.
_KEEP = np.array([0] + [(1 << 64) - (1 << (64 - 8 * k)) for k in range(1, 9)], dtype=np.uint64)


def padded(text: bytes) -> bytes:
    """Return a text padded with spaces, so that ``words_before`` can read it."""
    return b" " * _PAD + text + b" " * (16 - len(text) % 8)


def words_before(aligned: Words, ends: Indices, count: int) -> list[Words]:
    """Return the eight characters before each offset, the eight before these, and so on.

    ``aligned``: (N,), a padded text as 64-bit words. ``ends``: (W,), offsets in characters.
    """
    # Gathering aligned words and shifting them is faster than gathering unaligned words.
    first = (ends - 8) >> 3
    right = ((ends & 7) << 3).view(np.uint64)
    left = _U(63) - right
    found, after = [], aligned.take(first + 1)
    for back in range(count):
        here = aligned.take(first - back)
        found.append((here >> right) | ((after << _U(1)) << left))
        after = here
    return found


def digits_only(words: Words, lengths: Indices) -> Words:
    """Replace the characters before the last ``lengths``, 0 to 8, with zeros."""
    return ((words ^ _ZEROS) & _KEEP.take(lengths)) ^ _ZEROS


def first_of(words: Words, letters: np.uint64) -> Words:
    """Return the top bit of the first character that matches its counterpart in ``letters``."""
    x = words ^ letters
    zero = ~(((x & _LOW7) + _LOW7) | x | _LOW7)
    return zero & (~zero + _U(1))


def letters_after(bits: Words) -> Indices:
    """Return the number of characters after the one marked by ``first_of``."""
    above = ~((bits << _U(1)) - _U(1))
    return (np.bitwise_count(above) >> 3).astype(np.intp)


def close_gap(words: Words, bits: Words) -> Words:
    """Remove a marked character: the characters before it move by one position towards it.

    The first character becomes a null byte.
    """
    below = (bits >> _U(7)) - _U(1)
    above = ~((bits << _U(1)) - _U(1))
    return (words & above) | ((words & below) << _U(8))


def not_digits(words: Words) -> Words:
    """Return 0 for words of eight digits, and any other number for the rest."""
    return ((words & _HIGH_NIBBLES) ^ _ZEROS) | (((words + _SIXES) & _HIGH_NIBBLES) ^ _ZEROS)


def eight_digits(words: Words) -> Words:
    """Evaluate eight digits, first character most significant (Lemire's three-step product)."""
    x = words - _ZEROS
    x = (x * _U(10)) + (x >> _U(8))
    mask = _U(0x000000FF000000FF)
    left = (x & mask) * _U(0x000F424000000064)
    right = ((x >> _U(16)) & mask) * _U(0x0000271000000001)
    return (left + right) >> _U(32)


def eight_letters(values: Words) -> Words:
    """Return the digits of integers below 10^8, with leading zeros."""
    # Pairs of digits in two steps: four and four, then two and two, all in one word.
    upper = values // _U(10_000)
    fours = upper | ((values - upper * _U(10_000)) << _U(32))
    upper = ((fours * _U(5243)) >> _U(19)) & _U(0x0000007F0000007F)
    pairs = upper | ((fours - upper * _U(100)) << _U(16))
    upper = ((pairs * _U(103)) >> _U(10)) & _U(0x000F000F000F000F)
    return (upper | ((pairs - upper * _U(10)) << _U(8))) + _ZEROS


# Products of integers or floats and powers of ten, to about 100 bits.
#
# Powers of ten and products are represented as sums of two floats (Dekker 1971). The relative
# error is below ``ERROR``, so a result farther than that from a tie is correctly rounded.

FARTHEST = 100
"""Largest magnitude of an exponent."""
ERROR = 2.0**-99
"""Relative error of a product; its bound is 6 x 2^-106."""
_SPLIT = 134217729.0  # 2^27 + 1, which splits a float into two halves of 26 bits


def times_power(
    values: Floats, rests: Floats | None, exponents: np.ndarray
) -> tuple[Floats, Floats]:
    """Return (values + rests) * 10^exponents as a sum of two floats, the second below half an ulp.

    ``values``, ``rests``: (N,), numbers up to 2^64; rests are below half an ulp of the values, or
    None for 0. ``exponents``: (N,) int, from -FARTHEST to FARTHEST.
    """
    power, low, upper, lower = (table.take(exponents + FARTHEST) for table in _tables())
    product = values * power
    half = values * _SPLIT
    half -= half - values
    rest = values - half
    # This is the exact error of the product, because no product of two halves is rounded.
    error = half * upper - product
    error += half * lower
    error += rest * upper
    error += rest * lower
    error += values * low
    if rests is not None:
        error += rests * power
    total = product + error
    return total, (product - total) + error


@cache
def _tables() -> tuple[Floats, Floats, Floats, Floats]:
    """Return the powers of ten: nearest float, its error, and its upper and lower half."""
    # Imported late, as most files have no number that needs these tables.
    from fractions import Fraction

    exact = [Fraction(10) ** exponent for exponent in range(-FARTHEST, FARTHEST + 1)]
    power = np.array([float(value) for value in exact])
    low = [float(value - Fraction(near)) for value, near in zip(exact, power.tolist(), strict=True)]
    upper = power * _SPLIT
    upper -= upper - power
    return power, np.array(low), upper, power - upper
