"""Typed access to the objects of a glTF document, with JSON pointers for messages."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import Any, TypeVar

import numpy as np

from viewer.diagnostics import wording
from viewer.errors import FormatError
from viewer.formats._archive.values import describe
from viewer.formats._source import Source
from viewer.formats._text.numbers import LARGEST
from viewer.phrases import one_of, quoted
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.file_record import Json

_Choice = TypeVar("_Choice", int, str)
_ONE = {
    "accessors": "an accessor",
    "buffers": "a buffer",
    "bufferViews": "a buffer view",
    "samplers": "a sampler",
}
_BEYOND = 1 << 64  # whole numbers from this value on are invalid in any file


def _pointer_to(base: str, *keys: str | int) -> str:
    """Return a JSON pointer to a member (RFC 6901): ``/nodes/3/extensions/a~1b``."""
    for key in keys:
        if type(key) is str and ("/" in key or "~" in key):
            key = key.replace("~", "~0").replace("/", "~1")
        base = f"{base}/{key}"
    return base


class Element:
    """An object of the document; missing members have the default that the caller gives."""

    __slots__ = ("pointer", "source", "values")

    def __init__(self, source: Source, values: Json, pointer: str = "") -> None:
        self.source, self.values, self.pointer = source, values, pointer

    def at(self, *keys: str | int) -> str:
        """Return a JSON pointer to a member."""
        return _pointer_to(self.pointer, *keys)

    def has(self, name: str) -> bool:
        """Return whether the object has a member of this name."""
        return name in self.values

    def fault(self, key: str, name: str = "", **values: Any) -> FormatError:
        """Return the exception for an error in a member, or in the object as a whole."""
        return self.source.fault(key, self.at(name) if name else self.pointer or None, **values)

    def warn(self, key: str, name: str = "", **values: Any) -> None:
        """Record a warning about a member, or about the object as a whole."""
        self.source.warn(key, self.at(name) if name else self.pointer or None, **values)

    def wrong(self, name: str, wanted: str) -> FormatError:
        """Return the exception for a member of an unexpected type."""
        if name not in self.values:
            return self.fault(
                "F002.gltf-missing: expected {wanted} as {member}, found none",
                wanted=wanted,
                member=quoted(name),
            )
        return self.fault(wording.GLTF_TYPE, name, wanted=wanted, found=describe(self.values[name]))

    def whole(self, name: str, default: int | None = None) -> int:
        """Return a member that is a whole number of at least 0."""
        value = self.values.get(name)
        if value is None and default is not None and name not in self.values:
            return default
        if type(value) is float and value.is_integer():
            value = int(value)
        if type(value) is not int or not 0 <= value < _BEYOND:
            raise self.wrong(name, "a whole number of at least 0")
        return value

    def index(self, name: str, count: int, what: str) -> int:
        """Return a member that is an index into the list ``what``; -1 if it is missing."""
        if name not in self.values:
            return -1
        index = self.whole(name)
        if index >= count:
            raise self.fault(wording.GLTF_INDEX, name, what=what, count=count, found=index)
        return index

    def required_index(self, name: str, count: int, what: str) -> int:
        """Return a member that is an index; unlike ``index``, it must be there."""
        index = self.index(name, count, what)
        if index < 0:
            raise self.wrong(name, f"the index of {_ONE[what]}")
        return index

    def number(self, name: str, default: float | None = None) -> float:
        """Return a member that is a finite number."""
        if name not in self.values and default is not None:
            return default
        value: Any = self.values.get(name)
        if not _is_number(value):
            raise self.wrong(name, "a finite number")
        return float(value)

    def numbers(self, name: str, count: int | None = None) -> Floats | None:
        """Return a member that is a list of finite numbers (N,); None if it is missing."""
        if name not in self.values:
            return None
        items = self.values[name]
        wanted = "finite numbers" if count is None else f"{count} finite numbers"
        if type(items) is not list or (count is not None and len(items) != count):
            raise self.wrong(name, wanted)
        for place, item in enumerate(items):
            if not _is_number(item):
                pointer = self.at(name, place)
                found = describe(item)
                raise self.source.fault(
                    wording.GLTF_TYPE, pointer, wanted="a finite number", found=found
                )
        return np.array(items, dtype=np.float64)

    def choice(
        self, name: str, choices: Sequence[_Choice], default: _Choice | None = None
    ) -> _Choice:
        """Return a member that is one of several values."""
        if name not in self.values and default is not None:
            return default
        value: Any = self.values.get(name)
        if type(value) is not type(choices[0]) or value not in choices:
            raise self.wrong(name, one_of(choices))
        return value

    def text(self, name: str, default: str = "") -> str:
        """Return a member that is a string."""
        value = self.values.get(name, default)
        if type(value) is not str:
            raise self.wrong(name, "a string")
        return value

    def flag(self, name: str, default: bool = False) -> bool:
        """Return a member that is true or false."""
        value = self.values.get(name, default)
        if type(value) is not bool:
            raise self.wrong(name, "true or false")
        return value

    def part(self, name: str) -> Element | None:
        """Return a member that is an object; None if it is missing."""
        if name not in self.values:
            return None
        value = self.values[name]
        if type(value) is not dict:
            raise self.wrong(name, "an object")
        return Element(self.source, value, self.at(name))

    def table(self, name: str) -> Table:
        """Return a member that is a list, or an empty one; its items are checked when used."""
        items = self.values.get(name, [])
        if type(items) is not list:
            raise self.wrong(name, "a list")
        return Table(self.source, items, self.at(name))

    def indices(self, name: str, count: int, what: str) -> list[int]:
        """Return a member that is a list of indices below ``count``; empty if it is missing."""
        items = self.values.get(name, [])
        if type(items) is not list:
            raise self.wrong(name, "a list")
        for place, item in enumerate(items):
            if type(item) is not int or not 0 <= item < count:
                pointer = self.at(name, place)
                if type(item) is int and 0 <= item < _BEYOND:
                    raise self.source.fault(
                        wording.GLTF_INDEX, pointer, what=what, count=count, found=item
                    )
                wanted, found = "a whole number of at least 0", describe(item)
                raise self.source.fault(wording.GLTF_TYPE, pointer, wanted=wanted, found=found)
        return items

    def extension(self, name: str) -> Element | None:
        """Return an extension of this object; None if there is none."""
        extensions = self.part("extensions")
        return None if extensions is None else extensions.part(name)


class Table:
    """A list of objects, each of which is checked when it is used."""

    __slots__ = ("items", "pointer", "source")

    def __init__(self, source: Source, items: list[Any], pointer: str) -> None:
        self.source, self.items, self.pointer = source, items, pointer

    def __len__(self) -> int:
        return len(self.items)

    def __getitem__(self, index: int) -> Element:
        """Return an item; raise FormatError if it is not an object, IndexError past the end."""
        values = self.items[index]
        pointer = f"{self.pointer}/{index}"
        if type(values) is not dict:
            found = describe(values)
            raise self.source.fault(wording.GLTF_TYPE, pointer, wanted="an object", found=found)
        return Element(self.source, values, pointer)


def _is_number(value: Any) -> bool:
    return type(value) in (int, float) and -LARGEST <= value <= LARGEST


_NUMBERS = ({int}, {float}, {int, float})


def member_rows(table: Table, name: str, width: int) -> tuple[Ints, Floats]:
    """Return which objects have a member (N,), and its finite numbers (N, width)."""
    places = [place for place, values in enumerate(table.items) if name in values]
    items = [table.items[place][name] for place in places]
    rows = _array(items, width)
    if rows is None:
        # At least one member is invalid; reading them one by one finds it.
        for place in places:
            table[place].numbers(name, width)
    return np.array(places, dtype=np.int32), np.zeros((0, width)) if rows is None else rows


def _array(items: list[Any], width: int) -> Floats | None:
    """Return lists of numbers as an array; None if any item is not such a list."""
    if set(map(type, items)) - {list} or set(map(len, items)) - {width}:
        return None
    if items and set(map(type, chain.from_iterable(items))) not in _NUMBERS:
        return None
    try:
        rows = np.array(items, dtype=np.float64).reshape(-1, width)
    except OverflowError:  # a whole number beyond the range of double precision
        return None
    return rows if (np.abs(rows) <= LARGEST).all() else None


def member_indices(table: Table, name: str, count: int, what: str) -> Ints:
    """Return each object's index below ``count`` (N,), -1 where the member is missing."""
    result = np.full(len(table), -1, dtype=np.int32)
    for place, values in enumerate(table.items):
        if name in values:
            result[place] = table[place].index(name, count, what)
    return result
