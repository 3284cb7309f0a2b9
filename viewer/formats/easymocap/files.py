"""Frame files of an EasyMocap recording: their common timeline, people, and errors in them."""

from __future__ import annotations

import json
import os
import re
from array import array
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import field
from pathlib import Path
from typing import Any

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase
from viewer.errors import FormatError, reason_of
from viewer.formats._archive.values import describe
from viewer.formats._published_models import refuse_models
from viewer.formats._source import InvalidValueError, Source, too_large, unreadable
from viewer.formats._text.json_places import (
    Keys,
    decoded,
    line_at,
    nearest_place,
    unique,
)
from viewer.formats._text.numbers import LARGEST
from viewer.formats._translation_limit import FARTHEST, within_text
from viewer.media.file_names import folder_name
from viewer.phrases import counted, listed, printable

_BODIES = ("smpl_full", "smplfull", "smpl")
"""Folders of body parameters, the most complete first."""
POINTS = "keypoints3d"
"""Folder of keypoints."""
_SUFFIX = ".json"

# Maximum number of frames of a timeline: this many for every file, plus a constant.
_MOST_HOLES = 10
_FEW = 1000
_NUMBERED = re.compile(r"(.*?)([0-9]+)(\D*)")


@dataclass(slots=True)
class FrameFolder:
    """The frame files of one folder."""

    path: Path
    """The folder."""
    has_bodies: bool = True
    has_points: bool = True
    """Data to read from its files."""
    names: dict[int, str] = field(default_factory=dict)
    """File names by frame, counted from the first frame of the recording."""


@dataclass(slots=True)
class FrameFiles:
    """All frame files of a recording."""

    name: str
    """The recording's name: not that of the folder ``smpl``, which is always the same."""
    max_size: int
    """Larger files, in bytes, are refused."""
    folders: list[FrameFolder]
    """Folders, which are read in this order for each frame."""
    frames: list[int] = field(default_factory=list)
    """Frames with a file, ascending."""
    n_frames: int = 0
    first_frame: int = 0
    """Length of the timeline, and the file number of its first frame."""


def find_frames(source: Source) -> FrameFiles:
    """Find the frame files of an EasyMocap output folder, one of its subfolders, or a file."""
    if not source.is_folder:
        folder = FrameFolder(source.path.parent)
        return _on_timeline(source, [folder], [[source.path.name]])
    names, inside = _look(source, source.path)
    folders = _folders(source, names, inside)
    found = []
    for folder in folders:
        names, inside = _look(source, folder.path)
        if not names and inside:
            names = _first_camera(source, folder, inside)
        found.append(names)
    if not any(found):
        refuse_models(source)
        raise source.fault(
            "F002.capture-frames: expected frame files (smpl_full, smplfull, smpl, "
            "keypoints3d: 000000.json …), found none"
        )
    first = ((folder.path, names[0]) for folder, names in zip(folders, found, strict=True) if names)
    source.also_read += [(path / name).parent for path, name in first]
    return _on_timeline(source, folders, found)


def _look(source: Source, folder: Path) -> tuple[list[str], list[str]]:
    """Return the names of a folder's frame files and of its subfolders, sorted."""
    files, folders, others = [], [], []
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                is_frame = entry.name.lower().endswith(_SUFFIX) and entry.name[0] != "."
                if is_frame and entry.is_file():
                    files.append(entry.name)
                elif entry.is_dir():
                    folders.append(entry.name)
                elif is_frame:
                    others.append(entry.name)
    except OSError as problem:
        name, reason = printable(folder.name, 100), reason_of(problem)
        raise source.fault(
            "F001.capture-folder: {item}: cannot be read: {reason}", item=name, reason=reason
        ) from None
    if others:
        source.warn("F007.capture-no-files: ignored (not files): {names}", names=listed(others))
    return sorted(files), sorted(folders)


def _folders(source: Source, names: list[str], inside: list[str]) -> list[FrameFolder]:
    """Return the folders with frames: known subfolders, or the folder that was opened."""
    bodies = [name for name in _BODIES if name in inside]
    points = [POINTS] if POINTS in inside else []
    if not bodies and not points:
        return [FrameFolder(source.path)]
    if len(bodies) > 1:
        source.warn(
            "F007.capture-beside: read {name}/, ignored {others}/ in the same folder",
            name=bodies[0],
            others=" and ".join(bodies[1:]),
        )
    if names:
        source.warn(
            "F007.capture-files: ignored files next to the frame folders: {names}",
            names=listed(names),
        )
    both = bool(bodies and points)
    return [
        FrameFolder(source.path / name, name != POINTS or not both, name == POINTS or not both)
        for name in (*bodies[:1], *points)
    ]


