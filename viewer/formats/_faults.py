"""Faults that readers go on from where all of them are wanted at once, as ``viewer lint`` does.

A reader refuses a file at the first fault (``Source.refuse``). A source whose ``faults`` is a list
collects them instead, and the reader puts something neutral in place of what it cannot use.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from viewer.errors import FormatError
from viewer.rig.arrays import Ints

__all__ = ["Fault", "Part"]

Part = Literal["", "positions", "weights", "triangles", "bindings", "joints", "frames"]
"""What of a figure or motion is not the file's own any more."""


@dataclass(frozen=True, slots=True, eq=False)
class Fault:
    """Something that a reader refuses, and went on from; or several of one kind.

    Attributes
    ----------
    error : FormatError
        The first, as whoever wants none is told.
    count : int
        How many there are; 0 if another fault says what is wrong, and this one only where.
    part : str
        What was replaced by something neutral; empty if nothing that checks look at.
    places : (N,) int32
        Vertices (of positions and weights), triangles, joints (of bindings and joints) or rows of
        frames, rising. A corner that no triangle can have is another one of the same triangle.
    """

    error: FormatError
    count: int
    part: Part
    places: Ints
