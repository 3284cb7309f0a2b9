"""Parser for long blocks of decimal numbers, exact as ``float()`` above 5e-324.

A block is parsed in chunks that fit into the processor's cache: whole numbers by numpy, others by
orjson as a JSON list. Only chunks with other words are parsed word by word.

Grammar of a number: ``[+-]? (digits [. digits?] | . digits) ([eE] [+-]? digits)? [fF]?``. This is
stricter than ``float()``, which accepts ``nan``, ``1_000`` and digits of other scripts.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from viewer.progress import report_bytes
from viewer.rigs.arrays import Bools, Floats

LARGEST = float(np.finfo(np.float32).max)
"""Numbers beyond this become infinite on the GPU, so they are refused."""
_NUMBER = re.compile(rb"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?[fF]?")

# NaN and infinity as written by Python, C and Microsoft's C library.
_NOT_FINITE = rb"(?i:[+-]?(?:nan(?:\(\w*\))?|inf(?:inity)?|1\.?#(?:q?nan|snan|ind|inf)\w*))"
_NOT_ZERO = re.compile(rb"[+-]?[0.]*[1-9]")
_SMALLEST = float(np.nextafter(0.0, 1.0))  # smallest positive float64
_SPACE = re.compile(rb"[ \t\n\r\v\f]")
_JSON = bytes(
    {ord(" "): ord(","), ord("E"): ord("e"), **{each: each for each in b"0123456789+-.e"}}.get(
        letter, 255
    )
    for letter in bytes.maketrans(b"\t\n\r\v\f", b" " * 5)
)
"""Numbers between commas instead of spaces; 255 for letters that are part of no usual number."""
_CHUNK = 1 << 17  # bytes per chunk, whose temporary arrays stay in the processor's cache
_PART = 1 << 11  # bytes per part of a chunk with invalid words
_LONG = 1 << 20  # number of bytes above which the progress of reading is reported
_GROWTH = 1.02  # margin of the array for the expected number of values
_OVERFLOW = np.iinfo(np.int64).max  # result of numpy for integers above it
_ZEROS = b"0" * 300  # occurs in every number below 1e-300 without an exponent


def is_number(word: bytes) -> bool:
    """Return whether a word is a finite number that a float32 can represent."""
    return to_number(word) is not None


def to_number(word: bytes) -> float | None:
    """Return a word's value, or None if it is not a finite number that a float32 can represent."""
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
    """Return whether a word is a number that a float32 cannot represent."""
    return _NUMBER.fullmatch(word) is not None and to_number(word) is None


def parse_numbers(data: bytes, start: int, end: int, is_kept: bool = True) -> tuple[Floats, int]:
    """Parse numbers separated by white space: those before the first invalid word, and its index.

    The index is -1 if all are numbers; only these are kept in the user's cache, with ``is_kept``.
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
    """Parse as ``parse_numbers``, but up to about a hundred, for which ``float()`` is faster."""
    return _parse_singly(text, whole=False)


def parse_words(data: bytes, start: int, end: int) -> Floats:
    """Parse white-space-separated words (N,); NaN stands for every word that is not a number."""
    return _parse(data, start, end, whole=True)[0]


def word_begins(letters: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return the offsets of white-space-separated words (N,)."""
    inked = ~are_blank(letters)
    return np.flatnonzero(inked & ~np.concatenate([[False], inked[:-1]]))


def are_blank(letters: NDArray[np.uint8]) -> Bools:
    """Return whether letters are white space: (N,)."""
    # The subtraction wraps around, so that one comparison finds 9 to 13.
    return (letters == 32) | (letters - np.uint8(9) < 5)


def line_ends(letters: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return the offsets of LF and CR (L,)."""
    return np.flatnonzero((letters == 10) | (letters == 13))


def _chunk_bounds(data: bytes, start: int, end: int, size: int) -> Iterator[tuple[int, int]]:
    while start < end:
        stop = min(start + size, end)
        if stop < end:
            boundary = _SPACE.search(data, stop, end)
            stop = boundary.start() if boundary else end
        yield start, stop
        start = stop


def _parse(
    data: bytes, start: int, end: int, whole: bool, size: int | None = None
) -> tuple[Floats, int]:
    """Return the numbers before the first invalid word, or all with NaN for invalid words."""
    size = _CHUNK if size is None else size
    values, count = np.empty(0), 0
    for first, last in _chunk_bounds(data, start, end, size):
        parsed, bad = _parse_usual(data[first:last]), -1
        if parsed is not None:
            found = parsed
        elif size > _PART:
            found, bad = _parse(data, first, last, whole, _PART)
        else:
            found, bad = _parse_singly(data[first:last], whole)
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


def _parse_usual(chunk: bytes) -> Floats | None:
    """Return the numbers of a chunk; None if any is invalid, or written in a rare form."""
    import orjson

    text = chunk.translate(_JSON)
    letters = np.frombuffer(text, np.uint8)
    is_kept = letters != ord(",")
    if not is_kept.any():
        return np.zeros(0)
    if letters.max() == 255:
        return None
    if not any(mark in text for mark in (b".", b"-", b"e", b"+")):
        whole = np.fromstring(chunk, np.int64, sep=" ")
        return whole.astype(np.float64) if whole.max() < _OVERFLOW else None
    # A JSON list has a single comma between numbers.
    is_kept[1:] |= is_kept[:-1]
    text = letters[is_kept].tobytes().strip(b",")
    try:
        numbers = orjson.loads(b"[" + text + b"]")
    except orjson.JSONDecodeError:
        try:
            # Words such as "+1" and ".5" are not numbers in JSON.
            numbers = [*map(float, text.split(b","))]
        except ValueError:
            return None
    values = np.fromiter(numbers, np.float64, len(numbers))
    if not max(values.max(), -values.min()) <= LARGEST:
        return None
    zeros = np.flatnonzero(values == 0.0).tolist()
    if zeros and (b"e" in text or _ZEROS in text or b"-0," in text + b","):
        # JSON has no negative zero among its integers, and tiny numbers became 0.
        words = text.split(b",")
        for index in zeros:
            values[index] = to_number(words[index])
    return values


def _parse_singly(chunk: bytes, whole: bool) -> tuple[Floats, int]:
    values: list[float] = []
    for word in chunk.split():
        value = to_number(word)
        if value is None and not whole:
            return np.array(values), len(values)
        values.append(np.nan if value is None else value)
    return np.array(values, dtype=np.float64), -1
