"""Values by name from a JSON text or an archive, with error locations."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Phrase
from viewer.errors import FormatError
from viewer.formats._archive.values import describe
from viewer.formats._source import Source
from viewer.formats._text.json_places import (
    constant_place,
    nesting_place,
    repeated_key,
    value_place,
)
from viewer.formats._text.numbers import LARGEST
from viewer.phrases import printable
from viewer.rig.arrays import Deferred, Floats

__all__ = ["NamedValues", "described", "parse_json"]

_DEEPEST = 500  # nesting level that is reported for a text nested too deeply for Python
_MOST_DIGITS = 18  # integers with more digits may not fit into 64 bits and are read as floats


@dataclass(frozen=True, slots=True, eq=False)
class NamedValues:
    """Named values of a file.

    Attributes
    ----------
    source : Source
        The file.
    values : mapping of str to object
        Numbers, strings, lists and dicts, or arrays.
    text : str or None
        The JSON text; None for archives, which have no lines.
    """

    source: Source
    values: Mapping[str, Any]
    text: str | None = None

    def offset(self, *path: str | int) -> int | None:
        """Return the offset of a value by the keys and indices that lead to it.

        If the value is missing, return the offset of the nearest container; None for archives.
        """
        if self.text is None:
            return None
        while (place := value_place(self.text, path)) is None:
            path = path[:-1]
        return _byte_offset(self.text, place)

    def fault(self, key: str, *path: str | int, **values: Any) -> FormatError:
        """Return an error with the file, and the line of a value if the file has lines."""
        return self.source.fault(key, self.offset(*path), **values)

    def warn(self, key: str, *path: str | int, **values: Any) -> None:
        """Add a warning with the file, and the line of a value if the file has lines."""
        self.source.warn(key, self.offset(*path), **values)

    def array(self, key: str, kinds: str, expected: Phrase) -> NDArray[Any]:
        """Return an array of the given kinds of values, stored as an array or as lists.

        Parameters
        ----------
        key : str
            Key of the value.
        kinds : str
            Numpy's letters of the kinds: ``"iuf"``, ``"bi"`` or ``"U"``.
        expected : Phrase
            Description of the expected value, for the message.

        Raises
        ------
        FormatError
            If a value is of a different kind; the error has the line of the first such value.
        """
        value = self.values.get(key)
        try:
            array = np.asarray(value)
        except ValueError:  # the lists are ragged, or nested more deeply than an array can be
            array = np.zeros(0, dtype=object)
        if array.dtype.kind in kinds or (array.size == 0 and array.dtype.kind == "f"):
            return array
        path, odd = _odd_value(value, kinds)
        found = Phrase("pose-ragged") if path is None else described(odd)
        raise self.fault(
            "F002.pose-array", key, *(path or ()), item=key, expected=expected, found=found
        )

    def numbers(self, key: str) -> Floats:
        """Return an array of finite numbers; see ``array``."""
        array = self.array(key, "iuf", Phrase("pose-numbers")).astype(np.float64)
        wrong = np.argwhere(~(np.abs(array) <= LARGEST))
        if len(wrong):
            place = wrong[0].tolist()
            found = float(array[tuple(place)])
            raise self.fault("F003.pose-number", key, *place, item=key, found=found)
        return array


def parse_json(source: Source) -> NamedValues:
    """Return the object in a JSON file.

    Raises
    ------
    FormatError
        If the JSON is invalid or contains NaN, an infinity or a repeated key; the error has the
        line.
    """
    text = source.data.decode("utf-8", "surrogateescape")
    odd: set[str] = set()  # Python accepts these words, but JSON does not

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        values = dict(pairs)
        odd.update(["a key twice"] if len(values) != len(pairs) else ())
        return values

    try:
        values = json.loads(
            text, object_pairs_hook=unique, parse_int=_whole, parse_constant=odd.add
        )
    except json.JSONDecodeError as problem:
        place = _byte_offset(text, problem.pos)
        raise source.fault("F002.json", place, reason=printable(problem.msg, 100)) from None
    except RecursionError:
        place = _byte_offset(text, nesting_place(text, _DEEPEST))
        raise source.fault("F002.json-nesting", place) from None
    if odd:
        raise _odd_json(source, text)
    named = NamedValues(source, values if isinstance(values, dict) else {}, text)
    if not isinstance(values, dict):
        is_word = values is None or isinstance(values, bool)
        found = Phrase("pose-word", word=json.dumps(values)) if is_word else describe(values)
        raise named.fault("F002.pose-object", found=found)
    return named


def _whole(digits: str) -> int | float:
    # Python refuses to convert very long integers. Converted to infinite floats, they are reported
    # with a line.
    return int(digits) if len(digits) <= _MOST_DIGITS else float(digits)


def _odd_json(source: Source, text: str) -> FormatError:
    """Return the error about NaN, an infinity, or a repeated key."""
    constant, repeated = constant_place(text), repeated_key(text)
    if constant is not None:
        return source.fault(
            "F002.json-constant", _byte_offset(text, constant[1]), found=constant[0]
        )
    assert repeated is not None  # a repeated key is the only remaining reason
    found = printable(repeated[0], 40)
    return source.fault("F002.json-twice", _byte_offset(text, repeated[1]), found=found)


def _byte_offset(text: str, place: int) -> int:
    return len(text[:place].encode("utf-8", "surrogateescape"))


def _odd_value(value: Any, kinds: str) -> tuple[tuple[int, ...] | None, Any]:
    """Return the indices of the first value of a different kind in nested lists, and the value.

    The indices are None if there is no such value, which means that the lists are ragged.
    """
    if not isinstance(value, list | tuple):
        return (), value
    waiting: list[tuple[tuple[int, ...], Any]] = [((), value)]
    while waiting:
        path, one = waiting.pop()
        if isinstance(one, list | tuple):
            waiting += [((*path, index), part) for index, part in reversed([*enumerate(one)])]
        elif not _is_of(one, kinds):
            return path, one
    return None, value


def _is_of(one: Any, kinds: str) -> bool:
    """Return whether a single value is of one of the kinds, given by numpy's letters."""
    if kinds == "U":
        return isinstance(one, str)
    if kinds == "bi":
        return isinstance(one, int)
    return isinstance(one, int | float) and not isinstance(one, bool)


def described(value: Any) -> Phrase:
    """Return a description of a value for messages: an array by its shape and type."""
    is_array = isinstance(value, np.ndarray)
    return describe(Deferred(value.shape, value.dtype, lambda: value) if is_array else value)
