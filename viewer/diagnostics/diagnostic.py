"""A single error, warning or note: message key, location and values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from viewer.data_classes import dataclass
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
"""Part of a figure or motion that a diagnostic refers to."""


@dataclass(frozen=True, slots=True, eq=False)
class Diagnostic:
    """An error, warning or note from a reader, check or operation.

    Attributes
    ----------
    key : str
        A key of ``MESSAGES``: code, dot, name of the message, as in ``"W004.vertices"``.
    path : Path or None
        The file that the message is about.
    line : int or None
        Line in that file, from 1.
    part : str
        Part of the figure or motion that ``places`` indexes. Readers replace the faulty elements
        with neutral values.
    places : (N,) int32 or None
        Indices, ascending: vertices (positions, weights), triangles, joints (bindings, joints, and
        items: boxes, limits and poses), channels of a clip, or rows of frames.
    values : mapping of str to object
        Values for the template.
    count : int
        Number of errors that it represents; 0 if it only adds indices to an error reported by
        another diagnostic.
    level : str
        Severity, if different from that of the code.
    is_refusal : bool
        Whether ``load`` refuses the file because of it.
    is_final : bool
        Whether parsing of the file stopped there.
    pointer : str
        JSON pointer (RFC 6901) to the element of that file, as in ``"/skins/0/joints/3"``.
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
    pointer: str = ""

    @property
    def code(self) -> str:
        """The stable code: a key of ``CODES``."""
        return self.key.partition(".")[0]

    @property
    def severity(self) -> str:
        """One of ``SEVERITIES``; a refusal is an error unless ``level`` differs."""
        from viewer.diagnostics.wording import CODES

        return self.level or ("error" if self.is_refusal else CODES[self.code].severity)

    @property
    def message(self) -> str:
        """The message on one line, without the location."""
        from viewer.diagnostics.template import rendered
        from viewer.diagnostics.wording import MESSAGES

        return rendered(MESSAGES[self.key], self.values)

    @property
    def full_message(self) -> str:
        """The message with the number of errors, and whether it stopped parsing."""
        from viewer.diagnostics.wording import FURTHER, NOTHING_ELSE, PLACES

        text = self.message
        if self.count > 1:
            text += FURTHER.format(self.count)
            noun = PLACES.get(self.part)
            if self.places is not None and len(self.places) > 1 and noun is not None:
                text += f" ({noun} {listed(self.places.tolist())})"
        # Nothing could be checked in a file that cannot be read at all.
        return text + NOTHING_ELSE * (self.is_final and self.code != "F001")

    @property
    def place(self) -> str:
        """``file:line`` or ``file#pointer``, or the known part of it."""
        if self.path is None:
            return ""
        path = printable(self.path, 300)
        if self.pointer:
            return f"{path}#{printable(self.pointer, 120)}"
        return path if self.line is None else f"{path}:{self.line}"

    @property
    def labelled(self) -> str:
        """Location and message, prefixed with the severity unless it is a note."""
        return str(self) if self.severity == "note" else f"{self.severity}: {self}"

    def __str__(self) -> str:
        """Return location and message on one line."""
        return ": ".join(filter(None, (self.place, self.message)))
