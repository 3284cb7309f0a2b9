"""One pass over a recording's frame files, in growing parts; what is wrong becomes a gap."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from viewer.errors import FormatError, printable
from viewer.formats._easymocap.bodies import (
    BodyLayout,
    BodyRows,
    RowFault,
    Rows,
    body_layout,
    with_coefficients,
)
from viewer.formats._easymocap.files import FrameFiles, FrameFolder
from viewer.formats._easymocap.json_frames import (
    MisfitError,
    has_numbers,
    load_people,
    person_of,
    record_line,
)
from viewer.formats._easymocap.points import KEY, Parts, PointRows, point_layout
from viewer.formats._easymocap.shapes import COEFFICIENTS
from viewer.rig.arrays import Floats
from viewer.rig.captures.capture import CapturePart
from viewer.rig.captures.person import is_tracked, person_label
from viewer.rig.captures.points import PointClip, PointLayout
from viewer.rig.motion.body_motion import BodyMotion

__all__ = ["Options", "Reading"]

_SIZES = (64, 256, 1024, 4096)  # frames of a part; all further ones have the last number
_MOST_WARNINGS = 20
_LISTED = 6  # people in one line
_UNTRACKED = (
    'people without a track (id -1) are called "untracked" and numbered within each frame: '
    "nobody says who of them is who in the next"
)


@dataclass(frozen=True, slots=True)
class Options:
    """What the files leave open; see ``open_capture``."""

    name: str
    frame_rate: float
    flat_hands: bool | None
    up: str
    legacy_expression: bool
    layout: str
    max_size: int


@dataclass(slots=True)
class _Part:
    """People of some consecutive frames."""

    bodies: dict[int, BodyRows] = field(default_factory=dict)
    points: dict[int, PointRows] = field(default_factory=dict)


@dataclass(slots=True, eq=False)
class Reading:
    """One pass over the files, what it has learnt so far, and its warnings.

    Attributes
    ----------
    files : FrameFiles
        What is read.
    options : Options
        What the files leave open.
    body_layout, point_layout : layouts or None
        Of the first record that had one; all others must be alike, but may bring coefficients.
    first_fault : FormatError or None
        What was wrong first.
    """

    files: FrameFiles
    options: Options
    body_layout: BodyLayout | None = None
    point_layout: tuple[PointLayout, Parts] | None = None
    first_fault: FormatError | None = None
    _prefixes: list[str] = field(default_factory=list)
    _n_faults: int = 0
    _known: dict[int, dict[str, Floats]] = field(default_factory=dict)
    _awaited: tuple[str, ...] = ()
    _has_seen: dict[int, bool] = field(default_factory=dict)
    _texts: list[str] = field(default_factory=list)
    _said: set[str] = field(default_factory=set)

    def parts(self) -> Iterator[CapturePart]:
        """Yield the frames up to the first with somebody in it, then more and more at a time."""
        frames, n_frames = self.files.frames, self.files.n_frames
        self._prefixes = [f"{folder.path}{os.sep}" for folder in self.files.folders]
        sizes = iter(_SIZES)
        part, size, count = _Part(), 0, 0
        for frame, stop in zip(frames, [*frames[1:], n_frames], strict=True):
            self._read_frame(frame, part)
            count += 1
            is_enough = count == size if size else bool(part.bodies or part.points)
            if is_enough or stop == n_frames:
                yield self._finished(part, stop)
                part, count, size = _Part(), 0, next(sizes, _SIZES[-1])

    def _read_frame(self, frame: int, part: _Part) -> None:
        for folder, prefix in zip(self.files.folders, self._prefixes, strict=True):
            name = folder.names.get(frame)
            if name is None:
                continue
            path = prefix + name
            try:
                people = load_people(path, self.options.max_size)
            except FormatError as problem:
                self._fault(problem)
                continue
            self._take_people(people, folder, frame, path, part)

    def _take_people(
        self, people: list[Any], folder: FrameFolder, frame: int, path: str, part: _Part
    ) -> None:
        seen: set[int] = set()
        for place, record in enumerate(people):
            try:
                person = person_of(record, place)
            except MisfitError as problem:
                self._fault_of(path, place, problem.key, str(problem))
                continue
            if person < 0:  # nobody knows who: told apart within the frame
                person = min(seen) - 1 if -1 in seen else -1
                self._say_once(path, _UNTRACKED)
            if person in seen:
                twice = f"person {person} is there twice: the first counts"
                self._fault_of(path, place, "", twice)
                continue
            if "id" not in record or "personID" in record:
                self._say_of_ids(path, record)
            seen.add(person)
            self._take_person(person, record, folder, frame, (path, place), part)

    def _say_of_ids(self, path: str, record: dict[str, Any]) -> None:
        """Say whose number is used where there is none, or two that differ."""
        if "id" not in record and "personID" not in record:
            self._say_once(path, "people without id: numbered in the order of their lists")
        elif "id" in record and record["id"] != record["personID"]:
            self._say_once(path, "people whose id and personID differ: id counts everywhere")

    def _take_person(
        self,
        person: int,
        record: dict[str, Any],
        folder: FrameFolder,
        frame: int,
        origin: tuple[str, int],
        part: _Part,
    ) -> None:
        path, place = origin
        has_body = folder.has_bodies and "poses" in record
        has_points = folder.has_points and KEY in record
        try:
            if has_points:
                self._add_points(part, person, record, frame, origin)
            if has_body:
                self._add_body(part, person, record, frame, origin)
            elif not has_points:
                raise MisfitError("", _lacks(record, folder))
        except MisfitError as problem:
            text = f"{person_label(person)}: {problem}"
            self._fault_of(path, place, problem.key, text)
        if has_body and KEY in record and not has_points:
            self._say_once(path, f"{KEY} in it and beside it: those in the folder {KEY} count")
        elif has_points and "poses" in record and not has_body:
            self._say_once(path, "poses in it and beside it: those beside it count")

    def _add_body(
        self, part: _Part, person: int, record: dict[str, Any], frame: int, origin: tuple[str, int]
    ) -> None:
        path, place = origin
        layout = self._layout_of(record, path)
        rows = part.bodies.get(person)
        if rows is None:
            known = self._known.setdefault(person, {}) if is_tracked(person) else None
            rows = BodyRows(layout=layout, known=known)
        elif rows.layout is not layout:
            rows.widen(layout)
        rows.add(record, frame, path, place)
        part.bodies[person] = rows
        if "vertices" in record:
            self._say_once(path, "vertices are not needed, and left out everywhere")

    def _layout_of(self, record: dict[str, Any], path: str) -> BodyLayout:
        """Return the layout of all bodies, wider from the first record with coefficients on."""
        layout = self.body_layout
        if layout is None:
            layout = body_layout(record)
        elif first := [key for key in self._awaited if has_numbers(record, key)]:
            layout = with_coefficients(layout, record)
            self._say_once(path, f"no earlier record has {' or '.join(first)}: 0 is taken there")
        else:
            return layout
        self.body_layout, keys = layout, [key for key, _ in layout.widths]
        self._awaited = tuple(key for key in COEFFICIENTS if key not in keys)
        return layout

    def _add_points(
        self, part: _Part, person: int, record: dict[str, Any], frame: int, origin: tuple[str, int]
    ) -> None:
        rows = part.points.get(person)
        if rows is None:
            layout, parts = self.point_layout or point_layout(record, self.options.layout)
            rows = PointRows(layout=layout, parts=parts)
        rows.add(record, frame, *origin)
        if self.point_layout is None:
            rows.check_any()
            self.point_layout = rows.layout, rows.parts
        part.points[person] = rows

    def _finished(self, part: _Part, stop: int) -> CapturePart:
        """Return what was gathered, as motions on the whole recording's timeline."""
        options, files = self.options, self.files
        bodies: dict[int, BodyMotion] = {}
        points: dict[int, tuple[PointLayout, PointClip]] = {}
        where = (files.n_frames, options.frame_rate, files.first_frame)
        for person, rows in part.bodies.items():
            values, keep, faults = rows.values()
            self._faults(person, rows, faults)
            for path, text in rows.remarks:
                self._say_once(path, text)
            if keep.any():
                bodies[person] = rows.motion(
                    options.name,
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
            clip = PointClip(options.name, seen.timing(*where), places)
            points[person] = seen.layout, clip
        if stop == files.n_frames:
            self._texts += self._last_words()
        texts, self._texts = self._texts, []
        return CapturePart(stop, bodies, points, tuple(texts))

    def _last_words(self) -> list[str]:
        """Return what is only known when everything was read."""
        name, texts = printable(self.options.name), []
        unseen = [person for person, has_seen in self._has_seen.items() if not has_seen]
        if unseen:
            who = ", ".join(map(person_label, unseen[:_LISTED]))
            more = f" and {len(unseen) - _LISTED} more" * (len(unseen) > _LISTED)
            texts.append(f"{name}: no keypoint of {who}{more} is ever seen: every confidence is 0")
        if self._n_faults > _MOST_WARNINGS:
            more = f"{self._n_faults - _MOST_WARNINGS} more faults"
            texts.append(f"{name}: {more} in frame files")
        return texts

    def _faults(self, person: int, rows: Rows, faults: list[RowFault]) -> None:
        for row, key, text in faults:
            label = person_label(person)
            self._fault_of(rows.paths[row], rows.places[row], key, f"{label}: {text}")

    def _fault_of(self, path: str, place: int, key: str, text: str) -> None:
        """Note what is wrong with a person's record, or a key of it."""
        # Finding the line reads the file again, which is not done for faults that nobody sees.
        is_said = self._n_faults < _MOST_WARNINGS
        line = record_line(path, self.options.max_size, place, key) if is_said else None
        self._fault(FormatError(path, text, line))

    def _fault(self, fault: FormatError) -> None:
        self.first_fault = self.first_fault or fault
        self._n_faults += 1
        if self._n_faults <= _MOST_WARNINGS:
            self._texts.append(str(fault))

    def _say_once(self, path: str, text: str) -> None:
        if text not in self._said:
            self._said.add(text)
            self._texts.append(f"{printable(path, 300)}: {text}")


def _lacks(record: dict[str, Any], folder: FrameFolder) -> str:
    wanted = ("poses",) * folder.has_bodies + (KEY,) * folder.has_points
    keys = ", ".join(printable(key, 40) for key in list(record)[:8])
    found = f"the keys {keys}" if keys else "no keys"
    return f"expected {' or '.join(wanted)}, found {found}"
