"""The vertices of a mesh over time: of a figure with a motion, or of a file per frame."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import OutputError, RigError, reason_of
from viewer.phrases import file_size
from viewer.progress import report
from viewer.rigs.arrays import Floats, Ints, blocks_of_rows
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.motion.evaluation import Frames, JointMotion, frames_of, pose_of
from viewer.rigs.motion.timing import frame_times
from viewer.rigs.pose import Pose
from viewer.rigs.scene import Actor
from viewer.rigs.skinning import deform, posed_mesh

_IN_MEMORY = 512_000_000  # bytes of positions; more are kept in a temporary file


@dataclass(frozen=True, slots=True, eq=False)
class MovingMesh:
    """A mesh and its vertices in some frames."""

    figure: Figure
    """Has the mesh in the bind frame, with its materials; up axis and unit."""
    positions: Floats
    """(F, V, 3). Figure units; not in memory if it is large."""
    numbers: Ints
    """(F,) int32. Number of each frame, ascending: numbers that are left out are gaps."""
    frame_rate: float
    """Frames per second."""
    bind: int = 0
    """Row of the bind frame."""
    start: float = 0.0
    """Seconds of the first frame."""

    def __post_init__(self) -> None:
        if len(self.positions) < 2:
            raise RigError(
                f"{self.figure.name}: expected a mesh that moves, in two frames or more, found one"
            )
        first = self.positions[self.bind]
        if all(np.array_equal(first, other) for other in self.positions):
            raise RigError(
                f"{self.figure.name}: expected a mesh that moves, found the same vertices in all "
                f"{len(self.positions)} frames"
            )

    @property
    def n_frames(self) -> int:
        """Number of frames, F."""
        return len(self.positions)

    @property
    def rest(self) -> Floats:
        """Positions in the bind frame: (V, 3)."""
        return np.array(self.positions[self.bind])

    @property
    def size(self) -> float:
        """Longest side of the box around the mesh in the bind frame."""
        return box_size(bounding_box(self.positions[self.bind]))


def room_for(n_frames: int, n_vertices: int) -> Floats:
    """Return an array (F, V, 3) to be filled, in a temporary file if it is large."""
    shape = n_frames, n_vertices, 3
    n_bytes = 8 * n_frames * n_vertices * 3
    if n_bytes <= _IN_MEMORY:
        return np.empty(shape)
    try:
        # Its space is reserved now: a full disk would end the program at a later write. Without a
        # name, it disappears with the array.
        with tempfile.TemporaryFile() as stream:
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(stream.fileno(), 0, n_bytes)
            return np.memmap(stream, np.float64, "w+", shape=shape)
    except OSError as problem:
        raise OutputError(
            f"{tempfile.gettempdir()}: {file_size(n_bytes)} for the vertices of {n_frames} "
            f"frames: {reason_of(problem)}"
        ) from None


def moving_mesh(actor: Actor, rate: float | None = None, bind: int | None = None) -> MovingMesh:
    """Return the vertices of a figure in all frames of its motion, at a rate or the motion's own.

    Blend shapes and pose correctives are part of them. ``bind``: number of the bind frame, by
    default the first one. ``RigError`` without a mesh or a motion.
    """
    figure, motion = actor.figure, actor.joint_motion
    if figure.mesh is None or motion is None or figure.skeleton is None:
        raise RigError(f"{actor.name}: expected a mesh that moves, found no motion")
    rate = motion.frame_rate if rate is None else rate
    times = frame_times(motion.start, motion.end, rate)
    frames = frames_of(figure, motion, times, actor.own_pose)
    present = np.flatnonzero(frames.present)
    if not len(present):
        raise RigError(f"{actor.name}: expected a mesh that moves, found it in no frame")
    timing = motion.timing
    shift = timing.first_frame if timing is not None and rate == motion.frame_rate else 0
    numbers = (present + shift).astype(np.int32)
    row = bind_row(numbers, bind)
    positions = room_for(len(present), figure.mesh.n_vertices)
    for number, frame in enumerate(present.tolist()):
        report(number, len(present), "frames", "skinning")
        positions[number] = deform(figure, pose_of(figure, frames, frame))[0]
    pose = pose_of(figure, frames, int(present[row]))
    mesh = replace(posed_mesh(figure, pose), positions=np.array(positions[row]))
    whole = Figure(figure.name, mesh, up=figure.up, unit=figure.unit)
    start = float(times[present[0]])
    return MovingMesh(whole, positions, numbers, rate, row, start)


def bind_row(numbers: Ints, bind: int | None) -> int:
    """Return the row of a frame by its number, or the first; ``RigError`` if there is none."""
    if bind is None:
        return 0
    found = np.flatnonzero(numbers == bind)
    if not len(found):
        raise RigError(
            f"bind frame: expected a frame from {numbers[0]} to {numbers[-1]}, found {bind}"
        )
    return int(found[0])


@dataclass(frozen=True, slots=True, eq=False)
class FrameErrors:
    """Distances of a skinned mesh from the moving one, in figure units."""

    rms: Floats
    largest: Floats
    """(F,). Root of the mean square over the vertices, and the largest."""
    vertices: Ints
    """(F,) int32. The vertex with the largest distance."""

    @property
    def worst(self) -> int:
        """Row of the frame with the largest RMS error."""
        return int(self.rms.argmax())

    @property
    def total(self) -> float:
        """Root of the mean square over all frames and vertices."""
        return float(np.sqrt(np.mean(self.rms**2)))


def frame_errors(
    moving: MovingMesh, skinned: Callable[[slice], Floats], vertices: Ints | None = None
) -> FrameErrors:
    """Compare a skinned mesh, (N, W, 3) for N rows of frames, with the moving one in all frames.

    ``vertices``: the moving mesh's vertex for each of the W; by default the same ones.
    """
    count = moving.n_frames
    rms, largest = np.empty(count), np.empty(count)
    worst = np.empty(count, dtype=np.int32)
    for rows in blocks_of_rows(count, 3 * moving.positions.shape[1]):
        report(rows.start, count, "frames", "measuring")
        wanted = moving.positions[rows]
        wanted = wanted if vertices is None else wanted[:, vertices]
        squared = ((skinned(rows) - wanted) ** 2).sum(axis=2)
        rms[rows], largest[rows] = np.sqrt(squared.mean(axis=1)), np.sqrt(squared.max(axis=1))
        found = squared.argmax(axis=1)
        worst[rows] = found if vertices is None else vertices[found]
    return FrameErrors(rms, largest, worst)


def posed_rows(
    figure: Figure, motion: JointMotion, times: Floats, base: Pose | None = None
) -> Callable[[slice], Floats]:
    """Return a function that skins a figure at some rows of times (F,), for ``frame_errors``."""
    frames: Frames = frames_of(figure, motion, times, base, interpolate=True)

    def skinned(rows: slice) -> Floats:
        poses = (pose_of(figure, frames, frame) for frame in range(rows.start, rows.stop))
        return np.stack([deform(figure, pose)[0] for pose in poses])

    return skinned
