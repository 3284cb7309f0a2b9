"""Exporter of EasyMocap folders: motions of bodies of the SMPL family.

::

    out/smpl/000000.json    [{"id", "Rh" [[3]], "Th" [[3]], "poses" [[3 J]], "shapes" [[S]],
                              "expression" [[E]]}, …]

``Rh`` and ``Th`` place the body about the model's origin, so the first three ``poses`` are 0. A
person absent from a frame is absent from its file.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from viewer.errors import OutputError, RigError
from viewer.export._family_frames import (
    FamilyFrames,
    check_unit,
    family_frames,
    member_of_figure,
    up_axis,
)
from viewer.export._family_reading import Records, read_frames
from viewer.export._gaps import gaps_text, kept_gaps
from viewer.export._losses.between import resampling_losses
from viewer.export._losses.lines import frames_losses
from viewer.export._options import MotionOptions
from viewer.interrupts import hold, poll
from viewer.phrases import printable
from viewer.rig.arrays import Floats
from viewer.rig.captures.person import person_label
from viewer.rig.motion.evaluation import frames_between
from viewer.rig.motion.sampled_animation import SampledAnimation

__all__ = ["export_animation", "export_animations"]

_FOLDER = "smpl"
_FRAME = re.compile(r"[0-9]+\.json")
_DIGITS = 7  # as EasyMocap's newer writer has them
_SHAPES = 10  # of which EasyMocap's layers take that many


def export_animation(animation: SampledAnimation, path: Path, options: MotionOptions) -> list[str]:
    """Write one person, called 0; see ``export_animations``."""
    return export_animations([animation], path, options)


def export_animations(
    animations: Sequence[SampledAnimation],
    path: Path,
    options: MotionOptions,
    persons: Sequence[int] | None = None,
) -> list[str]:
    """Write several people into one folder, seven decimals.

    Frames are numbered as the animations number them. Frames without anybody hold an empty list.

    Parameters
    ----------
    animations : sequence of SampledAnimation
        At least one, of bodies of the SMPL family, all at one frame rate.
    path : Path
        The folder; ``smpl`` in it is replaced if it holds nothing but numbered frames.
    options : MotionOptions
        Up axis (that of the scene if empty), and gaps: they stay gaps unless it is asked to hold
        or to interpolate.
    persons : sequence of int, optional
        What each is called; 0, 1, 2 … if omitted, below 0 for people without a track.

    Returns
    -------
    list of str
        What was written, then what the format cannot hold.

    Raises
    ------
    RigError
        If a figure has other joints or an unknown unit, another unit than metres is asked for,
        frame rates differ, two people have one number, or no frame is present.
    OutputError
        If the folder cannot be written, or holds something else.
    """
    persons = range(len(animations)) if persons is None else persons
    check_unit(options, "EasyMocap")
    _check(animations, persons)
    people, notes = [], []
    for taken, person in zip(animations, persons, strict=True):
        frames, filling = kept_gaps(taken.frames, options.gaps, taken.first_frame)
        animation = replace(taken, frames=frames)
        member = member_of_figure(animation.figure, "an EasyMocap folder", ("pelvis", "wrist"))
        body, losses = family_frames(animation, frames, member, options)
        people.append(_Person(taken, animation, _Records(person, body), Records(member)))
        who = f"{person_label(person)}: " if len(animations) > 1 else ""
        notes += [f"{who}{loss}" for loss in losses]
        if filling:
            notes.append(f"{who}{filling}")
        if not animation.frames.present.all():
            missing = gaps_text(animation.frames.present, animation.first_frame)
            notes.append(f"{who}{missing} missing, as in the motion")
    first = min(animation.first_frame for animation in animations)
    stop = max(animation.first_frame + animation.frames.n_frames for animation in animations)
    with _new_folder(path) as folder:
        for frame in range(first, stop):
            poll()
            rows = [person.text(frame) for person in people if person.is_there(frame)]
            text = "[\n" + ",\n".join(rows) + "\n]\n"
            (folder / f"{frame:06}.json").write_text(text, encoding="ascii", newline="\n")
    who = "1 person" if len(animations) == 1 else f"{len(animations)} people"
    count = "1 frame" if stop - first == 1 else f"{stop - first} frames"
    return [
        f"{printable(path / _FOLDER, 300)}: {count} of {who}, {up_axis(options)} up; "
        f"EasyMocap keeps no frame rate: it is {animations[0].frame_rate:g} per second",
        *(line for person in people for line in person.losses(path / _FOLDER, options)),
        *notes,
    ]


@dataclass(frozen=True, slots=True, eq=False)
class _Person:
    """Somebody who is written: the motion, with its gaps closed as asked, as text, as text says."""

    meant: SampledAnimation
    animation: SampledAnimation
    records: _Records
    again: Records

    def is_there(self, frame: int) -> bool:
        """Return whether a frame has a record of the person."""
        row, present = frame - self.animation.first_frame, self.animation.frames.present
        return 0 <= row < len(present) and bool(present[row])

    def text(self, frame: int) -> str:
        """Return the record of a frame, and keep what it says."""
        text = self.records.text(frame - self.animation.first_frame)
        self.again.add(text)
        return text

    def losses(self, path: Path, options: MotionOptions) -> list[str]:
        """Return a line with the largest differences, or none."""
        place = np.maximum(np.cumsum(self.animation.frames.present) - 1, 0)
        found = read_frames(self.again.motion(self.animation.frame_rate), self.meant, options)
        how = options.skinning
        lines = frames_losses(path, self.meant, frames_between(found, place), how)
        return lines + resampling_losses(path, self.meant, how)


def _check(animations: Sequence[SampledAnimation], persons: Sequence[int]) -> None:
    if not animations:
        raise RigError("expected somebody to write, found nobody")
    if len(set(persons)) < len(animations) or len(persons) != len(animations):
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
                f"{animation.name}: expected frames from 0 on, found {animation.first_frame}"
            )
        if not animation.frames.present.any():
            raise RigError(f"{animation.name}: every frame is missing, there is nothing to write")


class _Records:
    """The records of one person, made into text frame by frame."""

    def __init__(self, person: int, body: FamilyFrames) -> None:
        count = len(body.vectors)
        poses = body.vectors.reshape(count, -1).copy()
        poses[:, :3] = 0.0
        self.head = f'    {{\n        "id": {max(person, -1)}'  # all who have no track are -1
        self.parts: list[tuple[str, Floats]] = [
            ("Rh", body.vectors[:, 0]),
            ("Th", body.about_origin()),
            ("poses", poses),
            ("shapes", _used(body.shape, count)),
        ]
        if body.has_expression:
            self.parts.append(("expression", _used(body.expression, count)))

    def text(self, frame: int) -> str:
        """Return one record as JSON."""
        lines = [self.head]
        for key, rows in self.parts:
            # Adding 0 makes -0.0000000 a plain 0.
            numbers = np.round(rows[frame], _DIGITS) + 0.0
            row = ", ".join([f"{number:.{_DIGITS}f}" for number in numbers.tolist()])
            lines.append(f'        "{key}": [\n          [{row}]\n        ]')
        return ",\n".join(lines) + "\n    }"


def _used(rows: Floats, count: int) -> Floats:
    """Return coefficients for every frame: ten, or all up to the last one that is not 0."""
    used = np.flatnonzero(rows.any(axis=0))
    width = max(_SHAPES, int(used[-1]) + 1 if len(used) else 0)
    padded = np.zeros((count, width))
    padded[:, : rows.shape[1]] = rows[:, :width]
    return padded


@contextlib.contextmanager
def _new_folder(path: Path) -> Iterator[Path]:
    """Give a folder to fill beside ``path/smpl``, and put it there when the block succeeds."""
    hold()  # also for the folder that is filled, which must not stay behind
    target = path / _FOLDER
    made = None
    try:
        is_new = not path.exists()
        _refuse_others(path, target)
        path.mkdir(parents=True, exist_ok=True)
        made = Path(tempfile.mkdtemp(dir=path, prefix=f".{_FOLDER}."))
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
    except BaseException as problem:  # also Ctrl-C: nothing half written may stay behind
        if made is not None:
            shutil.rmtree(made, ignore_errors=True)
            if is_new:
                with contextlib.suppress(OSError):
                    path.rmdir()
        if isinstance(problem, OSError):
            reason = problem.strerror or problem
            raise OutputError(f"{printable(path, 300)}: {reason}") from None
        raise
    shutil.rmtree(made, ignore_errors=True)


def _refuse_others(path: Path, target: Path) -> None:
    """Refuse to replace a folder that holds anything but numbered frames."""
    if path.exists() and not path.is_dir():
        raise OutputError(f"{printable(path, 300)}: expected a folder, found a file")
    if not target.exists():
        return
    with os.scandir(target) as entries:
        other = next((entry.name for entry in entries if not _FRAME.fullmatch(entry.name)), None)
    if other is not None:
        raise OutputError(
            f"{printable(target, 300)}: holds other files than frames ({printable(other, 60)}), "
            "and is not replaced"
        )
