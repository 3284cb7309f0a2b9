"""Parser for long blocks of decimal numbers, in numpy, exact as ``float()`` above 5e-324.

A block is parsed in chunks that fit into the processor's cache, see ``decimal_words``. The few
words that it cannot round correctly are converted by ``float()``, one by one.

Grammar of a number: ``[+-]? (digits [. digits?] | . digits) ([eE] [+-]? digits)? [fF]?``. This is
stricter than ``float()``, which accepts ``nan``, ``1_000`` and digits of other scripts.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from viewer.formats._text.swar import (
    Indices,
    Words,
    close_gap,
    digits_only,
    eight_digits,
    first_of,
    letters_after,
    not_digits,
    padded,
    words_before,
)
from viewer.progress import report_bytes
from viewer.rig.arrays import Bools, Floats

LARGEST = float(np.finfo(np.float32).max)
"""Numbers beyond this become infinite on the GPU, so they are refused."""
_NUMBER = re.compile(rb"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?[fF]?")

# NaN and infinity as written by Python, C and Microsoft's C library.
_NOT_FINITE = rb"(?i:[+-]?(?:nan(?:\(\w*\))?|inf(?:inity)?|1\.?#(?:q?nan|snan|ind|inf)\w*))"
_NOT_ZERO = re.compile(rb"[+-]?[0.]*[1-9]")
_SMALLEST = float(np.nextafter(0.0, 1.0))  # smallest positive float64
_SPACE = re.compile(rb"[ \t\n\r\v\f]")
_CHUNK = 1 << 17  # bytes per chunk, whose temporary arrays stay in the processor's cache
_LONG = 1 << 20  # number of bytes above which the progress of reading is reported
_FEW = 0.25  # maximum fraction of words with more than 8 characters that are evaluated separately
_HANDFUL = 200  # number of words with an exponent up to which float() is faster
_MANY = 0.5  # fraction of words with an exponent above which all words are evaluated like them
_GROWTH = 1.02  # margin of the array for the expected number of values


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
    return re.fullmatch(_NOT_FINITE, word) is not None or is_too_large(word)


def is_too_large(word: bytes) -> bool:
    """Return whether a word is a number that a float32 cannot represent.

    >>> is_too_large(b"-1e300"), is_too_large(b"inf")
    (True, False)
    """
    return _NUMBER.fullmatch(word) is not None and to_number(word) is None


def parse_numbers(data: bytes, start: int, end: int, is_kept: bool = True) -> tuple[Floats, int]:
    """Parse white-space-separated numbers.

    ``is_kept``: whether the numbers are kept in the user's cache, if all are valid. Returns
    ``values``: (N,), the numbers before the first word that is not a number; ``bad``: index of that
    word, -1 if all are numbers.

    >>> parse_numbers(b"1 -2.5  1e3", 0, 11)[0].tolist()
    [1.0, -2.5, 1000.0]
    """
    from viewer.media.array_cache import slot_of

    slot = slot_of("numbers-1", data, start, end) if is_kept else None
    kept = None if slot is None else slot.load("<f8", 1)
    if kept is not None:
        return kept, -1
    values, bad = _parse(data, start, end, whole=False)
    if slot is not None and bad < 0:
        slot.store(values)
    return values, bad


def parse_few(text: bytes) -> tuple[Floats, int]:
    """Parse up to about a hundred numbers, for which ``float()`` is faster; see ``parse_numbers``.

    >>> parse_few(b"1 -2.5  up")
    (array([ 1. , -2.5]), 2)
    """
    return _parse_singly(text, whole=False)


def parse_words(data: bytes, start: int, end: int) -> Floats:
    """Parse white-space-separated words, which need not be numbers.

    Returns (N,), NaN for every word that is not a number.

    >>> parse_words(b"1 up 1e3", 0, 8).tolist()
    [1.0, nan, 1000.0]
    """
    return _parse(data, start, end, whole=True)[0]


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


def _parse(data: bytes, start: int, end: int, whole: bool) -> tuple[Floats, int]:
    """Return the numbers before the first invalid word, or all with NaN for invalid words."""
    values, count = np.empty(0), 0
    for first, last in _chunk_bounds(data, start, end):
        found, bad = _parse_chunk(data[first:last], whole)
        if count + len(found) > len(values):
            # A large array grows without being copied, because its pages are moved.
            rest = len(found) * (end - last) / (last - first)
            values.resize(count + len(found) + int(_GROWTH * rest), refcheck=False)
        values[count : count + len(found)] = found
        count += len(found)
        # Short texts are parts of a longer one, whose progress its reader reports.
        if end - start > _LONG:
            report_bytes(last, len(data))
        if bad >= 0:
            break
    else:
        bad = -1
    values.resize(count, refcheck=False)
    return values, count if bad >= 0 else -1


def _parse_chunk(chunk: bytes, whole: bool) -> tuple[Floats, int]:
    text = padded(chunk)
    letters = np.frombuffer(text, dtype=np.uint8)
    # Control characters, 0-8 and 14-31, would be treated as white space below, but they are part of
    # a word. The subtraction wraps around, so one comparison finds the second range.
    if letters.min() < 9 or (letters - np.uint8(14) < 18).any():
        return _parse_singly(chunk, whole)
    space = letters <= ord(" ")
    edges = np.flatnonzero(space[1:] != space[:-1]) + 1
    starts, ends = np.ascontiguousarray(edges.reshape(-1, 2).T)
    if len(starts) == 0:
        return np.zeros(0), -1
    values, odd = _parse_signed(text, letters, starts, ends)
    for index in np.flatnonzero(odd):
        value = to_number(text[starts[index] : ends[index]])
        if value is None and not whole:
            return values[:index], int(index)
        values[index] = np.nan if value is None else value
    return values, -1


def _parse_singly(chunk: bytes, whole: bool) -> tuple[Floats, int]:
    values: list[float] = []
    for word in chunk.split():
        value = to_number(word)
        if value is None and not whole:
            return np.array(values), len(values)
        values.append(np.nan if value is None else value)
    return np.array(values, dtype=np.float64), -1


def _parse_signed(
    text: bytes, letters: NDArray[np.uint8], starts: Indices, ends: Indices
) -> tuple[Floats, Bools]:
    """Return the values of words, and a mask of the words that need ``float()`` instead."""
    minus = None
    if b"-" in text or b"+" in text:
        first = letters.take(starts)
        minus = first == ord("-")
        starts = starts + (minus | (first == ord("+")))
    aligned = letters.view("<u8")
    n_exponents = int(np.count_nonzero(letters | np.uint8(32) == ord("e")))
    if n_exponents > _MANY * len(ends):
        values, odd = _parse_exponentials(letters, aligned, starts, ends)
    else:
        values, odd = _parse_plain(letters, aligned, starts, ends, b"." in text)
        some = np.flatnonzero(odd) if n_exponents > _HANDFUL else ()
        if len(some):
            values[some], odd[some] = _parse_exponentials(
                letters, aligned, starts[some], ends[some]
            )
    odd |= values > LARGEST
    if minus is not None:
        np.negative(values, where=minus, out=values)
    return values, odd


def _parse_plain(
    letters: NDArray[np.uint8], aligned: Words, starts: Indices, ends: Indices, has_dots: bool
) -> tuple[Floats, Bools]:
    """Return the values of words without exponents, and a mask of all others."""
    lengths = ends - starts
    is_long = lengths > 8
    n_long = int(np.count_nonzero(is_long))
    if n_long > _FEW * len(ends):
        return _parse_decimals(letters, aligned, starts, ends)
    values, odd = _parse_short(aligned, ends, lengths, has_dots)
    if n_long:
        some = np.flatnonzero(is_long)
        values[some], odd[some] = _parse_decimals(letters, aligned, starts[some], ends[some])
    return values, odd


# Vectorised parsing of decimal numbers with numpy.
#
# A word is the text of one number. Its digits form an integer w, and its value is w * 10^q. If w
# and 10^|q| are exact in float64, their product or quotient is the correctly rounded value
# (Clinger 1990). Otherwise the product is computed to about 100 bits; if its error could change
# the rounding, the word is converted by ``float()``.

_U = np.uint64
_DOT = ord(".")
_DOTS = _U(0x2E2E2E2E2E2E2E2E)
_ZERO = _U(0x30)
_MOST_DIGITS = 24  # maximum number of characters read before or after the decimal point
_HIGHEST = 1843  # upper digits of a 64-bit integer of 20 digits
_LARGEST = 1.8e19  # below 2^64
_EXACT = _U(1 << 53)

# Products with powers beyond 10^19 are rejected by _LARGEST, unless they are 0.
_TENS = np.array([10**k if k < 20 else 0 for k in range(_MOST_DIGITS + 1)], dtype=np.uint64)
_POWERS = 10.0 ** np.arange(_MOST_DIGITS + 1)


def _parse_short(
    aligned: Words, ends: Indices, lengths: Indices, has_dots: bool
) -> tuple[Floats, Bools]:
    """Parse unsigned words of at most 8 characters; results for longer ones must be replaced.

    ``aligned``: (N,), a padded text as 64-bit words. ``ends``, ``lengths``: (W,), offset after each
    word, and its number of characters. Returns ``values``: (W,), their values; ``odd``: (W,) bool,
    words that are not such numbers.
    """
    words = digits_only(words_before(aligned, ends, 1)[0], np.minimum(lengths, 8))
    if not has_dots:
        return eight_digits(words).astype(np.float64), (lengths < 1) | (not_digits(words) != 0)
    dot = first_of(words, _DOTS)
    has_dot = dot != 0
    decimals = np.where(has_dot, letters_after(dot), 0)
    words = np.where(has_dot, close_gap(words, dot) | _ZERO, words)
    values = eight_digits(words) / _POWERS.take(decimals)
    return values, (lengths - has_dot < 1) | (not_digits(words) != 0)


def _parse_decimals(
    letters: NDArray[np.uint8], aligned: Words, starts: Indices, ends: Indices
) -> tuple[Floats, Bools]:
    """Parse unsigned words of any length, without exponents.

    ``letters``, ``aligned``: (N,), (N / 8,), a padded text as characters, and as 64-bit words.
    ``starts``, ``ends``: (W,), offsets of the words. Returns ``values``: (W,), their values;
    ``odd``: (W,) bool, words that are not such numbers, or whose values are unknown.
    """
    mantissas, decimals, odd = _mantissas(letters, aligned, starts, ends)
    return _scaled(mantissas, -decimals, odd)


def _parse_exponentials(
    letters: NDArray[np.uint8], aligned: Words, starts: Indices, ends: Indices
) -> tuple[Floats, Bools]:
    """Parse unsigned words with or without exponents; see ``_parse_decimals``."""
    marks = _first_within(np.flatnonzero(letters | np.uint8(32) == ord("e")), starts, ends)
    has_exponent = marks < ends
    firsts = np.minimum(marks + 1, ends)
    signs = letters.take(firsts)
    is_minus = has_exponent & (signs == ord("-"))
    lengths = ends - firsts - (is_minus | (has_exponent & (signs == ord("+"))))
    digits = digits_only(words_before(aligned, ends, 1)[0], np.clip(lengths, 0, 8))
    exponents = eight_digits(digits).astype(np.intp)
    mantissas, decimals, odd = _mantissas(letters, aligned, starts, marks)
    odd |= (not_digits(digits) != 0) | (lengths > 8) | (has_exponent & (lengths < 1))
    return _scaled(mantissas, np.where(is_minus, -exponents, exponents) - decimals, odd)


def _first_within(places: Indices, starts: Indices, ends: Indices) -> Indices:
    """Return the first of some ascending offsets within each word; its end if there is none."""
    if len(places) == 0:
        return ends
    if len(places) == len(ends) and (places >= starts).all() and (places < ends).all():
        return places
    following = np.append(places, ends[-1]).take(np.searchsorted(places, starts))
    return np.minimum(following, ends)


def _mantissas(
    letters: NDArray[np.uint8], aligned: Words, starts: Indices, ends: Indices
) -> tuple[Words, Indices, Bools]:
    """Return digits as integers below 2^64, numbers of decimals, and words that cannot be parsed.

    If a word has several points, the second is rejected as a digit.
    """
    stops = _first_within(np.flatnonzero(letters == _DOT), starts, ends)
    decimals = np.maximum(ends - stops - 1, 0)
    n_whole = stops - starts
    whole, is_bad = _digits(aligned, stops, n_whole)
    fraction, is_odd = _digits(aligned, ends, decimals)
    odd = is_bad | is_odd | (n_whole + decimals < 1)
    decimals = np.minimum(decimals, _MOST_DIGITS)
    odd |= whole * _POWERS.take(decimals) + fraction > _LARGEST
    return whole * _TENS.take(decimals) + fraction, decimals, odd


def _digits(aligned: Words, ends: Indices, lengths: Indices) -> tuple[Words, Bools]:
    """Evaluate the digits before offsets; also return words with non-digits or too many digits.

    The integers are below 2^64.
    """
    longest = int(lengths.max(initial=1))
    count = min(max(-(-longest // 8), 1), _MOST_DIGITS // 8)
    words = words_before(aligned, ends, count)
    if count == 1:
        words[0] = digits_only(words[0], np.minimum(lengths, 8))
        values, bad = eight_digits(words[0]), not_digits(words[0])
    else:
        for place, word in enumerate(words):
            kept = np.minimum(np.maximum(lengths - 8 * place, 0), 8)
            words[place] = digits_only(word, kept)
        values, bad = eight_digits(words[-1]), not_digits(words[-1])
        if count == 3:
            bad |= values > _HIGHEST
        for word in words[-2::-1]:
            values = values * _U(10**8) + eight_digits(word)
            bad |= not_digits(word)
    is_bad = bad != 0
    return values, is_bad | (lengths > _MOST_DIGITS) if longest > _MOST_DIGITS else is_bad


def _scaled(mantissas: Words, exponents: Indices, odd: Bools) -> tuple[Floats, Bools]:
    """Return mantissas * 10^exponents, and the words for which the result may be wrong."""
    lowest, highest = int(exponents.min(initial=0)), int(exponents.max(initial=0))
    if highest > 0 or lowest < -22:
        return _long_products(mantissas, exponents, odd)
    many = mantissas > _EXACT
    values = mantissas / _POWERS.take(-exponents)
    n_many = int(np.count_nonzero(many))
    if n_many > _FEW * len(many):
        return _long_products(mantissas, exponents, odd)
    if n_many:
        some = np.flatnonzero(many)
        values[some], odd[some] = _long_products(mantissas[some], exponents[some], odd[some])
    return values, odd


def _long_products(mantissas: Words, exponents: Indices, odd: Bools) -> tuple[Floats, Bools]:
    from viewer.formats._text.swar import ERROR, FARTHEST, times_power

    odd = odd | (np.abs(exponents) > FARTHEST)
    if odd.any():
        exponents, mantissas = np.where(odd, 0, exponents), np.where(odd, _U(0), mantissas)
    nearest = mantissas.astype(np.float64)
    rests = (mantissas - nearest.astype(np.uint64)).view(np.int64).astype(np.float64)
    values, errors = times_power(nearest, rests, exponents)
    slack = values * ERROR
    odd |= (values + (errors + slack) != values) | (values + (errors - slack) != values)
    return values, odd
