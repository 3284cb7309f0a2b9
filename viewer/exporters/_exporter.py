"""Properties of an exporter, what an export writes, and a check that several exporters share."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field
from typing import Literal, TypeAlias

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Bools
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.vectors import SignedUp
from viewer.rigs.motion.sampled_animation import SampledAnimation, SampledPoints
from viewer.rigs.motion.transform_clip import TransformClip
from viewer.rigs.scene import Actor, Scene

FOLDER = "/"
"""Placeholder, among suffixes, for a folder."""

Content: TypeAlias = Literal["pose", "clips", "frames", "parts", "points"]
"""What a file contains of an actor: its current pose, its animations with their own keys, a motion
as poses at a rate (in parts if it is long), or captured points at a rate."""


@dataclass(frozen=True, slots=True)
class Exporter:
    """Properties of an exporter that everyone needs before its module is imported.

    Its module has ``export(selection, path, options)``, which writes the parts of a ``Selection``
    and returns notes. Modules of exporters with ``joints`` have ``require(figure)``, which raises
    ``RigError`` for figures whose joints the format cannot hold.
    """

    title: str
    """Label in menus."""
    suffixes: tuple[str, ...]
    """With leading dots; ``FOLDER`` represents a folder."""
    keeps: str
    omits: str
    """Data that its files contain, and data that they cannot store."""
    stores: frozenset[Content]
    """What its files can contain of an actor."""
    stores_many: bool = False
    """Whether a file can contain several actors."""
    stores_cameras: bool = False
    """Whether a file can contain the cameras of the scene."""
    needs: Literal["mesh", "skeleton", ""] = ""
    """The part without which nothing of a figure can be written."""
    joints: Literal["course", "human", "smpl", ""] = ""
    """The joints that a figure must have: those of ``.skel`` files, the human bones of VRM, those
    of the SMPL family, or any."""
    options: frozenset[str] = frozenset()
    """Names of the options that apply to few formats: those of ``ExportOptions`` that it uses."""
    written: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Suffixes of all files that are written for a suffix, if there are several; an empty one is
    the file that was asked for."""
    folder: str = ""
    """Name of the folder that it writes into the given one; empty for files."""
    is_numbered: bool = False
    """Whether each frame of a motion has its own file."""
    keeps_gaps: bool = False
    """Whether frames of a motion may be missing; other motions are split at gaps on request."""
    omits_hidden: bool = False
    """Whether hidden parts of a mesh are left out; other formats contain them."""
    keeps_world: bool = False
    """Whether it keeps the up axis of the motion's own world, even if that world is upside down."""

    @property
    def stores_motion(self) -> bool:
        """Whether a file can contain a motion as poses at a rate."""
        return "frames" in self.stores

    def holds(self, figure: Figure) -> bool:
        """Return whether a figure has the part that the format needs."""
        return not self.needs or getattr(figure, self.needs) is not None


@dataclass(frozen=True, slots=True, eq=False)
class SampledParts:
    """A long motion, as consecutive parts that are read while they are written."""

    parts: Callable[[], Iterator[SampledAnimation]]
    """Yields the parts; may be called repeatedly. If there are several, the figure is always
    present, and scales and shape are the same in all frames."""
    n_frames: int
    """Number of all frames, N."""
    may_move_inner_joints: bool
    """Whether a joint with a parent may be translated in the file; several roots get a common
    parent."""


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """What is written of an actor: its pose, unless animations or frames are given."""

    actor: Actor
    clips: Sequence[TransformClip] | None = None
    """Animations that keep their own keys; the figure is then at rest."""
    frames: SampledAnimation | SampledPoints | SampledParts | None = None
    """A motion at a rate."""
    up: SignedUp = "y"
    """Up axis of the frames; negative for those that keep their world."""

    @property
    def content(self) -> Content:
        """What the file contains of the actor."""
        if self.frames is None:
            return "pose" if self.clips is None else "clips"
        if isinstance(self.frames, SampledParts):
            return "parts"
        return "frames" if isinstance(self.frames, SampledAnimation) else "points"

    @property
    def animation(self) -> SampledAnimation:
        """The frames of joints."""
        assert isinstance(self.frames, SampledAnimation)  # the caller has checked the content
        return self.frames

    @property
    def start(self) -> float:
        """Time of the first frame on the scene's clock, seconds."""
        return self.actor.offset + float(self.animation.frames.times[0])

    @property
    def present(self) -> Bools:
        """Whether the actor is present in each frame; in its pose or parts, one value."""
        if isinstance(self.frames, SampledPoints):
            return self.frames.present
        if self.frames is None or isinstance(self.frames, SampledParts):
            return np.array([self.actor.is_present])
        return self.frames.frames.present


@dataclass(frozen=True, slots=True, eq=False)
class Selection:
    """What an export writes."""

    parts: Sequence[Part]
    """At least one, in the order of the scene. Actors that are absent at that time, or from all
    frames, are left out, but they count in numbered names of files."""
    scene: Scene | None = None
    """In which figures are upright, and placed if a file contains several; its cameras are written,
    too. Without one, actors are written as they are."""
    among: Sequence[Actor] = ()
    """All actors that count in the names, if some were left out before; else those of the parts."""

    @property
    def part(self) -> Part:
        """The only part."""
        (part,) = self.parts
        return part

    @property
    def actors(self) -> list[Actor]:
        """The actor of each part."""
        return [part.actor for part in self.parts]


def require_mesh(actor: Actor, what: str) -> None:
    """Raise RigError for a figure without a mesh; the message names the format."""
    if actor.figure.mesh is None:
        raise RigError(f"figure {actor.figure.name} has no mesh to write as {what}")
