"""Parser for long blocks of decimal numbers, in numpy, exact as ``float()`` above 5e-324.

Eight characters are treated as one 64-bit word ("SIMD within a register"). A number with at most 15
digits is an integer below 2^53 divided by a power of ten of at most 10^22, both exact in float64,
so the quotient is the correctly rounded value (Clinger 1990). Words that are longer or have an
exponent are converted by ``float()``, one by one.

Grammar of a number: ``[+-]? (digits [. digits?] | . digits) ([eE] [+-]? digits)? [fF]?``. This is
stricter than ``float()``, which accepts ``nan``, ``1_000`` and digits of other scripts.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from viewer.rig.arrays import Floats

__all__ = [
    "LARGEST",
    "is_infinite",
    "is_number",
    "is_too_large",
    "parse_numbers",
    "parse_words",
    "to_number",
    "word_begins",
]

LARGEST = float(np.finfo(np.float32).max)
"""Numbers beyond this become infinite on the GPU, so they are refused."""

_NUMBER = re.compile(rb"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?[fF]?")
# NaN and infinity as written by Python, C and Microsoft's C library.
_NOT_FINITE = re.compile(
    rb"[+-]?(?:nan(?:\(\w*\))?|inf(?:inity)?|1\.?#(?:q?nan|snan|ind|inf)\w*)", re.IGNORECASE
)
_NOT_ZERO = re.compile(rb"[+-]?[0.]*[1-9]")
_SMALLEST = float(np.nextafter(0.0, 1.0))  # smallest positive float64
_SPACE = re.compile(rb"[ \t\n\r\v\f]")
_CHUNK = 1 << 17  # bytes; temporary arrays stay in the processor's cache
_PAD = 16  # bytes before a chunk, so that the first words can be read as 16 characters
_MANTISSA_DIGITS = 15

_U = np.uint64
_ZEROS = _U(0x3030303030303030)
_DOTS = _U(0x2E2E2E2E2E2E2E2E)
_LOW7 = _U(0x7F7F7F7F7F7F7F7F)
_HIGH_NIBBLES = _U(0xF0F0F0F0F0F0F0F0)
_SIXES = _U(0x0606060606060606)
_POWERS = 10.0 ** np.arange(_PAD + 1)
# The mask of the last k characters of a little-endian word.
_KEEP = np.array([0] + [(1 << 64) - (1 << (64 - 8 * k)) for k in range(1, 9)], dtype=np.uint64)

Words = NDArray[np.uint64]


def is_number(word: bytes) -> bool:
    """Return whether a word is a finite number that a float32 can represent.

    >>> is_number(b"-.5"), is_number(b"1_000"), is_number(b"1e999")
    (True, False, False)
    """
    return to_number(word) is not None


def to_number(word: bytes) -> float | None:
    """Return a word's value, or None if it is not a finite number that a float32 can represent.

    A nonzero number never becomes 0, however small it is.

    >>> to_number(b"2.5f"), to_number(b"1e-400")
    (2.5, 5e-324)
    """
    if not _NUMBER.fullmatch(word):
        return None
    value = float(word.rstrip(b"fF"))
    if value == 0.0 and _NOT_ZERO.match(word):
        # A tiny number must not round to 0, which would be valid as an index or a count.
        value = math.copysign(_SMALLEST, value)
    return value if abs(value) <= LARGEST else None


def is_infinite(word: bytes) -> bool:
    """Return whether a word is NaN, infinity, or a number that a float32 cannot represent.

    >>> is_infinite(b"-nan"), is_infinite(b"1e999"), is_infinite(b"-1.#IND"), is_infinite(b"up")
    (True, True, True, False)
    """
    return _NOT_FINITE.fullmatch(word) is not None or is_too_large(word)


def is_too_large(word: bytes) -> bool:
    """Return whether a word is a number that a float32 cannot represent.

    >>> is_too_large(b"-1e300"), is_too_large(b"inf")
    (True, False)
    """
    return _NUMBER.fullmatch(word) is not None and to_number(word) is None


def parse_numbers(data: bytes, start: int, end: int) -> tuple[Floats, int]:
    """Parse white-space-separated numbers.

    Parameters
    ----------
    data : bytes
        The file.
    start, end : int
        The part of the data to parse.

    Returns
    -------
    values : (N,)
        The numbers before the first word that is not a number.
    bad : int
        Index of that word, -1 if all are numbers.

    >>> parse_numbers(b"1 -2.5  1e3", 0, 11)[0].tolist()
    [1.0, -2.5, 1000.0]
    """
    parts: list[Floats] = []
    for first, last in _chunk_bounds(data, start, end):
        values, bad = _parse_chunk(data[first:last])
        parts.append(values)
        if bad >= 0:
            return np.concatenate(parts), sum(map(len, parts))
    return (np.concatenate(parts) if parts else np.zeros(0)), -1


def parse_words(data: bytes, start: int, end: int) -> Floats:
    """Parse white-space-separated words, which need not be numbers.

    Parameters
    ----------
    data : bytes
        The file.
    start, end : int
        The part of the data to parse.

    Returns
    -------
    (N,)
        NaN for every word that is not a number.

    >>> parse_words(b"1 up 1e3", 0, 8).tolist()
    [1.0, nan, 1000.0]
    """
    bounds = _chunk_bounds(data, start, end)
    return np.concatenate(
        [np.zeros(0), *(_parse_chunk(data[first:last], whole=True)[0] for first, last in bounds)]
    )


def word_begins(letters: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return the offsets of white-space-separated words.

    >>> word_begins(np.frombuffer(b" 1 23", np.uint8)).tolist()
    [1, 3]
    """
    # The subtraction wraps around, so that one comparison finds 9 to 13.
    inked = ~((letters == 32) | (letters - np.uint8(9) < 5))
    return np.flatnonzero(inked & ~np.concatenate([[False], inked[:-1]]))


