"""Text of many numbers, written by orjson: the shortest digits that give the same float64."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from viewer.rigs.arrays import Bytes, Floats, Item

_AT_ONCE = 1 << 13  # numbers per part, whose temporary arrays stay in the processor's cache
_EXACT = 1e15  # integers of up to 15 digits survive the conversion to float64 and back
_POWERS = 10.0 ** np.arange(23)  # all powers of ten that are exact in float64


def row_texts(
    rows: NDArray[np.number],
    digits: int | None = None,
    between: bytes = b" ",
    within: bytes = b"/",
    start: bytes = b"",
) -> Iterator[bytes]:
    """Yield the lines of a table (N, C), or (N, G, C) with G groups per line, in parts.

    ``between`` separates groups, and ``within`` the C numbers of a group; without groups,
    ``between`` separates all numbers. ``digits``: significant digits, without the zeros at their
    end; None for the shortest text of the same float64. Small numbers have an exponent.
    """
    closing = b"]" * (rows.ndim - 1)
    for part in _parts(rows):
        text = dumped(part if digits is None else _significant(part, digits))[rows.ndim : -1]
        text = text.replace(closing + b"," + b"[" * len(closing), b"\n" + start)
        text = text[: -len(closing)] + b"\n"
        if digits is not None:
            for mark in (b",", b"\n", b"]"):
                text = text.replace(b".0" + mark, mark)
        if rows.ndim == 3:
            text = text.replace(b",", within).replace(b"]" + within + b"[", between)
        yield start + text.replace(b",", between)


def fixed_texts(rows: Floats, decimals: int, between: bytes = b" ") -> Iterator[bytes]:
    """Yield the lines of a table (N, C) in parts, with a fixed number of decimals, 1 or more."""
    for part in _parts(rows):
        text = _fixed(part, decimals)
        yield text if between == b" " else text.replace(b" ", between)


def dumped(values: NDArray[np.number]) -> bytes:
    """Return numbers as JSON."""
    import orjson

    return orjson.dumps(np.ascontiguousarray(values), option=orjson.OPT_SERIALIZE_NUMPY)


def _parts(rows: NDArray[Item]) -> Iterator[NDArray[Item]]:
    step = max(_AT_ONCE // max(rows[:1].size, 1), 1)
    for first in range(0, len(rows), step):
        yield rows[first : first + step]


def _significant(values: NDArray[np.number], digits: int) -> Floats:
    """Return numbers whose shortest text has at most this many digits, as ``%.{digits}g`` has."""
    sizes = np.abs(values)
    places = digits - 1 - np.floor(np.log10(sizes, where=sizes > 0.0, out=np.zeros(sizes.shape)))
    # A whole number over an exact power of ten is rounded only once, to the float64 nearest to the
    # decimal number, whose shortest text is that number.
    power = _POWERS.take(places.astype(np.intp), mode="clip")
    rounded = np.rint(values * power) / power
    for index in np.argwhere((places < 0) | (places >= len(_POWERS))).tolist():
        rounded[tuple(index)] = float(f"{values[tuple(index)]:.{digits}g}")
    return rounded


def _fixed(rows: Floats, decimals: int) -> bytes:
    """Return the lines of ``np.round(row, decimals)``, with all decimals."""
    with np.errstate(over="ignore"):
        scaled = np.rint(rows * 10.0**decimals)
        most = float(np.abs(scaled).max(initial=0.0))
        if not most < _EXACT:
            line = b" ".join([b"%.*f"] * rows.shape[1]) + b"\n"
            values = (np.round(rows, decimals) + 0.0).ravel().tolist()
            return line * len(rows) % tuple(part for value in values for part in (decimals, value))
    # All numbers get the same width by a 1 before their leading zeros.
    numbers = np.abs(scaled).astype(np.int64).ravel()
    width = max(len(str(int(most))), decimals + 1)
    text = np.frombuffer(dumped(numbers + 10**width), np.uint8)[1:].reshape(len(numbers), -1)
    whole = width - decimals
    letters: Bytes = np.empty((len(numbers), width + 3), dtype=np.uint8)
    letters[:, 0] = ord("-")
    letters[:, 1 : whole + 1] = text[:, 1 : whole + 1]
    letters[:, whole + 1] = ord(".")
    letters[:, whole + 2 : -1] = text[:, whole + 1 : -1]
    letters[:, -1] = ord(" ")
    letters.reshape(*rows.shape, -1)[:, -1, -1] = ord("\n")
    is_shown = np.ones(letters.shape, dtype=np.bool_)
    is_shown[:, 0] = scaled.ravel() < 0.0
    for place in range(1, whole):
        is_shown[:, place] = numbers >= 10 ** (width - place)
    return letters[is_shown].tobytes()
