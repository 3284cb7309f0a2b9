"""Findings of checks, and the subject passed to checks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import CODES, Diagnostic
from viewer.diagnostics.template import rendered
from viewer.lint._counting import Counting
from viewer.lint._track import Track
from viewer.phrases import printable, rounded
from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.motion.animation_choice import animation_labels
from viewer.rig.scalars import length_text
from viewer.rig.scene import Actor
from viewer.rig.shape import rest_joints
from viewer.rig.units import METRES

__all__ = ["MAX_ROTATION", "Finding", "LintOptions", "Subject"]

MAX_ROTATION = 3400.0
"""Default limit of the rotation rate of a joint relative to its parent, degrees per second."""

_NONE: Ints = np.zeros(0, dtype=np.int32)
_NO_TIMES: Floats = np.zeros(0)
_STRAYS = 0.02  # maximum fraction of stray vertices at each end of an axis
_FAR = 10.0  # strays are ignored if they enlarge the bounding box by more than this factor

Indices = NDArray[np.int64] | Ints | list[int]


@dataclass(frozen=True, slots=True)
class LintOptions:
    """Check thresholds that depend on the user's purpose.

    Attributes
    ----------
    max_speed : float or None
        Maximum speed of a joint or keypoint, figure units per second; None for 15 times the
        figure's size.
    max_rotation : float
        Maximum rotation rate of a joint relative to its parent, radians per second; by default
        ``MAX_ROTATION``.
    confidence : float
        Captured keypoints below this have low confidence.
    rate : float
        Minimum sampling rate of keyed clips, per second.
    frame_rate : float or None
        Frames per second for numbering the frames of keyed clips; None for the rate of their keys.
    ground : float, "auto" or "none"
        Height of the ground along the scene's up axis; detected from the feet if
        ``"auto"``; with ``"none"``, feet are not checked.
    """

    max_speed: float | None = None
    max_rotation: float = float(np.radians(MAX_ROTATION))
    confidence: float = 0.3
    rate: float = 60.0
    frame_rate: float | None = None
    ground: float | Literal["auto", "none"] = "auto"


@dataclass(frozen=True, slots=True, eq=False)
class Finding:
    """A diagnostic with its location in a scene.

    Attributes
    ----------
    diagnostic : Diagnostic
        The diagnostic, with file and line if known.
    actor : int or None
        Index in the scene.
    name : str
        Name of the actor.
    part : "", "mesh", "skeleton" or "clip"
        The part of the actor that the finding refers to.
    vertices, triangles, joints : (N,) int32
        Indices in the actor's figure, worst first; keypoints of captures are listed as joints.
    frames : (N,) int32
        Frame numbers as in the file, worst first.
    times : (N,)
        Times of these frames on the scene's clock, in seconds.
    seek : float or None
        Best time for viewing the finding, in seconds; None for the first of ``times``.
    motion : str
        Label of the animation that the finding is about, if the figure has several.
    animation : int
        Index of that animation, which need not be playing; -1 for none.
    at : (str, int) or None
        The first item of the message, whose position in the file the reader recorded:
        ``("weights", 5)`` is the line of vertex 5's weights.
    """

    diagnostic: Diagnostic
    actor: int | None = None
    name: str = ""
    part: Literal["", "mesh", "skeleton", "clip"] = ""
    vertices: Ints = field(default_factory=lambda: _NONE)
    triangles: Ints = field(default_factory=lambda: _NONE)
    joints: Ints = field(default_factory=lambda: _NONE)
    frames: Ints = field(default_factory=lambda: _NONE)
    times: Floats = field(default_factory=lambda: _NO_TIMES)
    seek: float | None = None
    motion: str = ""
    animation: int = -1
    at: tuple[str, int] | None = None

    @property
    def code(self) -> str:
        """A key of ``CODES``."""
        return self.diagnostic.code

    @property
    def severity(self) -> str:
        """Severity, one of ``SEVERITIES``."""
        return self.diagnostic.severity

    @property
    def message(self) -> str:
        """The message, one line with its values."""
        return self.diagnostic.full_message

    @property
    def file(self) -> Path | None:
        """The file that the finding is about, if known."""
        return self.diagnostic.path

    @property
    def line(self) -> int | None:
        """Line of ``file``, from 1."""
        return self.diagnostic.line

    @property
    def pointer(self) -> str:
        """JSON pointer to the element of ``file``; empty if there is none."""
        return self.diagnostic.pointer

    @property
    def title(self) -> str:
        """Title of the code."""
        return CODES[self.code].title

    @property
    def hint(self) -> str:
        """Suggested remedy."""
        code = CODES[self.code]
        has_other = code.other_hint and self.line is None
        return rendered(code.other_hint if has_other else code.hint, {})

    def located(
        self,
        file: Path | None,
        line: int | None = None,
        severity: str = "",
        pointer: str | None = None,
    ) -> Finding:
        """Return the finding with a new location in the files, and a severity if one is given."""
        known = self.diagnostic
        found = replace(
            known,
            path=file,
            line=line,
            level=severity or known.level,
            pointer=known.pointer if pointer is None else pointer,
        )
        return replace(self, diagnostic=found)

    def place(self, longest: int = 300, is_short: bool = False) -> str:
        """Return ``file:line`` or ``file#pointer``, or the known part of it.

        Parameters
        ----------
        longest : int
            Maximum length of the file's path.
        is_short : bool
            Whether the folder is omitted.
        """
        if self.file is None or self.file == Path():
            return ""
        path = printable(self.file.name if is_short else self.file, longest)
        if self.pointer:
            return f"{path}#{printable(self.pointer, 120)}"
        return path if self.line is None else f"{path}:{self.line}"


@dataclass(frozen=True, slots=True, eq=False)
class Subject:
    """One actor to check.

    Attributes
    ----------
    actor : Actor
        The actor, which is not modified.
    index : int
        Index of the actor in its scene.
    up : "y" or "z"
        The scene's up axis.
    options : LintOptions
        Thresholds of the checks.
    counting : Counting or None
        Frame numbering of keyed clips; None to number each clip separately.
    invalid : mapping of str to (N,)
        Data that a reader replaced because the data in the file is invalid: vertices by
        ``"positions"`` and ``"weights"``, ``"triangles"``, joints by ``"bindings"`` and
        ``"joints"``, rows by ``"frames"``.
    people : tuple of Actor
        All captured people of the scene, in its order.
    tracks : list of Track
        Cached track of the actor's clip; may be empty.
    """

    actor: Actor
    index: int = 0
    up: Literal["y", "z"] = "y"
    options: LintOptions = field(default_factory=LintOptions)
    counting: Counting | None = None
    invalid: Mapping[str, Ints] = field(default_factory=dict)
    people: tuple[Actor, ...] = ()
    # Results that several checks need are computed once: ``track_of`` caches them here.
    tracks: list[Track] = field(default_factory=list)

    def valid(self, part: str, count: int) -> Bools:
        """Return which items are valid data of the file.

        Parameters
        ----------
        part : str
            A key of ``invalid``.
        count : int
            Number of items.

        Returns
        -------
        (count,)
            False for items whose data was replaced.
        """
        result = np.ones(count, dtype=np.bool_)
        lost = self.invalid.get(part, _NONE)
        result[lost[lost < count]] = False
        return result

    def length(self, length: float) -> str:
        """Return a length as text: in millimetres if the unit is known, else relative to size."""
        figure = self.actor.figure
        if figure.unit in METRES:
            return length_text(figure, length)
        return f"{rounded(length)} units" + self._relative(length)

    def speed(self, speed: float, is_limit: bool = False) -> str:
        """Return a speed as text: in metres per second if the unit is known.

        Otherwise, a speed that is not a limit is also given as a multiple of the size.
        """
        unit = self.actor.figure.unit
        if unit in METRES:
            return f"{rounded(speed * METRES[unit])} m/s"
        size = 0.0 if is_limit else self.size()
        relative = f" ({rounded(speed / size)} times its size)" if size > 0.0 else ""
        return f"{rounded(speed)} units per second{relative}"

    def size(self) -> float:
        """Return the diagonal of the bounding box of the mesh, or else of the joints at rest.

        Figure units; 0 without either. Distant stray vertices are ignored.
        """
        figure = self.actor.figure
        if figure.mesh is None:
            return 0.0 if figure.skeleton is None else box_size(bounding_box(rest_joints(figure)))
        positions = figure.mesh.positions
        size = box_size(bounding_box(positions))
        if len(positions) == 0:
            return size
        # Partitioning finds both quantiles of an axis without sorting.
        inner = np.quantile(positions, [_STRAYS, 1.0 - _STRAYS], axis=0, method="nearest")
        usual = box_size(inner)
        if not size > _FAR * usual > 0.0:
            return size
        near = np.linalg.norm(positions - inner.mean(axis=0), axis=1) < _FAR / 2 * usual
        return box_size(bounding_box(positions[near]))

    def _relative(self, length: float) -> str:
        size = self.size()
        return f" ({rounded(100.0 * length / size)} % of its size)" if size > 0.0 else ""

    def found(
        self,
        key: str,
        *,
        part: Literal["mesh", "skeleton", "clip"] = "mesh",
        severity: str = "",
        vertices: Indices = _NONE,
        triangles: Indices = _NONE,
        joints: Indices = _NONE,
        frames: Indices = _NONE,
        times: Floats = _NO_TIMES,
        seek: float | None = None,
        at: tuple[str, int] | None = None,
        **values: Any,
    ) -> Finding:
        """Return a finding about this actor, with the values of the message ``key``."""
        return Finding(
            Diagnostic(key, level=severity, values=values),
            actor=self.index,
            name=self.actor.name,
            part=part,
            vertices=np.asarray(vertices, dtype=np.int32),
            triangles=np.asarray(triangles, dtype=np.int32),
            joints=np.asarray(joints, dtype=np.int32),
            frames=np.asarray(frames, dtype=np.int32),
            times=times,
            seek=seek,
            motion=self._motion() if part == "clip" else "",
            animation=self.actor.animation if part == "clip" else -1,
            at=at,
        )

    def _motion(self) -> str:
        """Return the label of the animation that the actor plays, if its figure has several."""
        figure, index = self.actor.figure, self.actor.animation
        if index < 0 or len(figure.animations) < 2:
            return ""
        return animation_labels(figure)[index]
