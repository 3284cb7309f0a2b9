"""One pass over a recording's frame files, in growing parts; what is wrong becomes a gap."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from viewer.errors import FormatError, printable
from viewer.formats._easymocap_bodies import BodyLayout, BodyRows, body_layout
from viewer.formats._easymocap_files import FrameFiles, FrameFolder
from viewer.formats._easymocap_json import MisfitError, load_people, person_of
from viewer.formats._easymocap_points import KEY, Parts, PointRows, point_layout
from viewer.rig.body_motion import BodyMotion
from viewer.rig.capture import CapturePart
from viewer.rig.points import PointClip, PointLayout

__all__ = ["Options", "Reading"]

_SIZES = (64, 256, 1024, 4096)  # frames of a part; all further ones have the last number
_MOST_WARNINGS = 20


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
        Of the first record that had one; all others must be alike.
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
                self._fault(FormatError(path, str(problem)))
                continue
            if person < 0:  # nobody knows who: told apart within the frame
                person = min(seen) - 1 if -1 in seen else -1
            if person in seen:
                self._fault(FormatError(path, f"person {person} is there twice: the first counts"))
                continue
            if "id" not in record and "personID" not in record:
                self._say_once(path, "people without id: numbered in the order of their lists")
            seen.add(person)
            has_body = folder.has_bodies and "poses" in record
            has_points = folder.has_points and KEY in record
            try:
                if has_points:
                    self._add_points(part, person, record, frame, path)
                if has_body:
                    self._add_body(part, person, record, frame, path)
                elif not has_points:
                    raise MisfitError(_lacks(record, folder))
            except MisfitError as problem:
                self._fault(FormatError(path, f"person {person}: {problem}"))

    def _add_body(
        self, part: _Part, person: int, record: dict[str, Any], frame: int, path: str
    ) -> None:
        rows = part.bodies.get(person)
        if rows is None:
            if self.body_layout is None:
                self.body_layout = body_layout(record)
            rows = BodyRows(layout=self.body_layout)
        rows.add(record, frame, path)
        part.bodies[person] = rows
        if "vertices" in record:
            self._say_once(path, "vertices are not needed, and left out everywhere")

    def _add_points(
        self, part: _Part, person: int, record: dict[str, Any], frame: int, path: str
    ) -> None:
        rows = part.points.get(person)
        if rows is None:
            if self.point_layout is None:
                self.point_layout = point_layout(record, self.options.layout)
            layout, parts = self.point_layout
            rows = PointRows(layout=layout, parts=parts)
        rows.add(record, frame, path)
        part.points[person] = rows

    def _finished(self, part: _Part, stop: int) -> CapturePart:
        """Return what was gathered, as motions on the whole recording's timeline."""
        options, files = self.options, self.files
        bodies: dict[int, BodyMotion] = {}
        points: dict[int, tuple[PointLayout, PointClip]] = {}
        where = (files.n_frames, options.frame_rate, files.first_frame)
        for person, rows in part.bodies.items():
            values, keep, faults = rows.values()
            self._faults(person, faults)
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
            self._faults(person, faults)
            clip = PointClip(options.name, seen.timing(*where), places)
            points[person] = seen.layout, clip
        if stop == files.n_frames and self._n_faults > _MOST_WARNINGS:
            more = self._n_faults - _MOST_WARNINGS
            self._texts.append(f"{printable(options.name)}: {more} more faults in frame files")
        texts, self._texts = self._texts, []
        return CapturePart(stop, bodies, points, tuple(texts))

    def _faults(self, person: int, faults: list[tuple[str, str]]) -> None:
        for path, text in faults:
            self._fault(FormatError(path, f"person {person}: {text}"))

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
    keys = ", ".join(printable(key, 40) for key in list(record)[:8]) or "none"
    return f"expected {' or '.join(wanted)}, found the keys {keys}"
