"""Reader of EasyMocap's output: a folder of JSON files, one per frame, with numbered people.

::

    out/smpl/000000.json          body parameters; smpl_full/ or smplfull/ take precedence
    out/keypoints3d/000000.json   3D keypoints of the same frames
    out/smpl/01/000000.json       fits of single views: the first view is read
    intri.yml, extri.yml          cameras, in that folder or one of the two above it
    images/01/000000.jpg          camera images, in one of the same folders

    frame    [person, …]  or  {"annots": [person, …], …}
    person   {"id": 0, "Rh": [[3]], "Th": [[3]], "poses": [[P]], "shapes": [[10]],
              "expression": [[10]], "handl": [[n]], "handr": [[n]],
              "keypoints3d": [[x, y, z, c], …], "handl3d", "handr3d", "face3d"}

File names that differ only in a number have the frame numbers, with gaps; files named otherwise are
ignored. Names without numbers are sorted. An ``id`` may be a number, also as text, or a name.
Bodies are V = R(Rh) X(poses, shapes) + Th, rotated about the model's origin. The files have no
frame rate.
"""

from __future__ import annotations

import os
from array import array
from collections.abc import Iterator
from dataclasses import field
from itertools import chain, count
from pathlib import Path
from typing import Any

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase, note, wording
from viewer.errors import FormatError
from viewer.formats._archive.values import describe
from viewer.formats._source import Source, remark_on
from viewer.formats._text.numbers import LARGEST
from viewer.formats.easymocap.bodies import (
    COEFFICIENTS,
    BodyLayout,
    BodyRows,
    RowFault,
    Rows,
    body_layout,
    usual_widths,
    with_coefficients,
)
from viewer.formats.easymocap.cameras import find_cameras, find_images
from viewer.formats.easymocap.files import (
    FrameFiles,
    FrameFolder,
    Record,
    RecordError,
    find_frames,
    has_numbers,
    load_people,
    person_of,
    record_line,
)
from viewer.phrases import counted, listed, one_of, optional, printable
from viewer.progress import report
from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.captures.capture import Capture, CapturePart
from viewer.rigs.captures.keypoint_layouts import TITLES, joined_layout, keypoint_layout
from viewer.rigs.captures.person import is_tracked, person_label
from viewer.rigs.captures.points import PointClip, PointLayout
from viewer.rigs.geometry.vectors import StatedUp
from viewer.rigs.motion.body_motion import BodyMotion

_LEVELS = 3  # number of folders that may contain the cameras, from the folder of the frames upwards


@dataclass(frozen=True, slots=True)
class Options:
    """Settings that are not in the files."""

    frame_rate: float = 30.0
    """Frames per second."""
    flat_hands: bool | None = None
    """Whether hand components exclude the mean hand; if None, they do for SMPL-X and MANO, but not
    for SMPL+H."""
    up: StatedUp = ""
    """"y", "z", "-y" or "-z": up axis of the world; empty to estimate it from the people."""
    legacy_expression: bool = False
    """Whether expressions are the last of the shape coefficients, as in the legacy code."""
    layout: str = ""
    """Layout among those with the same number of keypoints: ``"h36m"``, ``"panoptic"``."""
    images: Path | None = None
    """Folder of the cameras' image folders; ``images`` next to the recording if None."""


def read(source: Source, options: Options | None = None) -> Capture:
    """Open a recording, of which only the first people have been read."""
    options = options or Options()
    files = find_frames(source)
    looking = _Reading(files, options)
    if not any(part.bodies or part.points for part in looking.parts()):
        raise _refusal(source, len(files.frames), looking.first_fault)
    folder = files.folders[0].path.absolute()
    parents = [folder, *folder.parents][:_LEVELS]
    views, notes = find_cameras(parents, source.max_size)
    frames = range(files.first_frame, files.first_frame + files.n_frames)
    found = find_images(parents, views, options.frame_rate, frames, options.images)
    if found is not None:
        views = tuple(found.sized(view) for view in views)
    return Capture(
        files.name,
        files.n_frames,
        files.first_frame,
        lambda: _Reading(files, options).parts(),
        options.up,
        views,
        looking.body_layout.model if looking.body_layout else "",
        tuple(notes),
        found,
    )