def _first_camera(source: Source, folder: FrameFolder, inside: list[str]) -> list[str]:
    """Descend into the first subfolder with frames: each view may have its own subfolder."""
    holding = [(name, files) for name in inside if (files := _look(source, folder.path / name)[0])]
    if not holding:
        return []
    first, files = holding[0]
    if len(holding) > 1:
        others = [name for name, _ in holding[1:]]
        source.warn(
            "F007.capture-camera: read {folder}/{name}, ignored other cameras: {others}",
            folder=folder.path.name,
            name=first,
            others=listed(others),
        )
    folder.path = folder.path / first
    return files


def _on_timeline(source: Source, folders: list[FrameFolder], found: list[list[str]]) -> FrameFiles:
    """Assign a frame to every file: by number, with gaps, if possible; otherwise consecutively."""
    name = folder_name(source.path) if source.is_folder else source.path.stem
    files = FrameFiles(name, source.max_size, folders)
    place: dict[str, int] = {}
    numbered = [_numbered(names) for names in found]
    if all(numbers or not names for numbers, names in zip(numbered, found, strict=True)):
        numbers = {name: number for part in numbered for name, number in part.items()}
        foreign = [name for names in found for name in names if name not in numbers]
        if foreign:
            source.warn(
                "F007.capture-foreign: ignored files that are not named like the frames: {names}",
                names=listed(list(dict.fromkeys(foreign))),
            )
        found = [[name for name in names if name in numbers] for names in found]
        order = sorted(set(numbers.values()))
        first, last = order[0], order[-1]
        if last - first < _MOST_HOLES * len(order) + _FEW:
            place = {name: number - first for name, number in numbers.items()}
            files.first_frame = first
        else:
            source.warn(
                "F007.capture-numbers: {n} numbered from {first} to {last}: treated as consecutive",
                n=counted(len(order), "frame"),
                first=first,
                last=last,
            )
            rank = {number: index for index, number in enumerate(order)}
            place = {name: rank[number] for name, number in numbers.items()}
    else:
        names = sorted({name for names in found for name in names}, key=_stem)
        place = {name: index for index, name in enumerate(names)}
    for folder, names in zip(folders, found, strict=True):
        _put(source, folder, ((place[name], name) for name in names))
    files.frames = sorted(set(place.values()))
    files.n_frames = files.frames[-1] + 1
    return files


def _stem(name: str) -> str:
    return name[: -len(_SUFFIX)]


def _numbered(names: list[str]) -> dict[str, int]:
    """Return the numbers in the names of most files, which differ by them only; none if few do.

    >>> _numbered(["f01.json", "f02.json", "notes_2024.json"])
    {'f01.json': 1, 'f02.json': 2}
    """
    parts = {name: match for name in names if (match := _NUMBERED.fullmatch(_stem(name)))}
    counts = Counter((match[1], match[3]) for match in parts.values())
    if not counts:
        return {}
    usual = ("", "") if ("", "") in counts else counts.most_common(1)[0][0]
    if 2 * counts[usual] < len(names):
        return {}
    return {name: int(match[2]) for name, match in parts.items() if (match[1], match[3]) == usual}


def _put(source: Source, folder: FrameFolder, frames: Iterable[tuple[int, str]]) -> None:
    doubled = []
    for frame, name in frames:
        if folder.names.setdefault(frame, name) != name:
            doubled.append(name)
    if doubled:
        source.warn(
            "C005.capture-twice: omitted frames that occur in more than one file: {names}",
            names=listed(doubled),
        )


Record = dict[str, Any]
"""A person in a frame file, as the file has it; the values are checked when they are taken."""
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


def load_people(path: str, max_size: int) -> list[Record]:
    """Return the people in a frame file, unchecked; NaN and infinities are accepted."""
    text = _text(path, max_size)

    def fault(key: str, place: int | None, **values: object) -> FormatError:
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


def _fault(key: str, path: str, line: int | None, **values: object) -> FormatError:
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
        raise unreadable(Path(path), reason_of(problem)) from None
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
            raise too_large(Path(path), size, max_size)
        data = os.read(handle, size + 1)
        while 0 < len(data) < size and (more := os.read(handle, size - len(data) + 1)):
            data += more
        return data
    finally:
        os.close(handle)


def person_of(record: object, place: int) -> int | str:
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


def row_of(record: Record, key: str) -> list[object]:
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


def take_row(record: Record, key: str, count: int, put: Callable[[list[float]], None]) -> None:
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


def _odd_one(values: list[object]) -> object:
    odd = (value for value in values if not isinstance(value, int | float))
    return next(odd, max((value for value in values if isinstance(value, int)), key=abs, default=0))
