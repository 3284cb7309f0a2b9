"""Lines of keys and values in a JSON text, looked for only where a message needs one.

Python's own decoder does not say where its values are. The text is walked by its words, without
recursion, once more; that it is JSON is not checked here.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

__all__ = [
    "MOST_DIGITS",
    "Place",
    "deepest_line",
    "long_number_line",
    "place_line",
    "repeated_line",
]

Place = tuple[int | str, ...]
"""Indices in lists and keys of objects, from the outside in."""

_WORD = re.compile(r'"(?:[^"\\]|\\.)*"|[{}\[\],]|[^\s{}\[\],:"]+', re.DOTALL)
MOST_DIGITS = 4300
"""Of a whole number that Python converts."""

_LONG_NUMBER = re.compile(rf"[0-9]{{{MOST_DIGITS + 1}}}")


def place_line(text: str, place: Place) -> int | None:
    r"""Return the line of a key, or of an item of a list; of what holds it if it is not there.

    >>> place_line('[\n{"id": 0,\n"poses": []}]', (0, "poses"))
    3
    """
    best: tuple[int, int] | None = None
    for found, offset, _ in _places(text):
        depth = len(found)
        if found == list(place[:depth]) and (best is None or depth > best[0]):
            best = depth, offset
            if depth == len(place):
                break
    return None if best is None else _line(text, best[1])


def repeated_line(text: str) -> int | None:
    r"""Return the line of the first key that its object had before, None if there is none.

    >>> repeated_line('{"a": 1,\n"b": {"a": 2},\n"a": 3}')
    3
    """
    seen: set[Place] = set()
    for found, offset, is_key in _places(text):
        if is_key and tuple(found) in seen:
            return _line(text, offset)
        if is_key:
            seen.add(tuple(found))
    return None


def deepest_line(text: str) -> int:
    """Return the line in which lists and objects are nested deepest."""
    depth = deepest = where = 0
    for word in _WORD.finditer(text):
        depth += {"{": 1, "[": 1, "}": -1, "]": -1}.get(word.group(), 0)
        if depth > deepest:
            deepest, where = depth, word.start()
    return _line(text, where)


def long_number_line(text: str) -> int | None:
    """Return the line of the first number with more digits than Python converts."""
    found = _LONG_NUMBER.search(text)
    return None if found is None else _line(text, found.start())


def _line(text: str, offset: int) -> int:
    return 1 + text.count("\n", 0, offset)


def _places(text: str) -> Iterator[tuple[list[int | str], int, bool]]:
    """Yield every key and item of a list: its place, its offset, and whether it is a key.

    The place is the same list each time; whoever keeps it must copy it.
    """
    place: list[int | str] = []
    is_object: list[bool] = []
    is_next = False  # whether a key or an item follows
    for word in _WORD.finditer(text):
        letters = word.group()
        if letters in ("}", "]"):
            if is_object:
                is_object.pop()
                place.pop()
            is_next = False
            continue
        if letters == ",":
            is_next = True
            continue
        if is_next and is_object and is_object[-1] and letters[0] == '"':
            place[-1] = letters[1:-1]
            yield place, word.start(), True
        elif is_next and is_object and not is_object[-1]:
            place[-1] = int(place[-1]) + 1
            yield place, word.start(), False
        is_next = letters in ("{", "[")
        if is_next:
            is_object.append(letters == "{")
            place.append("" if letters == "{" else -1)