def _refusal(source: Source, count: int, fault: Diagnostic | None) -> FormatError:
    if fault is None:
        return source.fault(
            "F002.capture-people: expected people, found none in {n}", n=counted(count, "frame")
        )
    if not source.is_folder:
        return FormatError(fault)
    return source.fault(
        "F002.capture-people-fault: expected people, found none in {n}; first error: {problem}",
        n=counted(count, "frame"),
        problem=fault,
    )


# Sequential reader of frame files, in growing parts, with gaps for invalid frames.
#
# ``keypoints3d`` of a record has rows of x, y, z and confidence, or of x, y, z with full
# confidence; hands and face may have separate keys. A confidence of 0 means "not detected".

# Numbers of frames of the first parts; all later parts have the last size.
_SIZES = (64, 256, 1024, 4096)
_MOST_WARNINGS = 20  # maximum number of reported records
_POINTS = "keypoints3d"
_BESIDE = ("handl3d", "handr3d", "face3d")
_MOST_POINTS = 1 << 16  # maximum number of keypoints of one person
_FOUR, _THREE = {4}, {3}  # widths of the rows of a record
_Parts = tuple[tuple[str, int], ...]


@dataclass(slots=True)
class _Part:
    """People of some consecutive frames."""

    bodies: dict[int, BodyRows] = field(default_factory=dict)
    points: dict[int, _PointRows] = field(default_factory=dict)


