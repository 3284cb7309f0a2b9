"""Tracks: positions of an actor's joints in the scene in every frame of its clip."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.rig.arrays import Bools, Floats, Ints

__all__ = ["Indices", "Track"]

Indices = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A motion evaluated frame by frame.

    Attributes
    ----------
    times : (F,)
        Times on the scene's clock, in seconds.
    numbers : (F,) int32
        Number of each frame in the file; for keyed clips, the frame of the timeline. Several rows
        may have the same frame.
    present : (F,) bool
        Whether the row is defined: the actor is present, and the data of the file is valid.
    positions : (F, J, 3)
        Joints in scene space.
    rotations : (F, J, 4)
        Local rotations: unit quaternions.
    stepped : (F, J) bool
        Whether a key without interpolation, of the joint or of an ancestor, is between the previous
        row and this one: such jumps are intended.
    size : float
        Size of the skeleton at rest, in scene units.
    scale : float
        Scene units per figure unit.
    feet : (N,) int32
        The joint of each foot nearest to the ground; empty unless joint names identify two feet.
    soles : (F, N)
        Height of each foot's lowest point in the scene.
    """

    times: Floats
    numbers: Ints
    present: Bools
    positions: Floats
    rotations: Floats
    stepped: Bools
    size: float
    scale: float
    feet: Ints
    soles: Floats

    @property
    def n_frames(self) -> int:
        """Number of frames from the first to the last in which the actor is present."""
        there = self.numbers[self.present]
        return int(there[-1]) - int(there[0]) + 1 if len(there) else 0

    def of_each(self, rows: Indices) -> Indices:
        """Return rows, keeping only the first of each frame: (N,)."""
        _, first = np.unique(self.numbers[rows], return_index=True)
        return rows[np.sort(first)]