def _chunk_bounds(data: bytes, start: int, end: int) -> Iterator[tuple[int, int]]:
    while start < end:
        stop = min(start + _CHUNK, end)
        if stop < end:
            boundary = _SPACE.search(data, stop, end)
            stop = boundary.start() if boundary else end
        yield start, stop
        start = stop


def _parse_chunk(chunk: bytes, whole: bool = False) -> tuple[Floats, int]:
    """Return the numbers before the first invalid word, or all with NaN for invalid words."""
    padded = b" " * _PAD + chunk + b" "
    letters = np.frombuffer(padded, dtype=np.uint8)
    # Control characters, 0-8 and 14-31, would count as white space below, but they are part of
    # a word. The subtraction wraps around, so one comparison finds the second range.
    if letters.min() < 9 or (letters - np.uint8(14) < 18).any():
        return _parse_slowly(chunk, whole)
    space = letters <= ord(" ")
    edges = np.flatnonzero(space[1:] != space[:-1]) + 1
    starts, ends = edges[0::2], edges[1::2]
    if len(starts) == 0:
        return np.zeros(0), -1
    values, odd = _parse_words(padded, letters, starts, ends)
    for index in np.flatnonzero(odd):
        value = to_number(padded[starts[index] : ends[index]])
        if value is None and not whole:
            return values[:index], int(index)
        values[index] = np.nan if value is None else value
    return values, -1


def _parse_slowly(chunk: bytes, whole: bool) -> tuple[Floats, int]:
    values: list[float] = []
    for word in chunk.split():
        value = to_number(word)
        if value is None and not whole:
            return np.array(values), len(values)
        values.append(np.nan if value is None else value)
    return np.array(values, dtype=np.float64), -1


def _parse_words(
    padded: bytes, letters: NDArray[np.uint8], starts: NDArray[np.intp], ends: NDArray[np.intp]
) -> tuple[Floats, NDArray[np.bool_]]:
    """Return the values of words, and a mask of the words that need ``float()`` instead."""
    lengths = ends - starts
    minus = None
    if b"-" in padded or b"+" in padded:
        first = letters.take(starts)
        minus = first == ord("-")
        lengths -= minus | (first == ord("+"))
    # V8 has alignment 1, so eight characters can be gathered from any address.
    windows = np.ndarray(len(padded) - 7, dtype="V8", buffer=padded, strides=(1,))
    has_dots = b"." in padded
    values, odd = _parse_short(windows, ends, lengths, has_dots)
    long_words = np.flatnonzero(lengths > 8)
    if len(long_words):
        values[long_words], odd[long_words] = _parse_long(
            windows, ends.take(long_words), lengths.take(long_words)
        )
    if minus is not None:
        np.negative(values, where=minus, out=values)
    return values, odd


