"""JSON texts: decoding, and offsets of values, searched for only when an error needs one.

Python's parser is fast, but it does not record offsets. If there is an error, the text is scanned a
second time, token by token. By then, it is known to be valid JSON, except that it may be nested too
deeply or contain NaN and infinities.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from viewer.diagnostics import wording
from viewer.phrases import printable

MOST_DIGITS = 4300
"""Largest number of digits of an integer that Python converts."""

Keys = tuple[str | int, ...]
"""Keys and indices that lead from the outermost value to a nested value."""

_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|[\[\]{},:]|[^\s\[\]{},:"]+')
_LONG_NUMBER = re.compile(rf"[0-9]{{{MOST_DIGITS + 1}}}")


class _RepeatedKeyError(ValueError):
    """A key that occurs twice in an object."""


def unique(pairs: list[tuple[str, object]]) -> dict[str, object]:
    """Return an object of a text, as the hook of a decoder that refuses repeated keys."""
    values = dict(pairs)
    if len(values) != len(pairs):
        raise _RepeatedKeyError
    return values


def decoded(
    text: str, fault: Callable[..., Exception], decode: Callable[[str], Any] = json.loads
) -> Any:
    """Return the value of a text, or raise ``fault(key, offset, ...)``; offsets in characters."""
    try:
        return decode(text)
    except json.JSONDecodeError as problem:
        raise fault(wording.JSON, problem.pos, reason=printable(problem.msg, 100)) from None
    except RecursionError:
        raise fault(wording.JSON_NESTING, deepest_place(text)) from None
    except _RepeatedKeyError:
        key, offset = repeated_key(text) or ("", 0)
        raise fault(wording.JSON_TWICE, offset, found=printable(key, 40)) from None
    except ValueError:  # decoding can raise no other error
        raise fault(wording.CAPTURE_DIGITS, long_number_place(text), most=MOST_DIGITS) from None


def line_at(text: str, offset: int) -> int:
    """Return the line of an offset, counted from 1."""
    return 1 + text.count("\n", 0, offset)


def value_place(text: str, path: Sequence[str | int]) -> int | None:
    """Return a value's offset in characters, or None; the last of equal keys counts."""
    wanted = tuple(path)
    found = None
    for path, offset, is_key in _places(text):
        if not is_key and path == wanted:
            found = offset
    return found


def nearest_place(text: str, path: Sequence[str | int]) -> int | None:
    """Return the offset of a key or item, or of the container in which it is missing, or None."""
    wanted = tuple(path)
    deepest, found = 0, None
    for path, offset, _ in _places(text):
        # A key comes before its value, which has the same path.
        if len(path) > deepest and path == wanted[: len(path)]:
            deepest, found = len(path), offset
    return found


def repeated_key(text: str) -> tuple[str, int] | None:
    """Return the first repeated key of an object, and the offset of its second occurrence."""
    seen: set[Keys] = set()
    for path, offset, is_key in _places(text):
        if is_key and path in seen:
            return str(path[-1]), offset
        if is_key:
            seen.add(path)
    return None


def constant_place(text: str, constant: str) -> int | None:
    """Return the offset of the first NaN or infinity, which is written as this word."""
    tokens = (token for token in _TOKEN.finditer(text) if token.group() == constant)
    return next((token.start() for token in tokens), None)


def deepest_place(text: str) -> int:
    """Return the offset of the most deeply nested bracket; the text need not be valid JSON."""
    depth = deepest = place = 0
    for token in _TOKEN.finditer(text):
        depth += {"{": 1, "[": 1, "}": -1, "]": -1}.get(token.group(), 0)
        if depth > deepest:
            deepest, place = depth, token.start()
    return place


def long_number_place(text: str) -> int | None:
    """Return the offset of the first number with more digits than Python converts."""
    found = _LONG_NUMBER.search(text)
    return None if found is None else found.start()


def _places(text: str) -> Iterator[tuple[Keys, int, bool]]:
    """Yield the path and offset of every value and key, and whether it is a key."""
    path: list[str | int] = []
    objects: list[bool] = []  # whether each open bracket belongs to an object
    expects_key = False
    for token in _TOKEN.finditer(text):
        word = token.group()
        if word in ("}", "]"):
            objects.pop()
            path.pop()
            expects_key = False
        elif word == ",":
            expects_key = objects[-1]
            if not expects_key:
                path[-1] = int(path[-1]) + 1
        elif expects_key:
            path[-1] = json.loads(word)
            expects_key = False
            yield tuple(path), token.start(), True
        elif word != ":":
            yield tuple(path), token.start(), False
            if word in ("{", "["):
                expects_key = word == "{"
                objects.append(expects_key)
                path.append("" if expects_key else 0)