@dataclass(slots=True, eq=False)
class _Reading:
    """A single pass over the files, with its state and warnings."""

    files: FrameFiles
    """Files to read."""
    options: Options
    """Settings that are not in the files."""
    body_layout: BodyLayout | None = None
    point_layout: tuple[PointLayout, _Parts] | None = None
    """Layout of the first usual record; other records must agree, but may have fewer coefficients,
    or be the first with coefficients."""
    first_fault: Diagnostic | None = None
    """First error."""
    _numbers: set[int] = field(default_factory=set)
    _names: dict[str, int] = field(default_factory=dict)
    _prefixes: list[str] = field(default_factory=list)
    _n_faults: int = 0
    _known: dict[int, dict[str, Floats]] = field(default_factory=dict)
    _awaited: tuple[str, ...] = ()
    _usual: dict[str, int] = field(default_factory=dict)
    _has_seen: dict[int, bool] = field(default_factory=dict)
    _found: list[Diagnostic] = field(default_factory=list)
    _said: set[tuple[object, ...]] = field(default_factory=set)

    def parts(self) -> Iterator[CapturePart]:
        """Yield the frames up to the first with a person, then parts of growing size."""
        frames, n_frames = self.files.frames, self.files.n_frames
        self._prefixes = [f"{folder.path}{os.sep}" for folder in self.files.folders]
        self._usual = usual_widths(self.files)
        sizes = iter(_SIZES)
        part, size, n_read = _Part(), 0, 0
        for frame, stop in zip(frames, [*frames[1:], n_frames], strict=True):
            self._read_frame(frame, part)
            n_read += 1
            report(stop, n_frames, "frames")
            is_enough = n_read == size if size else bool(part.bodies or part.points)
            if is_enough or stop == n_frames:
                yield self._finished(part, stop)
                part, n_read, size = _Part(), 0, next(sizes, _SIZES[-1])

    def _read_frame(self, frame: int, part: _Part) -> None:
        for folder, prefix in zip(self.files.folders, self._prefixes, strict=True):
            name = folder.names.get(frame)
            if name is None:
                continue
            path = prefix + name
            try:
                people = load_people(path, self.files.max_size)
            except FormatError as problem:
                self._fault(problem.diagnostic)
                continue
            seen: set[int] = set()
            for place, record in enumerate(people):
                try:
                    person = self._number_of(person_of(record, place))
                except RecordError as problem:
                    self._fault_of(path, place, problem, problem.key)
                    continue
                if person < 0:  # the identity is unknown: the number is unique only in the frame
                    person = min(seen) - 1 if -1 in seen else -1
                    self.note(wording.RECORD_UNTRACKED, path)
                if person in seen:
                    self._fault(
                        Diagnostic(
                            "F002.record-twice: {item} occurs twice: the first one is used",
                            Path(path),
                            self._line(path, place, ""),
                            values={"item": f"person {person}"},
                        )
                    )
                    continue
                if record.get("id") is None or "personID" in record:
                    self._note_ids(path, record)
                seen.add(person)
                self._take_person(person, record, folder, frame, (path, place), part)

    def _note_ids(self, path: str, record: Record) -> None:
        """Add a note on the identity that is used if a record has none, or two different ones."""
        first, second = record.get("id"), record.get("personID")
        if first is None and second is None:
            self.note("F007.record-no-id: people without an id are numbered in list order", path)
        elif None not in (first, second) and str(first) != str(second):
            self.note("F007.record-ids: id and personID of people differ: id is used", path)

    def _number_of(self, person: int | str) -> int:
        """Return the number of a person; those with names get unused numbers."""
        if isinstance(person, int):
            if person in self._names.values():
                raise RecordError(
                    "id",
                    "expected a name as in earlier records, found {found}",
                    found=person,
                )
            self._numbers.add(person)
            return person
        if person not in self._names:
            used = {*self._numbers, *self._names.values()}
            self._names[person] = next(number for number in count() if number not in used)
        return self._names[person]

    def _take_person(
        self,
        person: int,
        record: Record,
        folder: FrameFolder,
        frame: int,
        origin: tuple[str, int],
        part: _Part,
    ) -> None:
        path, place = origin
        has_body = folder.has_bodies and "poses" in record
        has_points = folder.has_points and _POINTS in record
        try:
            if has_points:
                points = part.points.get(person)
                if points is None:
                    layout, parts = self.point_layout or _point_layout(record, self.options.layout)
                    points = _PointRows(layout=layout, parts=parts)
                points.add(record, frame, path, place)
                if self.point_layout is None:
                    points.check_any()
                    self.point_layout = points.layout, points.parts
                part.points[person] = points
            if has_body:
                of_body = self._layout_of(record, path)
                rows = part.bodies.get(person)
                if rows is None:
                    known = self._known.setdefault(person, {}) if is_tracked(person) else None
                    rows = BodyRows(layout=of_body, known=known)
                elif rows.layout is not of_body:
                    rows.widen(of_body)
                rows.add(record, frame, path, place)
                part.bodies[person] = rows
                if "vertices" in record:
                    self.note(
                        "F007.record-vertices: vertices are ignored: they are not needed", path
                    )
            elif not has_points:
                raise RecordError("", _lacks(record, folder))
        except RecordError as problem:
            self._fault_of(path, place, problem, person_label(person), problem.key)
        if has_body and _POINTS in record and not has_points:
            self.note(
                "F007.record-points: keypoints3d in this record and in the folder keypoints3d: "
                "those in the folder are used",
                path,
            )
        elif has_points and "poses" in record and not has_body:
            self.note(
                "F007.record-poses: poses in this record and in a separate folder: those in the "
                "folder are used",
                path,
            )

    def _layout_of(self, record: Record, path: str) -> BodyLayout:
        """Return the layout of all bodies, extended by the first record with coefficients."""
        layout = self.body_layout
        if layout is None:
            layout = body_layout(record, self._usual)
        elif first := [key for key in self._awaited if has_numbers(record, key)]:
            layout = with_coefficients(layout, record, self._usual)
            self.note(
                "F007.record-first: no earlier record has {keys}: 0 is used until a record does",
                path,
                keys=one_of(tuple(first)),
            )
        else:
            return layout
        self.body_layout, keys = layout, [key for key, _ in layout.widths]
        self._awaited = tuple(key for key in COEFFICIENTS if key not in keys)
        return layout

    def _finished(self, part: _Part, stop: int) -> CapturePart:
        """Return the collected rows as motions on the timeline of the whole recording."""
        options, files = self.options, self.files
        bodies: dict[int, BodyMotion] = {}
        points: dict[int, tuple[PointLayout, PointClip]] = {}
        where = (files.n_frames, options.frame_rate, files.first_frame)
        for person, rows in part.bodies.items():
            values, keep, faults = rows.values()
            self._faults(person, rows, faults)
            for message, path, key in rows.remarks:
                self.note(message, path, item=key)
            if keep.any():
                bodies[person] = rows.motion(
                    files.name,
                    values,
                    rows.timing(*where, keep),
                    options.flat_hands,
                    options.legacy_expression,
                    options.up,
                )
        for person, seen in part.points.items():
            places, faults = seen.points()
            self._faults(person, seen, faults)
            is_seen = bool(places[..., 3].any())
            self._has_seen[person] = self._has_seen.get(person, False) or is_seen
            clip = PointClip(files.name, seen.timing(*where), places)
            points[person] = seen.layout, clip
        if stop == files.n_frames:
            self._found += self._final_messages()
        found, self._found = self._found, []
        return CapturePart(stop, bodies, points, tuple(found))

    def _final_messages(self) -> list[Diagnostic]:
        """Return the messages that require the whole recording."""
        found: list[Diagnostic] = []
        unseen = [person for person, has_seen in self._has_seen.items() if not has_seen]
        values: dict[str, object] = {"name": self.files.name}
        if unseen:
            people = [*map(person_label, unseen)]
            found.append(
                note(
                    "F007.record-unseen: {name}: no keypoint of {people} is ever visible: every "
                    "confidence is 0",
                    **values,
                    people=listed(people),
                )
            )
        if self._names:
            names = [f"{number}: {printable(name, 40)}" for name, number in self._names.items()]
            found.append(note(wording.PERSON_NAMES, names=listed(names)))
        more = self._n_faults - _MOST_WARNINGS
        if more > 0:
            found.append(
                note(
                    "F007.records: {name}: {n} in frame files",
                    **values,
                    n=counted(more, "more error"),
                )
            )
        return found

    def _faults(self, person: int, rows: Rows, faults: list[RowFault]) -> None:
        for row, name, problem in faults:
            label = person_label(person)
            self._fault_of(rows.paths[row], rows.places[row], problem, label, name)

    def _fault_of(self, path: str, place: int, problem: RecordError, *names: str) -> None:
        """Record an error in a person's record, or in one of its keys."""
        line = self._line(path, place, problem.key)
        item = optional("{}: ", ": ".join(filter(None, names)))
        values = {"item": item, "problem": problem.problem}
        message = f"{problem.code}.record: {{item}}{{problem}}"
        self._fault(Diagnostic(message, Path(path), line, values=values))

    def _line(self, path: str, place: int, key: str) -> int | None:
        # Finding the line reads the file again, which is skipped for errors that are not shown.
        if self._n_faults >= _MOST_WARNINGS:
            return None
        return record_line(path, self.files.max_size, place, key)

    def _fault(self, fault: Diagnostic) -> None:
        self.first_fault = self.first_fault or fault
        self._n_faults += 1
        if self._n_faults <= _MOST_WARNINGS:
            self._found.append(remark_on("F007.record: {problem}", fault))

    def note(self, key: str, path: str, **values: object) -> None:
        """Record a note about the files, without repeating it."""
        mark = key, *values.values()
        if mark not in self._said:
            self._said.add(mark)
            self._found.append(Diagnostic(key, Path(path), values=values))


