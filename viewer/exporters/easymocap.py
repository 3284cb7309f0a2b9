"""Exporter for EasyMocap folders: motions of SMPL-family bodies.

::

    out/smpl/000000.json    [{"id", "Rh" [[3]], "Th" [[3]], "poses" [[3 J]], "shapes" [[S]],
                              "expression" [[E]]}, …]

``Rh`` and ``Th`` rotate and translate the body about the model's origin, so the first three
``poses`` are 0. A person absent from a frame has no record in its file.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import tempfile
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, note
from viewer.diagnostics.record import note_output
from viewer.errors import OutputError, RigError
from viewer.exporters._exporter import Selection
from viewer.exporters._family import (
    FamilyFrames,
    check_unit,
    family_frames,
    member_of_figure,
    padded,
    read_frames,
    up_axis,
)
from viewer.exporters._gaps import kept_gaps, kept_note
from viewer.exporters._left_out import rate_note
from viewer.exporters._losses.motion_errors import frames_losses, resampling_losses
from viewer.exporters._options import ExportOptions
from viewer.formats._text.number_text import fixed_texts
from viewer.interrupts import hold
from viewer.media.unfinished import new_prefix
from viewer.phrases import Remedy, Shown, counted, printable
from viewer.progress import report
from viewer.rigs.arrays import Floats
from viewer.rigs.bodies.smpl_family import Member
from viewer.rigs.captures.person import person_label
from viewer.rigs.figure import Figure
from viewer.rigs.motion.body_motion import BodyMotion
from viewer.rigs.motion.evaluation import frames_between
from viewer.rigs.motion.sampled_animation import SampledAnimation
from viewer.rigs.motion.timing import Timing

_FOLDER = "smpl"
_FRAME = re.compile(r"[0-9]+\.json")
_BLOCK = 256  # number of frames formatted together
_DIGITS = 7  # decimals, as in EasyMocap's newer writer
_SHAPES = 10  # minimum number of coefficients, as in EasyMocap's layers


def export(selection: Selection, path: Path, options: ExportOptions) -> list[Diagnostic]:
    """Write people into one folder, with frames numbered as in the animations."""
    ups = sorted({part.up for part in selection.parts})
    if len(ups) > 1:
        raise RigError(f"expected one up axis for all people, found {' and '.join(ups)}")
    animations = [part.animation for part in selection.parts]
    persons = [
        index if actor.person is None else actor.person
        for index, actor in enumerate(selection.actors)
    ]
    check_unit(options, "EasyMocap")
    _check(animations, persons)
    people: list[_Person] = []
    notes: list[Diagnostic] = []
    for taken, person in zip(animations, persons, strict=True):
        frames, filling = kept_gaps(taken.frames, options.gaps, taken.first_frame)
        animation = replace(taken, frames=frames)
        member = member_of_figure(animation.figure, "an EasyMocap folder", ("pelvis", "wrist"))
        body, losses = family_frames(animation, frames, member, options)
        people.append(_Person(taken, animation, _Records(person, body), _ReadRecords(member)))
        if body.gender != "neutral":
            losses.append(
                note(
                    "X003.gender: EasyMocap cannot store the gender: open the folder {remedy}",
                    gender=body.gender,
                    remedy=Remedy(f"after the {body.gender} model", f"with --gender {body.gender}"),
                )
            )
        own = [*losses, *filling, *kept_note(frames.present, taken.first_frame)]
        notes += own if len(animations) == 1 else [_of_person(person, each) for each in own]
    first = min(animation.first_frame for animation in animations)
    stop = max(animation.first_frame + animation.frames.n_frames for animation in animations)
    with _new_folder(path) as folder:
        for frame in range(first, stop):
            report(frame - first, stop - first, "frames", f"writing {path.name}")
            rows = [person.text(frame) for person in people if person.is_there(frame)]
            text = "[\n" + ",\n".join(rows) + "\n]\n"
            (folder / f"{frame:06}.json").write_text(text, encoding="ascii", newline="\n")
        # Within the block: parts of the figure may be read now, and the file may be damaged.
        errors = [line for person in people for line in person.losses(path / _FOLDER, options)]
    return [
        note(
            "X001.easymocap: {n} of {people}, {up} up; EasyMocap does not store the frame rate of "
            "{rate:g} fps",
            path / _FOLDER,
            n=counted(stop - first, "frame"),
            people=Shown(
                "1 person" if len(animations) == 1 else f"{len(animations)} people", len(animations)
            ),
            up=up_axis(options),
            rate=animations[0].frame_rate,
        ),
        *errors,
        *notes,
    ]


def require(figure: Figure) -> None:
    """Raise RigError for a figure without the joints of an SMPL-family body."""
    member_of_figure(figure, "an EasyMocap folder", ("pelvis", "wrist"))


def _of_person(person: int, remark: Diagnostic) -> Diagnostic:
    sentence = f"{remark.code}.of-person: {{person}}: {{remark}}"
    return note(sentence, person=person_label(person), remark=remark)


@dataclass(frozen=True, slots=True, eq=False)
class _Person:
    """One written person: original animation, animation without gaps, records, data read back."""

    original: SampledAnimation
    animation: SampledAnimation
    records: _Records
    again: _ReadRecords

    def is_there(self, frame: int) -> bool:
        """Return whether a frame has a record of the person."""
        row, present = frame - self.animation.first_frame, self.animation.frames.present
        return 0 <= row < len(present) and bool(present[row])

    def text(self, frame: int) -> str:
        """Return the record of a frame, and store it for reading back."""
        text = self.records.text(frame - self.animation.first_frame)
        self.again.add(text)
        return text

    def losses(self, path: Path, options: ExportOptions) -> list[Diagnostic]:
        """Return notes with the largest errors, if there are any."""
        place = np.maximum(np.cumsum(self.animation.frames.present) - 1, 0)
        found = read_frames(self.again.motion(self.animation.frame_rate), self.original, options)
        how = options.skinning
        lines = frames_losses(path, self.original, frames_between(found, place), how)
        return lines + resampling_losses(path, self.original, how) + rate_note(self.original)


def _check(animations: Sequence[SampledAnimation], persons: Sequence[int]) -> None:
    if len(set(persons)) < len(animations):
        raise RigError(
            f"expected a number for each of {len(animations)} people, found {list(persons)}"
        )
    rates = {animation.frame_rate for animation in animations}
    if max(rates) - min(rates) > 1e-6 * max(rates):
        listed = ", ".join(f"{rate:g}" for rate in sorted(rates))
        raise RigError(f"expected one frame rate for all people, found {listed}")
    for animation in animations:
        if animation.first_frame < 0:
            raise RigError(
                f"{animation.name}: expected frame numbers from 0, found {animation.first_frame}"
            )


class _Records:
    """The records of one person, formatted frame by frame."""

    def __init__(self, person: int, body: FamilyFrames) -> None:
        count = len(body.vectors)
        poses = body.vectors.reshape(count, -1).copy()
        poses[:, :3] = 0.0
        self.head = f'    {{\n        "id": {max(person, -1)}'  # -1 for all untracked people
        self.parts: list[tuple[str, Floats]] = [
            ("Rh", body.vectors[:, 0]),
            ("Th", body.about_origin()),
            ("poses", poses),
            ("shapes", _every_frame(body.shape, count)),
        ]
        if body.has_expression:
            self.parts.append(("expression", _every_frame(body.expression, count)))

        self._first, self._texts = 0, list[list[str]]()

    def text(self, frame: int) -> str:
        """Return one record as JSON."""
        if not self._first <= frame < self._first + _BLOCK or not self._texts:
            self._first = frame - frame % _BLOCK
            block = slice(self._first, self._first + _BLOCK)
            self._texts = [
                b"".join(fixed_texts(rows[block], _DIGITS, b", ")).decode("ascii").splitlines()
                for _, rows in self.parts
            ]
        lines = [self.head]
        for (key, _), texts in zip(self.parts, self._texts, strict=True):
            row = texts[frame - self._first]
            lines.append(f'        "{key}": [\n          [{row}]\n        ]')
        return ",\n".join(lines) + "\n    }"


class _ReadRecords:
    """The records of one person, parsed from the written text; ``member``: the body model."""

    def __init__(self, member: Member) -> None:
        self._member = member
        self._rows: list[dict[str, array[float]]] = []

    def motion(self, rate: float) -> BodyMotion:
        """Return the motion of all added frames."""
        rotation = self._array("poses").reshape(len(self._rows), -1, 3)
        rotation[:, 0] = self._array("Rh")
        has_expression = "expression" in self._rows[0]
        return BodyMotion(
            "again",
            Timing(rate, np.arange(len(self._rows), dtype=np.int32)),
            self._member.names,
            rotation,
            self._array("Th"),
            about_origin=True,
            shape=self._array("shapes"),
            expression=self._array("expression") if has_expression else None,
        )

    def add(self, text: str) -> None:
        """Add the record of the next frame."""
        # Arrays take a quarter of the memory of lists.
        record = json.loads(text)
        record.pop("id", None)
        self._rows.append({key: array("d", row) for key, (row,) in record.items()})

    def _array(self, key: str) -> Floats:
        return np.array([record[key] for record in self._rows], dtype=np.float64)


def _every_frame(rows: Floats, count: int) -> Floats:
    """Return coefficients (F, S) or (1, S) for each of ``count`` frames."""
    found = padded(rows, _SHAPES)
    return np.repeat(found, count // len(found), axis=0)


@contextlib.contextmanager
def _new_folder(path: Path) -> Iterator[Path]:
    """Yield a temporary folder next to ``path/smpl``, and move it there if the block succeeds."""
    hold()  # signals must not leave the temporary folder behind
    target = path / _FOLDER
    made = None
    try:
        is_new = not path.exists()
        _refuse_others(path, target)
        path.mkdir(parents=True, exist_ok=True)
        made = Path(tempfile.mkdtemp(dir=path, prefix=new_prefix(path, _FOLDER)))
        fresh, old = made / "new", made / "old"
        fresh.mkdir()
        yield fresh
        if target.exists():
            target.replace(old)
        try:
            fresh.replace(target)
        except OSError:
            if old.exists():
                old.replace(target)
            raise
        note_output(target, instead_of=fresh)
    except BaseException as problem:  # also Ctrl-C: no partial output may be left behind
        if made is not None:
            shutil.rmtree(made, ignore_errors=True)
            if is_new:
                with contextlib.suppress(OSError):
                    path.rmdir()
        if isinstance(problem, OSError):
            raise OutputError.at(path, problem) from None
        raise
    shutil.rmtree(made, ignore_errors=True)


def _refuse_others(path: Path, target: Path) -> None:
    """Raise OutputError for a folder that contains anything other than numbered frames."""
    if path.exists() and not path.is_dir():
        raise OutputError(f"{printable(path, 300)}: expected a folder, found a file")
    if not target.exists():
        return
    with os.scandir(target) as entries:
        other = next((entry.name for entry in entries if not _FRAME.fullmatch(entry.name)), None)
    if other is not None:
        raise OutputError(
            f"{printable(target, 300)}: contains files other than frames ({printable(other, 60)}) "
            "and is not replaced"
        )
