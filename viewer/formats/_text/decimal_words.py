"""Vectorised parsing of decimal numbers with numpy.

A word is the text of one number. Its digits form an integer w, and its value is w * 10^q. If w and
10^|q| are exact in float64, their product or quotient is the correctly rounded value (Clinger
1990). Otherwise the product is computed to about 100 bits; if its error could change the rounding,
the word is converted by ``float()``.
"""

from __future__ import annotations

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
    words_before,
)
from viewer.rig.arrays import Bools, Floats

__all__ = ["parse_decimals", "parse_exponentials", "parse_short"]

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
_FEW = 0.25  # maximum fraction of words that are evaluated separately


def parse_short(
    aligned: Words, ends: Indices, lengths: Indices, has_dots: bool
) -> tuple[Floats, Bools]:
    """Parse unsigned words of at most 8 characters; results for longer ones must be replaced.

    Parameters
    ----------
    aligned : (N,)
        A padded text as 64-bit words.
    ends, lengths : (W,)
        Offset after each word, and its number of characters.
    has_dots : bool
        Whether any word can have a decimal point.

    Returns
    -------
    values : (W,)
        Their values.
    odd : (W,) bool
        Words that are not such numbers.
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


def parse_decimals(
    letters: NDArray[np.uint8], aligned: Words, starts: Indices, ends: Indices
) -> tuple[Floats, Bools]:
    """Parse unsigned words of any length, without exponents.

    Parameters
    ----------
    letters, aligned : (N,), (N / 8,)
        A padded text as characters, and as 64-bit words.
    starts, ends : (W,)
        Offsets of the words.

    Returns
    -------
    values : (W,)
        Their values.
    odd : (W,) bool
        Words that are not such numbers, or whose values are unknown.
    """
    mantissas, decimals, odd = _mantissas(letters, aligned, starts, ends)
    return _scaled(mantissas, -decimals, odd)


def parse_exponentials(
    letters: NDArray[np.uint8], aligned: Words, starts: Indices, ends: Indices
) -> tuple[Floats, Bools]:
    """Parse unsigned words with or without exponents; see ``parse_decimals``."""
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
    from viewer.formats._text.powers import ERROR, FARTHEST, times_power

    odd = odd | (np.abs(exponents) > FARTHEST)
    if odd.any():
        exponents, mantissas = np.where(odd, 0, exponents), np.where(odd, _U(0), mantissas)
    nearest = mantissas.astype(np.float64)
    rests = (mantissas - nearest.astype(np.uint64)).view(np.int64).astype(np.float64)
    values, errors = times_power(nearest, rests, exponents)
    slack = values * ERROR
    odd |= (values + (errors + slack) != values) | (values + (errors - slack) != values)
    return values, odd