def _lacks(record: Record, folder: FrameFolder) -> Phrase:
    wanted = ("poses",) * folder.has_bodies + (_POINTS,) * folder.has_points
    if not record:
        return Phrase("expected {expected}, found no keys", expected=one_of(wanted))
    return Phrase(
        "expected {expected}, found keys {keys}",
        expected=one_of(wanted),
        keys=listed(list(record), 8),
    )


@dataclass(slots=True, kw_only=True)
class _PointRows(Rows):
    """Keypoints of one person."""

    layout: PointLayout
    """Layout of all records."""
    parts: _Parts
    """Keys of a record, with their number of points."""
    buffer: array[float] = field(default_factory=lambda: array("d"))
    """x, y, z, confidence of all points, record after record."""

    def add(self, record: Record, frame: int, path: str, place: int) -> None:
        """Add one record."""
        before = len(self.buffer)
        try:
            for key, count in self.parts:
                self._take(record.get(key), key, count)
        except RecordError:
            del self.buffer[before:]
            raise
        self.keep_origin(frame, path, place)

    def check_any(self) -> None:
        """Refuse rows without a valid keypoint, which must not determine the layout of others."""
        if _is_odd(self._rows()).all():
            raise RecordError(_POINTS, "expected rows of 3 or 4 finite numbers, found none")

    def _take(self, rows: Any, key: str, count: int) -> None:
        try:
            if len(rows) == count:
                widths = set(map(len, rows))
                if widths == _FOUR:
                    self.buffer.fromlist(list(chain.from_iterable(rows)))
                    return
                if widths == _THREE:
                    certain = [[*row, 1.0] for row in rows]
                    self.buffer.fromlist(list(chain.from_iterable(certain)))
                    return
        except (TypeError, ValueError, OverflowError):
            pass  # the error is reported below
        if not isinstance(rows, list):
            raise RecordError(
                key,
                "expected {expected}, found {found}",
                expected=counted(count, "keypoint"),
                found=describe(rows),
            )
        if len(rows) != count:
            raise RecordError(
                key,
                "expected {expected}, found {found}",
                expected=counted(count, "keypoint"),
                found=len(rows),
            )
        raise RecordError(key, "expected rows of 3 or 4 numbers, found rows of different lengths")

    def points(self) -> tuple[Floats, list[RowFault]]:
        """Return the points (N, K, 4), and the errors in invalid rows."""
        points = self._rows().copy()
        is_odd, is_unseen = _is_odd(points), points[..., 3] == 0.0
        points[is_odd | is_unseen] = 0.0
        faults = [
            (
                int(row),
                "",
                RecordError(
                    _POINTS,
                    "{n} with non-finite numbers or negative confidence, treated as not visible",
                    n=counted(int(is_odd[row].sum()), "keypoint"),
                ),
            )
            for row in np.flatnonzero(is_odd.any(axis=1))
        ]
        points.flags.writeable = False  # a read-only array is not copied again
        return points, faults

    def _rows(self) -> Floats:
        count = sum(size for _, size in self.parts)
        return np.frombuffer(self.buffer, dtype=np.float64).reshape(-1, count, 4)


