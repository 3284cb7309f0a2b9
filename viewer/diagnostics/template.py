"""Message templates: ``str.format`` with additional format specifications.

=====================  ===========================================================================
``{word:quoted}``      text in quotes; None is the end of the file
``{word:word}``        the same without quotes
``{name}``             number unchanged, text with control characters escaped
``{name:.3g}``         a number with three digits, see ``viewer.phrases.rounded``
``{name:text}``        the same, at most 200 characters
``{name:name}``        a name in a file, at most 60 characters; undecodable bytes as �
``{names:list}``       the first six and the number of others, or ``none``; ``list12``: twelve
``{names:all}``        every name
``{shape:axes}``       the axes of an array: ``800 x 3``; letters stand for any size
``{names:or}``         alternatives
``{size:bytes}``       the size of a file: ``1.25 kB``
``{n:#vertex}``        a count with its noun: ``3 vertices``
``{n:#vertex|is|are}`` the same with a verb that agrees
``{n:#frame/{all}}``   a count of a total: ``3 of 20 frames``; a verb may follow
``{n:?one|many}``      the first for 1, the second for other counts
``{near:+; {}}``       the rest of the specification unless the value is empty; ``{}`` is the value,
                       and a list is joined by semicolons; ``{:list}``: formatted as above
``{window:?one|other}``  the first in the window, the second elsewhere; no value is needed
=====================  ===========================================================================
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from string import Formatter
from typing import Any

from viewer.phrases import counted, file_size, listed, one_of, printable, quoted, rounded

_SIGNED = re.compile(r"\+z?[.\d]*[efg%]")  # specification of a signed number
_DIGITS = re.compile(r"\.(\d)g")  # specification of a number rounded to some digits
_PLACE = "\0"  # placeholder of a value inside its own specification
_PLACED = re.compile("\0(?:([a-z0-9]+)\1)?")  # the placeholder, and the specification it may have
_LONGEST = 1000  # maximum number of characters of a text value
_LONGEST_NAME = 60
_NO_TEXT = re.compile("[\udc80-\udcff]")  # bytes that were decoded with "surrogateescape"


_WINDOW = "window"
_open_windows: list[None] = []
_is_data = ContextVar("is_data", default=False)


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
    """Word the messages of this thread for the command line, even while a window is open.

    For JSON and records of runs, which are read elsewhere: programs that compare them find one
    wording, and ``render --panels`` opens a window's interface without a user in front of it.
    """
    before = _is_data.set(True)
    try:
        yield
    finally:
        _is_data.reset(before)


def rendered(template: str, values: Mapping[str, Any]) -> str:
    """Return a template with its values filled in."""
    is_shown = bool(_open_windows) and not _is_data.get()
    return _FORMATTER.vformat(template, (), {_WINDOW: int(is_shown), **values})


def fields(template: str) -> dict[str, str]:
    """Return the names of the values of a template, each with its specification."""
    found = dict[str, str]()
    for _, name, spec, _ in Formatter().parse(template):
        if name:
            inside = fields(spec or "")
            if name == _WINDOW:
                found |= inside
                continue
            # Totals are fields inside the specification: ``{n:#frame/{all}}``.
            found |= {name: spec or "", **dict.fromkeys(inside, "d")}
    return found


class _Formatter(Formatter):
    def format_field(self, value: Any, format_spec: str) -> str:
        """Return one value formatted by its specification."""
        kind, rest = format_spec[:1], format_spec[1:]
        if kind == "#":
            noun, one, many, *_ = [*rest.split("|"), "", ""]
            noun, _, total = noun.partition("/")
            return counted(value, noun, one, many, of=int(total) if total else None)
        if kind == "?":
            one, many = rest.split("|")
            return one if value == 1 else many
        if kind == "+" and not _SIGNED.fullmatch(format_spec):
            # ``{}`` inside the specification has been replaced by the placeholder by now.
            return _PLACED.sub(lambda place: _placed(value, place[1]), rest) if value else ""
        if value == _PLACE and format_spec:
            return f"{_PLACE}{format_spec}\1"
        if not format_spec and isinstance(value, str) and value != _PLACE:
            return printable(value, _LONGEST)
        if format_spec.startswith("list"):
            return listed([*map(printable, value)], int(format_spec[4:] or 6)) or "none"
        digits = _DIGITS.fullmatch(format_spec)
        if digits is not None:
            return rounded(value, int(digits[1]))
        plain = _PLAIN.get(format_spec)
        return plain(value) if plain is not None else str(format(value, format_spec))

    def get_value(self, key: int | str, args: Any, kwargs: Mapping[str, Any]) -> Any:
        """Return a value by name; the empty name inside a specification is a placeholder."""
        return kwargs[key] if isinstance(key, str) and key else _PLACE


def _placed(value: Any, format_spec: str | None) -> str:
    """Return a value inside its own specification."""
    if format_spec:
        return _FORMATTER.format_field(value, format_spec)
    text = "; ".join(map(str, value)) if isinstance(value, list | tuple) else value
    return printable(text, _LONGEST)


def _word(word: bytes | str | None) -> str:
    return "the end of the file" if word is None else quoted(word)


def _bare(word: bytes) -> str:
    return printable(word.decode("utf-8", "replace"), 40)


def _name(name: str) -> str:
    return printable(_NO_TEXT.sub("\ufffd", name[: _LONGEST_NAME + 1]), _LONGEST_NAME)


def _axes(shape: Sequence[int | str | None]) -> str:
    if not shape:
        return "a single"
    # Files may declare 32 axes of any size.
    return printable(" x ".join("any" if axis is None else str(axis) for axis in shape), 80)


def _alternatives(values: Sequence[object]) -> str:
    return one_of([printable(value) for value in values])


_PLAIN: dict[str, Callable[[Any], str]] = {
    "quoted": _word,
    "word": _bare,
    "text": printable,
    "name": _name,
    "axes": _axes,
    "all": lambda names: ", ".join(map(printable, names)) or "none",
    "or": _alternatives,
    "bytes": file_size,
}
_FORMATTER = _Formatter()
