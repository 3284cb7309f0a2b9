"""Incremental construction of actors from a capture: part by part, person by person."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, note
from viewer.errors import RigError
from viewer.loading.body_driving import body_drive
from viewer.loading.scaling import scale_to_unit
from viewer.phrases import Remedy
from viewer.rigs.arrays import Floats
from viewer.rigs.bodies.smpl_family import ShapeSpace
from viewer.rigs.captures.cameras import CameraView
from viewer.rigs.captures.capture import Capture, CapturePart
from viewer.rigs.captures.person import is_tracked, person_label
from viewer.rigs.captures.points import PointClip, PointLayout
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.geometry.transform import rotation_transform
from viewer.rigs.geometry.vectors import Up
from viewer.rigs.motion.body_motion import BodyMotion, body_clip, parameter_clip
from viewer.rigs.motion.sampled_clip import SampledClip, joined, with_rate
from viewer.rigs.retargeting.drive import Drive
from viewer.rigs.retargeting.driven_clip import driven_clip
from viewer.rigs.retargeting.joint_map import JointMap
from viewer.rigs.scene import Actor, pose_actors
from viewer.rigs.springs.simulation import springs_for

_Clip = TypeVar("_Clip", bound=SampledClip | PointClip)
_COLORS = (
    (0.85, 0.42, 0.28),
    (0.24, 0.52, 0.80),
    (0.42, 0.66, 0.27),
    (0.74, 0.45, 0.78),
    (0.88, 0.69, 0.22),
    (0.30, 0.69, 0.66),
    (0.80, 0.36, 0.52),
    (0.52, 0.48, 0.40),
)
"""Colours of people, in the order of appearance; linear."""


@dataclass(slots=True, eq=False)
class Builder:
    """Converts the parts of one capture to actors whose clips grow."""

    capture: Capture
    """The capture to read."""
    model: Figure
    """The figure that shows its bodies."""
    called: str = ""
    """Base name of all people; the capture's name if empty."""
    model_of: Callable[[ShapeSpace], tuple[Figure, Sequence[Diagnostic]]] | None = None
    """Returns the model for bodies of a shape space and messages, if the model depends on it."""
    gender: str = ""
    """Gender of all people, as stated by the user; empty for that of the files."""
    keeps_shape: bool = True
    """Whether the capture's shape coefficients are valid for the model."""
    placement: Floats = field(default_factory=lambda: np.eye(4))
    """(4, 4): placement of every actor."""
    unit: str = ""
    """Unit of the scene, to which later people are scaled; empty if it is unknown."""
    views: tuple[CameraView, ...] = ()
    """Its cameras, in metres, before placement."""
    up: Up = "y"
    """The axis along which people stand before placement."""
    n_read: int = 0
    """Number of frames already added."""
    is_cut: bool = False
    """Whether reading was stopped before the end."""
    has_shape: bool = False
    has_expression: bool = False
    """Whether the files have nonzero shapes, and expressions."""
    path: Path | None = None
    """Its file or folder, for messages."""
    target: Figure | None = None
    """Figure with different joints that the bodies move instead of the model."""
    swings: bool = False
    """Whether the spring joints of later people are simulated."""
    joint_map: JointMap | None = None
    """Joints of the target and the joints of the model that drive them; None to match them by
    name."""
    plants_feet: bool = True
    """Whether the feet of the target still have to be planted."""
    keeps_hands: bool = True
    """Whether hands of the target stay at its body."""
    hangs: bool = False
    """Whether the axis along which people stand points down before placement."""
    defers: bool = False
    """Whether the caller computes the final motions and passes them to ``finish``."""
    _names_shapes: bool = False  # whether any person has shape coefficients, even if all are 0
    _has_parameters: bool = False
    _grows: bool = True  # whether the motions of driven figures are computed part by part
    _is_behind: bool = False  # whether such a motion lacks parts that have been read
    _parts: Iterator[CapturePart] | None = None
    _bodies: dict[int, Actor] = field(default_factory=dict)
    _points: dict[int, Actor] = field(default_factory=dict)
    _notes: set[str] = field(default_factory=set)

    @property
    def is_done(self) -> bool:
        """Whether all parts have been read."""
        return self.is_cut or self.n_read >= self.capture.n_frames

    def parts(self) -> Iterator[CapturePart]:
        """Return the iterator over the remaining parts; may be advanced in another thread."""
        if self._parts is None:
            self._parts = self.capture.parts()
        return self._parts

    def read_some(self) -> tuple[list[Actor], list[Diagnostic]]:
        """Read the next part; return new actors and messages."""
        # Captures that are read to the end before they are shown compute the motions of driven
        # figures once, at the end.
        part = next(self.parts(), None)
        if part is None:
            self.is_cut = True
            return [], self._fresh(self._finished())
        self._grows = False
        try:
            return self.add(part)
        finally:
            self._grows = True

    def add(self, part: CapturePart) -> tuple[list[Actor], list[Diagnostic]]:
        """Add one part; return people who are new, posed at the start, and new messages."""
        new: list[Actor] = []
        notes = [*part.warnings]
        for person, motion in sorted(part.bodies.items(), key=_order):
            notes += self._add_body(person, motion, new)
        self._has_parameters |= bool(part.parameters)
        shown = part.parameters if self.model.parameters is not None else {}
        for person, parameters in sorted(shown.items(), key=_order):
            posed = parameter_clip(parameters, self.model)
            notes += self._add_driven(person, self.model, posed, new)
        points = {person: both for person, both in part.points.items() if person not in shown}
        for person, (layout, clip) in sorted(points.items(), key=_order):
            notes += self._add_points(person, layout, clip, new)
        self.n_read = max(self.n_read, part.stop)
        notes += self._shape_notes()
        notes += self._finished()
        for actor in new:
            if self.swings:
                actor.springs = springs_for(actor, self.up)
            pose_actors([actor], 0.0)
        return new, self._fresh(notes)

    def _fresh(self, notes: Iterable[Diagnostic]) -> list[Diagnostic]:
        """Return the messages that were not reported before, each once."""
        fresh = {str(note): note for note in notes if str(note) not in self._notes}
        self._notes.update(fresh)
        return [*fresh.values()]

    def _shape_notes(self) -> list[Diagnostic]:
        """At the end, return messages about bodies without a shape, and a model without bodies."""
        if self.is_done and self.target is not None and not self._bodies:
            key = (
                "F007.model-of-parameters: --model has no effect: parameters of {member} can drive "
                "a figure only if {member} is in the model folder (viewer models)"
                if self._has_parameters
                else "F007.model-of-points: --model has no effect: the capture has only keypoints"
            )
            return [note(key, self.path, member=self.capture.model)]
        lacks = self._bodies and self.model.n_shapes and not self._names_shapes
        lacks = lacks and self.target is None and self.model.parameters is None
        if not (self.is_done and self.keeps_shape and lacks):
            return []
        return [
            Diagnostic(
                "F007.no-shapes: no shape coefficients in the files: the model's mean shape is "
                "used for all",
                self.path,
            )
        ]

    def _add_body(self, person: int, motion: BodyMotion, new: list[Actor]) -> list[Diagnostic]:
        self.has_shape |= motion.shape is not None and bool(motion.shape.any())
        self.has_expression |= motion.expression is not None
        self._names_shapes |= motion.shape is not None
        if not self.keeps_shape:
            motion = replace(motion, shape=None, expression=None)
        space = motion.shape_space
        space = replace(space, model=space.model or self.capture.model)
        motion = replace(motion, shape_space=space)
        model, said = (self.model, ()) if self.model_of is None else self.model_of(space)
        clip, notes = body_clip(motion, model)
        notes = [*said, *notes, *self._add_driven(person, model, clip, new)]
        self._bodies[person].shape_space = replace(space, gender=self.gender or space.gender)
        return [replace(note, path=self.path) for note in notes]

    def _add_driven(
        self, person: int, model: Figure, clip: SampledClip, new: list[Actor]
    ) -> list[Diagnostic]:
        """Append a clip of a model, or the motion of the target that it drives."""
        if self.target is None:
            self._add_clip(person, model, clip, new)
            return []
        drive = self._drive(model, clip)
        actor = self._bodies.get(person)
        if not self._grows and actor is not None and actor.drive is not None:
            actor.drive = _grown(actor.drive, drive)
            self._is_behind = True
            return []
        found, notes = driven_clip(drive, self.target)
        self._add_clip(person, self.target, found, new, drive)
        return [replace(note, path=self.path) for note in notes]

    def _drive(self, model: Figure, clip: SampledClip) -> Drive:
        # Feet are planted at the end, because contacts and the ground need the whole motion.
        up = f"-{self.up}" if self.hangs else self.up
        return body_drive(model, clip, up, self.joint_map, False, self.keeps_hands)

    def _finished(self) -> list[Diagnostic]:
        """At the end, compute the whole motions of driven figures and plant their feet, once."""
        return [] if self.defers else self.finish(self.final_motions())

    def final_motions(self) -> list[tuple[Actor, Drive, SampledClip, list[Diagnostic]]]:
        """Return the final motions of driven people once everything has been read."""
        # They can be computed in another thread while nothing else changes the builder.
        is_left = self.plants_feet or self._is_behind
        if not (self.is_done and is_left and self.target is not None):
            return []
        found = []
        for actor in self._bodies.values():
            if actor.drive is not None:
                drive = replace(actor.drive, plants_feet=self.plants_feet)
                found.append((actor, drive, *driven_clip(drive, self.target)))
        return found

    def finish(
        self, motions: Sequence[tuple[Actor, Drive, SampledClip, list[Diagnostic]]]
    ) -> list[Diagnostic]:
        """Give people their final motions; return messages about these."""
        notes: list[Diagnostic] = []
        for actor, drive, clip, said in motions:
            # The user may have changed the frame rate of a motion that is already shown.
            rate = (clip if actor.clip is None else actor.clip).frame_rate
            actor.drive = drive
            self._replace_clip(actor, with_rate(clip, rate))
            self.plants_feet = self._is_behind = False
            notes += [replace(note, path=self.path) for note in said]
        return notes

    def _add_clip(
        self,
        person: int,
        figure: Figure,
        clip: SampledClip,
        new: list[Actor],
        drive: Drive | None = None,
    ) -> None:
        """Append a clip to a person's clip, or add an actor; ``drive``: motion of its source."""
        actor = self._bodies.get(person)
        if actor is None:
            actor = self._actor(figure, clip, person)
            if self.target is None:
                actor.color = _COLORS[len(self._bodies) % len(_COLORS)]
            actor.drive = drive
            self._bodies[person] = actor
            new.append(actor)
        else:
            assert isinstance(actor.clip, SampledClip)  # set when the actor was created
            self._replace_clip(actor, _extended(actor.clip, clip))
            if drive is not None and actor.drive is not None:
                actor.drive = _grown(actor.drive, drive)

    def _add_points(
        self, person: int, layout: PointLayout, clip: PointClip, new: list[Actor]
    ) -> list[Diagnostic]:
        actor = self._points.get(person)
        if actor is None:
            figure = Figure(layout.title, points=layout, up=self.up)
            actor = self._actor(figure, clip, person)
            self._points[person] = actor
            new.append(actor)
            return []
        known = actor.figure.points
        # Set when the actor was created.
        assert isinstance(actor.clip, PointClip) and known is not None
        if len(known.names) != len(layout.names):
            return [
                note(
                    "C005.keypoint-count: {person} has {n} keypoints from frame {frame} onwards, "
                    "{known} before; those frames are omitted",
                    self.path,
                    person=person_label(person),
                    n=len(layout.names),
                    frame=self.n_read + self.capture.first_frame,
                    known=len(known.names),
                )
            ]
        self._replace_clip(actor, _extended(actor.clip, clip))
        return []

    def _actor(self, figure: Figure, clip: SampledClip | PointClip, person: int) -> Actor:
        actor = Actor(figure, clip=clip, placement=self.placement.copy(), person=person)
        actor.called = self.called or self.capture.name
        actor.clip_origin = None if self.path is None else (self.path, clip)
        scale_to_unit(actor, self.unit)
        return actor

    def _replace_clip(self, actor: Actor, clip: SampledClip | PointClip) -> None:
        """Give a person a later state of the motion, which is that of the file unless edited."""
        if actor.clip_origin is not None and actor.clip is actor.clip_origin[1]:
            actor.clip_origin = actor.clip_origin[0], clip
        actor.clip = clip

    @property
    def actors(self) -> list[Actor]:
        """All people found so far, bodies first."""
        return [*self._bodies.values(), *self._points.values()]

    @property
    def has_bodies(self) -> bool:
        """Whether any person found so far has a body, not only keypoints."""
        return bool(self._bodies)

    def place(self, up: str) -> None:
        """Rotate all people upright, including later ones, if the capture's up axis is negative."""
        self.up = "z" if up.endswith("z") else "y"
        for actor in self._points.values():
            actor.figure = replace(actor.figure, up=self.up)
        self.hangs = up.startswith("-")
        if self.hangs:
            self.placement = rotation_transform(0, np.pi)
            for actor in self.actors:
                actor.placement = self.placement.copy()

    def carry_to(self, target: Figure) -> list[Diagnostic]:
        """Let bodies, once placed, move another figure; return messages about matched joints."""
        # Nothing changes if too few joints match.
        notes: list[Diagnostic] = []
        clips: list[tuple[Actor, SampledClip, Drive]] = []
        for actor in self._bodies.values():
            assert isinstance(actor.clip, SampledClip)  # set when the actor was created
            drive = self._drive(actor.figure, actor.clip)
            clip, said = driven_clip(drive, target)
            clips.append((actor, clip, drive))
            notes += said
        self.target = target
        for actor, clip, drive in clips:
            self._replace_clip(actor, clip)
            actor.figure, actor.color, actor.drive = target, None, drive
            actor.pose = figure_pose(target)
        notes = [replace(note, path=self.path) for note in notes] + self._finished()
        pose_actors((actor for actor, _, _ in clips), 0.0)
        return self._fresh([*notes, *self._shape_notes()])

    def refusal(self, problem: RigError) -> RigError:
        """Return an error that also names the model that would match."""
        model = f"the {self.capture.model} model" if self.capture.model else "the model"
        values = {
            "problem": problem.cause,
            "member": self.capture.model,
            "remedy": Remedy(f"open {model} first", f"specify {model} with --model"),
        }
        key = (
            "F004.capture-of-member: {problem}; {remedy}"
            if self.capture.model
            else "F004.capture: {problem}; {remedy}"
        )
        return RigError(Diagnostic(key, self.path, values=values))


def _order(item: tuple[int, object]) -> tuple[bool, int]:
    """Return a sort key of people: by number, untracked ones last."""
    person = item[0]
    return not is_tracked(person), abs(person)


def _grown(first: Drive, second: Drive) -> Drive:
    """Return the merged drive of a figure over the rows of two motions with the same timeline."""
    motion = first.motion
    clip = _extended(motion.clip, second.motion.clip)
    return replace(first, motion=replace(motion, clip=clip))


def _extended(first: _Clip, second: _Clip) -> _Clip:
    """Return one clip with the rows of two clips on the same timeline."""
    own, new = first.timing, second.timing
    # The rows of the second clip follow those of the first.
    rows = np.where(new.rows >= 0, new.rows + first.n_rows, own.rows).astype(np.int32)
    return joined([first, second], replace(own, rows=rows))