def _is_odd(points: Floats) -> Bools:
    """Return a mask of the invalid points, (N, K, 4), whose confidence is not 0."""
    confidence = points[..., 3]
    is_good = (np.abs(points) <= LARGEST).all(axis=-1) & (confidence >= 0.0)
    return ~is_good & (confidence != 0.0)


def _point_layout(record: Record, title: str = "") -> tuple[PointLayout, _Parts]:
    """Return the layout of a record's keypoints, and its keys with their numbers of points."""
    parts = [(key, _count(record, key)) for key in (_POINTS, *_BESIDE) if key in record]
    counts = [count for _, count in parts]
    body = keypoint_layout(counts[0], title if title in TITLES.get(counts[0], ()) else "")
    if len(parts) == 1:
        return body, tuple(parts)
    beside = {key: keypoint_layout(count) for key, count in parts[1:]}
    for key, side in (("handl3d", 0), ("handr3d", 1)):
        if key in beside and len(beside[key].names) == 21:
            beside[key] = _one_hand(side)
    joined = joined_layout("", [body, *beside.values()])
    whole = keypoint_layout(len(joined.names))
    # Body, hands and face in the standard order form a layout with its own name.
    named = whole if whole.names == joined.names else None
    text = " + ".join([body.title, *beside])
    return named or PointLayout(text, joined.names, joined.limbs, joined.sides), tuple(parts)


def _one_hand(side: int) -> PointLayout:
    both = keypoint_layout(42)
    first, stop = 21 * side, 21 * side + 21
    inside = (both.limbs >= first).all(axis=1) & (both.limbs < stop).all(axis=1)
    limbs = both.limbs[inside] - first
    return PointLayout("hand", both.names[first:stop], limbs, both.sides[first:stop])


def _count(record: Record, key: str) -> int:
    rows = record[key]
    if not isinstance(rows, list) or not rows or not all(isinstance(row, list) for row in rows):
        raise RecordError(
            key, "expected rows of 3 or 4 numbers, found {found}", found=describe(rows)
        )
    if len(rows) > _MOST_POINTS:
        raise RecordError(
            key,
            "expected at most {most} keypoints, found {found}",
            most=_MOST_POINTS,
            found=len(rows),
        )
    return len(rows)