def _parse_short(
    windows: NDArray[np.void], ends: NDArray[np.intp], lengths: NDArray[np.intp], has_dots: bool
) -> tuple[Floats, NDArray[np.bool_]]:
    """Parse unsigned words of at most 8 characters; results of longer ones must be replaced."""
    words = _digits_only(windows.take(ends - 8).view("<u8"), np.minimum(lengths, 8))
    if not has_dots:
        return _eight_digits(words).astype(np.float64), (lengths < 1) | _not_digits(words)
    dot = _dot_bit(words)
    has_dot = dot != 0
    decimals = np.where(has_dot, _letters_after(dot), 0)
    words = np.where(has_dot, _close(words, dot) | _U(0x30), words)
    values = _eight_digits(words) / _POWERS.take(decimals)
    return values, (lengths - has_dot < 1) | _not_digits(words)


def _parse_long(
    windows: NDArray[np.void], ends: NDArray[np.intp], lengths: NDArray[np.intp]
) -> tuple[Floats, NDArray[np.bool_]]:
    """Parse unsigned words of 9 to 16 characters.

    If a word has several points, one remains and is then rejected as a digit.
    """
    low = windows.take(ends - 8).view("<u8")
    high = _digits_only(windows.take(ends - 16).view("<u8"), np.minimum(lengths - 8, 8))
    low_dot, high_dot = _dot_bit(low), _dot_bit(high)
    in_low = low_dot != 0
    in_high = (high_dot != 0) & ~in_low
    decimals = np.where(in_low, _letters_after(low_dot), 0)
    decimals = np.where(in_high, _letters_after(high_dot) + 8, decimals)
    # The free byte of the low word takes the last character of the high word, which moves up by
    # one.
    low = np.where(in_low, _close(low, low_dot) | (high >> _U(56)), low)
    gapless = np.where(in_high, _close(high, high_dot) | _U(0x30), high)
    high = np.where(in_low, (high << _U(8)) | _U(0x30), gapless)
    mantissa = _eight_digits(high) * _U(100_000_000) + _eight_digits(low)
    too_many = lengths - (in_low | in_high) > _MANTISSA_DIGITS
    return mantissa / _POWERS.take(decimals), too_many | _not_digits(low) | _not_digits(high)


def _digits_only(words: Words, lengths: NDArray[np.intp]) -> Words:
    """Replace the characters before the last ``lengths`` with zeros."""
    keep = _KEEP.take(lengths)
    return ((words ^ _ZEROS) & keep) ^ _ZEROS


def _dot_bit(words: Words) -> Words:
    """Return the top bit of the first character that is a decimal point, or 0."""
    x = words ^ _DOTS
    zero = ~(((x & _LOW7) + _LOW7) | x | _LOW7)
    return zero & (~zero + _U(1))


def _letters_after(dot: Words) -> NDArray[np.intp]:
    above = ~((dot << _U(1)) - _U(1))
    return (np.bitwise_count(above) >> 3).astype(np.intp)


def _close(words: Words, dot: Words) -> Words:
    """Move the characters before the point one position towards it."""
    below = (dot >> _U(7)) - _U(1)
    above = ~((dot << _U(1)) - _U(1))
    return (words & above) | ((words & below) << _U(8))


def _not_digits(words: Words) -> NDArray[np.bool_]:
    return (((words & _HIGH_NIBBLES) ^ _ZEROS) | (((words + _SIXES) & _HIGH_NIBBLES) ^ _ZEROS)) != 0


def _eight_digits(words: Words) -> Words:
    """Evaluate eight digits, first character most significant (Lemire's three-step product)."""
    x = words - _ZEROS
    x = (x * _U(10)) + (x >> _U(8))
    mask = _U(0x000000FF000000FF)
    left = (x & mask) * _U(0x000F424000000064)
    right = ((x >> _U(16)) & mask) * _U(0x0000271000000001)
    return (left + right) >> _U(32)
