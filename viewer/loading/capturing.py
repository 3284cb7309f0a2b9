"""Make actors of a capture while it is being read: part by part, person by person."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from viewer.errors import RigError
from viewer.rig.arrays import Floats, Ints
from viewer.rig.captures.capture import Capture, CapturePart
from viewer.rig.captures.person import is_tracked, person_label
from viewer.rig.captures.points import PointClip, PointLayout
from viewer.rig.figure import Figure
from viewer.rig.geometry.transform import rotation_transform
from viewer.rig.motion.body_motion import BodyMotion, body_clip
from viewer.rig.motion.evaluation import pose_actor
from viewer.rig.motion.sampled_clip import SampledClip, joined
from viewer.rig.motion.timing import Timing
from viewer.rig.scene import Actor

__all__ = ["Builder", "joined_points", "joined_timing"]

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
"""Of people, in the order in which they appear; linear."""


@dataclass(slots=True, eq=False)
class Builder:
    """Turns the parts of one capture into actors that grow.

    Attributes
    ----------
    capture : Capture
        What is read.
    model : Figure
        What its bodies are drawn with.
    called : str
        What all people of it are called; after the capture if empty.
    keeps_shape : bool
        Whether the capture's shape coefficients mean something to the model.
    placement : (4, 4)
        Of every actor.
    up : "y" or "z"
        The axis along which people stand before they are placed.
    n_read : int
        Frames that have been taken in.
    is_cut : bool
        Whether reading was given up before the end.
    has_shape, has_expression : bool
        Whether the files give shapes other than 0, and expressions.
    """

    capture: Capture
    model: Figure
    called: str = ""
    keeps_shape: bool = True
    placement: Floats = field(default_factory=lambda: np.eye(4))
    up: Literal["y", "z"] = "y"
    n_read: int = 0
    is_cut: bool = False
    has_shape: bool = False
    has_expression: bool = False
    _names_shapes: bool = False  # whether anybody has shapes, if only zeros
    _parts: Iterator[CapturePart] | None = None
    _bodies: dict[int, Actor] = field(default_factory=dict)
    _points: dict[int, Actor] = field(default_factory=dict)
    _notes: set[str] = field(default_factory=set)

    @property
    def is_done(self) -> bool:
        """Whether there is nothing left to read."""
        return self.is_cut or self.n_read >= self.capture.n_frames

    def parts(self) -> Iterator[CapturePart]:
        """Return the iterator over what is left; may be advanced in another thread."""
        if self._parts is None:
            self._parts = self.capture.parts()
        return self._parts

    def read_some(self) -> tuple[list[Actor], list[str]]:
        """Read the next part; return the actors that are new, and what was noticed."""
        part = next(self.parts(), None)
        if part is None:
            self.is_cut = True
            return [], []
        return self.add(part)

    def add(self, part: CapturePart) -> tuple[list[Actor], list[str]]:
        """Take in one part.

        Returns
        -------
        new : list of Actor
            People who appear for the first time; posed as at the start.
        notes : list of str
            One line each, none twice.

        Raises
        ------
        RigError
            If the bodies do not fit the model.
        """
        new: list[Actor] = []
        notes = [*map(str, part.warnings)]
        for person, motion in sorted(part.bodies.items(), key=_order):
            notes += self._add_body(person, motion, new)
        for person, (layout, clip) in sorted(part.points.items(), key=_order):
            notes += self._add_points(person, layout, clip, new)
        self.n_read = max(self.n_read, part.stop)
        notes += self._shape_notes()
        for actor in new:
            pose_actor(actor, 0.0)
        fresh = [note for note in dict.fromkeys(notes) if note not in self._notes]
        self._notes.update(fresh)
        return new, fresh

    def _shape_notes(self) -> list[str]:
        """Say at the end that bodies have the model's mean shape because no file has another."""
        lacks = self._bodies and self.model.n_shapes and not self._names_shapes
        if not (self.is_done and self.keeps_shape and lacks):
            return []
        return [f"{self.capture.name}: no shapes in the files: all have the model's mean shape"]

    def _add_body(self, person: int, motion: BodyMotion, new: list[Actor]) -> list[str]:
        self.has_shape |= motion.shape is not None and bool(motion.shape.any())
        self.has_expression |= motion.expression is not None
        self._names_shapes |= motion.shape is not None
        if not self.keeps_shape:
            motion = replace(motion, shape=None, expression=None)
        clip, notes = body_clip(motion, self.model)
        actor = self._bodies.get(person)
        if actor is None:
            actor = self._actor(self.model, clip, person)
            actor.color = _COLORS[len(self._bodies) % len(_COLORS)]
            self._bodies[person] = actor
            new.append(actor)
        else:
            assert isinstance(actor.clip, SampledClip)  # as it was made above
            timing = joined_timing(actor.clip.timing, clip.timing, actor.clip.n_rows)
            actor.clip = joined([actor.clip, clip], timing)
        return notes

    def _add_points(
        self, person: int, layout: PointLayout, clip: PointClip, new: list[Actor]
    ) -> list[str]:
        actor = self._points.get(person)
        if actor is None:
            figure = Figure(layout.title, points=layout, up=self.up)
            actor = self._actor(figure, clip, person)
            self._points[person] = actor
            new.append(actor)
            return []
        known = actor.figure.points
        assert isinstance(actor.clip, PointClip) and known is not None  # as it was made above
        if len(known.names) != len(layout.names):
            frame = self.n_read + self.capture.first_frame
            return [
                f"{self.capture.name}: {person_label(person)} has {len(layout.names)} keypoints in "
                f"frames from {frame} on, {len(known.names)} before; those frames are left out"
            ]
        actor.clip = joined_points(actor.clip, clip)
        return []

    def _actor(self, figure: Figure, clip: SampledClip | PointClip, person: int) -> Actor:
        called = self.called or self.capture.name
        placement = self.placement.copy()
        return Actor(figure, clip=clip, placement=placement, person=person, called=called)

    @property
    def actors(self) -> list[Actor]:
        """Everybody found so far, bodies first."""
        return [*self._bodies.values(), *self._points.values()]

    def place(self, up: str) -> None:
        """Stand everybody up, also those who come later, if an axis points down in the world.

        Parameters
        ----------
        up : "y", "z", "-y" or "-z"
            The axis that points up in the capture.
        """
        self.up = "z" if up.endswith("z") else "y"
        for actor in self._points.values():
            actor.figure = replace(actor.figure, up=self.up)
        if up.startswith("-"):
            self.placement = rotation_transform(0, np.pi)
            for actor in self.actors:
                actor.placement = self.placement.copy()

    def refusal(self, problem: RigError) -> RigError:
        """Return a refusal that says which model would fit."""
        wanted = f"a {self.capture.model} model" if self.capture.model else "the model"
        return RigError(f"{self.capture.name}: {problem}; name {wanted} with --model")


def _order(item: tuple[int, object]) -> tuple[bool, int]:
    """Sort people by number, those without a track behind all others."""
    person = item[0]
    return not is_tracked(person), abs(person)


def joined_timing(first: Timing, second: Timing, shift: int) -> Timing:
    """Return the timing of rows put behind one another: those of ``second`` moved by ``shift``."""
    rows: Ints = np.where(second.rows >= 0, second.rows + shift, first.rows).astype(np.int32)
    return replace(first, rows=rows)


def joined_points(first: PointClip, second: PointClip) -> PointClip:
    """Return one clip of the rows of two with the same timeline."""
    timing = joined_timing(first.timing, second.timing, len(first.points))
    return PointClip(first.name, timing, np.concatenate([first.points, second.points]))
