"""Formatting of counts, lists and names in messages.

The functions return :class:`Shown`: text that keeps the value which it shows. So
``values={"n": counted(n, "vertex")}`` is written as "3 vertices" in a sentence, and is 3 as data.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple

_PLURALS = {"vertex": "vertices", "matrix": "matrices"}
_BYTES = {"GB": 1e9, "MB": 1e6, "kB": 1e3}
_LONGEST = 1000  # maximum number of characters of a text in a message
_NO_TEXT = re.compile("[\udc80-\udcff]")  # bytes that were decoded with "surrogateescape"
NO_VALUE = object()
"""Value of a text that is no data: a verb, a remedy."""
_open_windows: list[None] = []
_is_data = ContextVar("is_data", default=False)


class Shown(str):
    """Text of a value in a sentence."""

    value: object
    """The value as data, or ``NO_VALUE``."""

    def __new__(cls, text: str, value: object = NO_VALUE) -> Shown:
        """Return the text of a value."""
        shown = super().__new__(cls, text)
        shown.value = value
        return shown


class Remedy(NamedTuple):
    """Words of a sentence that name a control in the window, and an option elsewhere."""

    in_window: str
    elsewhere: str

    def __str__(self) -> str:
        """Return the words for the place where the sentence is shown."""
        return self.in_window if _open_windows and not _is_data.get() else self.elsewhere


@contextmanager
def in_window() -> Iterator[None]:
    """Word all messages for the window, in every thread: remedies name its controls."""
    _open_windows.append(None)
    try:
        yield
    finally:
        _open_windows.pop()


@contextmanager
def as_data() -> Iterator[None]:
    """Word the messages of this thread for the command line, even while a window is open."""
    # JSON and records of runs are read elsewhere: programs that compare them find one wording, and
    # ``render --panels`` opens a window's interface without a user in front of it.
    before = _is_data.set(True)
    try:
        yield
    finally:
        _is_data.reset(before)


def printable(text: object, limit: int = 200) -> str:
    r"""Return ``text`` on one line: control characters escaped, truncated to ``limit`` characters.

    >>> printable("two\nlines")
    'two\\nlines'
    """
    shown = "".join(
        letter
        if letter.isprintable()
        else letter.encode("unicode_escape", "surrogatepass").decode()
        for letter in str(text)
    )
    return shown if len(shown) <= limit else shown[: limit - 1] + "…"


def capitalized(text: str) -> str:
    """Return a text that begins with a capital, as a sentence does.

    >>> capitalized("select a joint in the Rig panel")
    'Select a joint in the Rig panel'
    """
    return text[:1].upper() + text[1:]


def quoted(word: bytes | str | None, limit: int = 40) -> Shown:
    r"""Return a word from a file in double quotes, on one line; None is the end of the file.

    >>> quoted(b"up\x00"), quoted("left")
    ('"up\\x00"', '"left"')
    """
    if word is None:
        return Shown("the end of the file", word)
    return Shown(f'"{bare(word, limit)}"', word)


def bare(word: bytes | str, limit: int = 40) -> Shown:
    """Return a word from a file like ``quoted``, without the quotes."""
    text = word[:200].decode("utf-8", "replace") if isinstance(word, bytes) else word
    return Shown(printable(text, limit), word)


def brief(name: str, limit: int = 60) -> Shown:
    """Return a name in a file on one line, truncated; bytes that are no text become \ufffd."""
    return Shown(printable(_NO_TEXT.sub("\ufffd", name[: limit + 1]), limit), name)


def rounded(value: float, digits: int = 3) -> Shown:
    """Format a number with some digits, or all integer digits of numbers below a million.

    >>> rounded(0.012345), rounded(1284.0), rounded(12345.6, 5), rounded(3.2e30)
    ('0.0123', '1,284', '12346', '3.2e+30')
    """
    is_long = 10.0**digits - 0.5 <= abs(value) < 1e6
    return Shown(format(value, ",.0f" if is_long else f".{digits}g"), value)


def percent(fraction: float) -> Shown:
    """Format a fraction in percent; one below 1% keeps a digit, because 0% would say none.

    >>> percent(0.183), percent(0.004), percent(-0.0001), percent(1.0)
    ('18%', '0.4%', '0%', '100%')
    """
    digits = 0 if abs(fraction) >= 0.0095 else 1
    return Shown(f"{round(100.0 * fraction, digits) + 0.0:g}%", fraction)


def file_size(count: int) -> Shown:
    """Return a number of bytes as file managers show it: in powers of 1000.

    >>> file_size(958), file_size(1248), file_size(999_999), file_size(3_146_672)
    ('958 bytes', '1.25 kB', '1 MB', '3.15 MB')
    """
    if count < 1000:
        return counted(count, "byte")
    unit = next((unit for unit, one in _BYTES.items() if count >= 0.9995 * one), "kB")
    return Shown(f"{rounded(count / _BYTES[unit])} {unit}", count)


def counted(count: int, noun: str, one: str = "", many: str = "", of: int | None = None) -> Shown:
    """Return a count with its noun and, if given, the verb for one or many that agrees with it.

    >>> counted(1, "vertex", "has", "have"), counted(3, "vertex", "has", "have")
    ('1 vertex has', '3 vertices have')
    >>> counted(1, "frame", "is", "are", of=20)
    '1 of 20 frames is'
    """
    head, space, last = noun.rpartition(" ")
    plural = f"{head}{space}{_PLURALS.get(last, f'{last}s')}"
    total = "" if of is None else f"of {of} "
    text = f"{count} {total}{noun if (count if of is None else of) == 1 else plural}"
    return Shown(f"{text} {one if count == 1 else many}" if one else text, count)


def agree(count: int, one: str, many: str) -> Shown:
    """Return the word that agrees with a count: the first for 1."""
    return Shown(one if count == 1 else many)


def optional(pattern: str, value: object) -> Shown:
    """Return ``pattern.format(value)``, or nothing without a value.

    >>> optional(" at {}", "row 3"), optional(" at {}", "")
    (' at row 3', '')
    """
    if not value:
        return Shown("", value)
    text = "; ".join(map(str, value)) if isinstance(value, list | tuple) else value
    return Shown(pattern.format(printable(text, _LONGEST)), value)


def axes(shape: Sequence[int | str | None]) -> Shown:
    """Return the axes of an array: ``800 x 3``; letters and None stand for any size."""
    # Files may declare 32 axes of any size.
    text = printable(" x ".join("any" if axis is None else str(axis) for axis in shape), 80)
    return Shown(text or "a single", shape)


def one_of(values: Sequence[object]) -> Shown:
    """Return alternatives joined by commas and "or".

    >>> one_of([9, 48, 63]), one_of([3])
    ('9, 48 or 63', '3')
    """
    *others, last = map(printable, values)
    return Shown(f"{', '.join(others)} or {last}" if others else last, values)


def listed(names: Sequence[object], limit: int = 6) -> Shown:
    """Return names on one line, at most ``limit`` of them; "none" if there are none.

    >>> listed(["a", "b", "c"], 2)
    'a, b and 1 more'
    """
    more = f" and {len(names) - limit} more" * (len(names) > limit)
    return Shown((", ".join(map(printable, names[:limit])) + more) or "none", names)


def all_of(names: Iterable[object]) -> Shown:
    """Return all names on one line; "none" if there are none."""
    return Shown(", ".join(map(printable, names)) or "none", names)
