"""One fault or remark: its message key, its place, and the values that its message shows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from viewer.diagnostics.template import rendered
from viewer.diagnostics.wording import CODES, FURTHER, MESSAGES, NOTHING_ELSE, PLACES
from viewer.phrases import listed, printable

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Part = Literal[
    "",
    "positions",
    "weights",
    "triangles",
    "bindings",
    "joints",
    "items",
    "channels",
    "frames",
]
"""The data of a figure or motion that a fault is in."""


@dataclass(frozen=True, slots=True, eq=False)
class Diagnostic:
    """Something that a reader, check or operation found.

    Attributes
    ----------
    key : str
        A key of ``MESSAGES``: the code, a dot, and the name of the message: ``"W004.vertices"``.
    path : Path or None
        The file it is in.
    line : int or None
        In that file, from 1.
    part : str
        The data that ``places`` index. A reader replaces them with neutral values.
    places : (N,) int32 or None
        Vertices (of positions and weights), triangles, joints (of bindings, of joints, and of
        items: their boxes, limits and poses), channels of a clip, or rows of frames, ascending.
    values : mapping of str to object
        What the template shows.
    count : int
        How many faults it stands for; 0 if another one says what is wrong, and this one only
        where.
    level : str
        Severity, if it is not that of the code.
    is_refusal : bool
        Whether ``load`` refuses the file for it.
    is_final : bool
        Whether it ended the reading of its file.
    """

    key: str
    path: Path | None = None
    line: int | None = None
    part: Part = ""
    places: NDArray[np.int32] | None = None
    values: Mapping[str, Any] = field(default_factory=dict)
    count: int = 1
    level: str = ""
    is_refusal: bool = False
    is_final: bool = False

    @property
    def code(self) -> str:
        """The stable code: a key of ``CODES``."""
        return self.key.partition(".")[0]

    @property
    def severity(self) -> str:
        """One of ``SEVERITIES``; what a file is refused for is an error."""
        return self.level or ("error" if self.is_refusal else CODES[self.code].severity)

    @property
    def message(self) -> str:
        """What is wrong, on one line, without the place."""
        return rendered(MESSAGES[self.key], self.values)

    @property
    def full_message(self) -> str:
        """The message with the number of further faults, and whether reading ended there."""
        text = self.message
        if self.count > 1:
            text += FURTHER.format(self.count)
            noun = PLACES.get(self.part)
            if self.places is not None and len(self.places) > 1 and noun is not None:
                text += f" ({noun} {listed(self.places.tolist())})"
        # The name of a file that cannot be read promises no further checks.
        return text + NOTHING_ELSE * (self.is_final and self.code != "F001")

    @property
    def place(self) -> str:
        """``file:line``, as much of it as is known."""
        if self.path is None:
            return ""
        path = printable(self.path, 300)
        return path if self.line is None else f"{path}:{self.line}"

    @property
    def labelled(self) -> str:
        """The line, with its severity in front unless that is a note."""
        return str(self) if self.severity == "note" else f"{self.severity}: {self}"

    def __str__(self) -> str:
        """Return one line: place and message."""
        return ": ".join(filter(None, (self.place, self.message)))
