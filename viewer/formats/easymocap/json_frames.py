"""Reader of one EasyMocap frame file: its list of people, and errors in it."""

from __future__ import annotations

import json
import os
import re
from array import array
from pathlib import Path
from typing import Any

from viewer.diagnostics import Diagnostic, Phrase, wording
from viewer.errors import FormatError
from viewer.formats._archive.values import describe
from viewer.formats._file_bytes import unreadable
from viewer.formats._source import InvalidValueError
from viewer.formats._text.json_places import (
    Keys,
    decoded,
    line_at,
    nearest_place,
    unique,
)
from viewer.formats._text.numbers import LARGEST
from viewer.formats._translation_limit import FARTHEST, within_text
from viewer.phrases import Remedy, counted

Record = dict[str, Any]
_TRANSLATION = "Th"
_WRAPPER = "annots"  # key of the people in files with more content
_OF_PERSON = {"poses", "keypoints3d"}
_WHOLE = re.compile(r"[+-]?[0-9]{1,20}")


class RecordError(InvalidValueError):
    """A person's record, or a part of it, that is invalid.

    ``key``: key of the invalid value; empty for the record itself. ``code``: a key of ``CODES``.
    """

    def __init__(
        self, key: str, problem: str | Phrase, *, code: str = "F002", **values: object
    ) -> None:
        self.key, self.code = key, code
        super().__init__(problem, **values)


# Created only once, because creating a decoder is slow.
_decode = json.JSONDecoder(object_pairs_hook=unique).decode


def load_people(path: str, max_size: int) -> list[Any]:
    """Return the people in a frame file, unchecked; NaN and infinities are accepted."""
    text = _text(path, max_size)

    def fault(key: str, place: int | None, **values: Any) -> FormatError:
        return _fault(key, path, _line(text, place), **values)

    content = decoded(text, fault, _decode)
    if isinstance(content, dict) and _WRAPPER in content:
        content = content[_WRAPPER]
    elif isinstance(content, dict) and not _OF_PERSON.isdisjoint(content):
        content = [content]  # a single person without a list
    if not isinstance(content, list):
        line = _line(text, nearest_place(text, (_WRAPPER,))) or 1
        raise _fault(
            "F002.capture-list: expected a list of people, found {found}",
            path,
            line,
            found=describe(content),
        )
    return content


def _fault(key: str, path: str, line: int | None, **values: Any) -> FormatError:
    return FormatError(Diagnostic(key, Path(path), line, values=values))


def record_line(path: str, max_size: int, place: int, key: str) -> int | None:
    """Return the line of a person's record, or of a key in it, in a frame file; for errors only."""
    try:
        text = _text(path, max_size)
    except FormatError:  # the file has changed since it was read
        return None
    where: Keys = (place, key) if key else (place,)
    if text.lstrip().startswith("{"):
        where = (_WRAPPER, *where) if f'"{_WRAPPER}"' in text else where[1:]
    return _line(text, nearest_place(text, where))


def _line(text: str, place: int | None) -> int | None:
    return None if place is None else line_at(text, place)


def _text(path: str, max_size: int) -> str:
    try:
        data = _read(path, max_size)
    except OSError as problem:
        raise unreadable(Path(path), problem.strerror or problem) from None
    try:
        return data.decode().removeprefix("\ufeff")
    except UnicodeDecodeError as problem:
        line = 1 + data.count(b"\n", 0, problem.start)
        raise _fault(
            "F002.capture-text: expected UTF-8 text, found invalid bytes", path, line
        ) from None


def _read(path: str, max_size: int) -> bytes:
    # For thousands of small files, creating stream objects would take as long as reading.
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0))
    try:
        size = os.fstat(handle).st_size
        if size > max_size:
            raise _fault(
                wording.TOO_LARGE,
                path,
                None,
                most=max_size,
                size=size,
                remedy=Remedy("", " (see --max-size)"),
            )
        data = os.read(handle, size + 1)
        while 0 < len(data) < size and (more := os.read(handle, size - len(data) + 1)):
            data += more
        return data
    finally:
        os.close(handle)


def person_of(record: Any, place: int) -> int | str:
    """Return a record's ``id`` or ``personID``, a name or a number, or its index in the list."""
    if type(record) is dict and type(person := record.get("id")) is int and -1 <= person < 1 << 31:
        return person
    if not isinstance(record, dict):
        raise RecordError(
            "", "expected a person with named values, found {found}", found=describe(record)
        )
    given = (value for key in ("id", "personID") if (value := record.get(key)) is not None)
    person = next(given, place)
    if isinstance(person, str):
        number = person.strip()
        if not _WHOLE.fullmatch(number):
            return person
        person = int(number)
    if isinstance(person, float) and person.is_integer():
        person = int(person)
    if isinstance(person, bool) or not isinstance(person, int):
        raise RecordError(
            "id", "expected an integer or a name, found {found}", found=describe(person)
        )
    if abs(person) >= 1 << 31:
        raise RecordError(
            "id",
            "expected an id below {limit}, found {found}",
            limit=1 << 31,
            found=describe(person),
        )
    return person


def has_numbers(record: Record, key: str) -> bool:
    """Return whether a record has a key whose value is not an empty list or matrix."""
    return key in record and record[key] not in ([], [[]])


def row_of(record: Record, key: str) -> list[Any]:
    """Return a key's numbers, which may be stored as a one-row matrix."""
    values = record.get(key)
    if isinstance(values, list) and len(values) == 1 and isinstance(values[0], list):
        values = values[0]
    if not isinstance(values, list):
        found = describe(record[key]) if key in record else Phrase("no value")
        raise RecordError(key, "expected numbers, found {found}", found=found)
    return values


def limit_of(key: str) -> float:
    """Return the largest allowed magnitude of a key's numbers."""
    return FARTHEST if key == _TRANSLATION else LARGEST


def width_of(record: Record, key: str, count: int | None = None) -> int:
    """Return the number of a key's finite values, which other records must have, too."""
    count = len(row_of(record, key)) if count is None else count
    numbers = array("d")
    take_row(record, key, count, numbers.fromlist)
    limit = limit_of(key)
    odd = [number for number in numbers if not abs(number) <= limit]
    if odd:
        raise RecordError(key, within_text(odd[0], limit), code="F003")
    return count


def take_row(record: Record, key: str, count: int, put: Any) -> None:
    """Pass a key's ``count`` numbers to ``put``, the ``fromlist`` of an ``array("d")``."""
    try:
        values = record[key]
        if len(values) == 1 and type(values[0]) is list:
            values = values[0]
        if len(values) == count:
            put(values)
            return
    except (KeyError, TypeError, ValueError, OverflowError):
        pass  # the error is reported below
    values = row_of(record, key)
    if len(values) != count:
        raise RecordError(
            key,
            "expected {expected}, found {found}",
            expected=counted(count, "number"),
            found=len(values),
        )
    found = describe(_odd_one(values))
    raise RecordError(
        key,
        "expected {expected}, found {found} among them",
        expected=counted(count, "number"),
        found=found,
    )


def _odd_one(values: list[Any]) -> Any:
    odd = (value for value in values if not isinstance(value, int | float))
    return next(odd, max((value for value in values if isinstance(value, int)), key=abs, default=0))
