"""Findings: diagnostics with their places in a scene; thresholds of the checks that find them."""

from __future__ import annotations

import math
from dataclasses import field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from viewer.data_classes import dataclass, setting
from viewer.diagnostics import CODES, Diagnostic
from viewer.diagnostics.codes import Severity
from viewer.formats import folder_name
from viewer.phrases import printable
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.inspection.faults import NO_INDICES

MAX_ROTATION = 3400.0
"""Default limit of the rotation rate of a joint relative to its parent, degrees per second."""

NO_TIMES: Floats = np.zeros(0)


@dataclass(frozen=True, slots=True)
class LintOptions:
    """Check thresholds that depend on the user's purpose."""

    max_speed: float | None = setting(
        None,
        "speed limit of joints and keypoints, in figure units per second (default: 15 sizes)",
        metavar="S",
    )
    max_rotation: float = setting(
        float(np.radians(MAX_ROTATION)),
        f"speed limit of joint rotations, per second (default: {MAX_ROTATION:g})",
        given=MAX_ROTATION,
        read=math.radians,
        metavar="DEGREES",
    )
    """Radians per second, relative to the joint's parent."""
    confidence: float = setting(
        0.3,
        "minimum confidence of captured keypoints; keypoints that are below it in more than 5 %% "
        "of their frames are reported (default: {default})",
        metavar="C",
    )
    rate: float = 60.0
    """Minimum sampling rate of keyed clips, per second."""
    frame_rate: float | None = setting(
        None,
        "frames per second of captures, and for sampling keyframed clips (default: 30)",
        flag="--fps",
        metavar="N",
    )
    ground: float | Literal["auto", "none"] = setting(
        "auto",
        "height of the ground; feet that are below it by more than 1 %% of the figure's height (17 "
        "mm for a person) are reported; auto: the height at which feet rest longest; none: feet "
        "are not checked (default: {default})",
        metavar="HEIGHT|auto|none",
    )
    """Along the scene's up axis."""


@dataclass(frozen=True, slots=True, eq=False)
class Finding:
    """A diagnostic with its location in a scene."""

    diagnostic: Diagnostic
    """The diagnostic, with file and line if known."""
    actor: int | None = None
    """Index in the scene."""
    name: str = ""
    """Name of the actor."""
    part: Literal["", "mesh", "skeleton", "clip"] = ""
    """The part of the actor that the finding refers to."""
    vertices: Ints = field(default_factory=lambda: NO_INDICES)
    triangles: Ints = field(default_factory=lambda: NO_INDICES)
    joints: Ints = field(default_factory=lambda: NO_INDICES)
    """(N,): indices in the actor's figure, worst first; keypoints of captures are listed as
    joints."""
    frames: Ints = field(default_factory=lambda: NO_INDICES)
    """(N,): frame numbers as in the file, worst first."""
    times: Floats = field(default_factory=lambda: NO_TIMES)
    """(N,): times of these frames on the scene's clock, in seconds."""
    seek: float | None = None
    """Best time for viewing the finding, in seconds; None for the first of ``times``."""
    motion: str = ""
    """Label of the animation that the finding is about, if the figure has several."""
    animation: int = -1
    """Index of that animation, which need not be playing; -1 for none."""
    at: tuple[str, int] | None = None
    """The first item of the message, whose position in the file the reader recorded: ``("weights",
    5)`` is the line of vertex 5's weights."""

    @property
    def code(self) -> str:
        """A key of ``CODES``."""
        return self.diagnostic.code

    @property
    def severity(self) -> Severity:
        """Severity of the diagnostic."""
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
        return (code.other_hint if self.line is None else "") or code.hint

    def located(self, file: Path, line: int | None = None, pointer: str | None = None) -> Finding:
        """Return the finding with a new location in the files; without a pointer, with its own."""
        pointer = self.diagnostic.pointer if pointer is None else pointer
        found = replace(self.diagnostic, path=file, line=line, pointer=pointer)
        return replace(self, diagnostic=found)

    def __str__(self) -> str:
        """Return place, severity, code and message, in one line."""
        place, names = "", [self.motion]
        if self.file is not None and self.file != Path():
            place = self.place()
            # The figure of a folder has the folder's name, but its findings name a file inside it.
            folders = self.file.parent.name, folder_name(self.file.parent)
            if self.name not in (self.file.stem, self.file.name, *folders):
                names = [self.name, self.motion]
        elif self.name:
            place = printable(self.name, 100)
        who = "".join(f"{printable(name, 100)}: " for name in names if name)
        head = f"{place}: " if place else ""
        text = f"{self.severity} {self.code}: {who}{printable(self.message, 2000)}"
        return f"{head}{text}"

    def place(self, longest: int = 300, is_short: bool = False) -> str:
        """Return ``file:line`` or ``file#pointer``, or what is known; short without the folder."""
        return "" if self.file == Path() else self.diagnostic.placed(longest, is_short)
