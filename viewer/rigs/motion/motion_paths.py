"""Motion paths of joints and captured points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.motion.evaluation import frames_of, world_frames
from viewer.rigs.pose import Pose
from viewer.rigs.scene import Motion

_KEYED_RATE = 60.0  # points per second along curves, which have no frames
_MOST = 20_000  # maximum number of points of a path along curves
_BLOCK = 1 << 14  # number of matrices per batch, which limits the memory for long captures


@dataclass(frozen=True, slots=True, eq=False)
class MotionPath:
    """Positions of some joints of a figure at F times."""

    times: Floats
    """(F,). Seconds on the motion's own clock."""
    points: Floats
    """(F, N, 3). Figure space, including the figure's own placement and scale."""
    present: Bools
    """(F, N) bool. Whether the point is present; otherwise it is undefined."""


def path_times(motion: Motion) -> Floats:
    """Return the sampling times of a path: a capture's frames, or 60 per second on curves."""
    timing = motion.timing
    if timing is None:
        length = motion.end - motion.start
        steps = int(min(np.ceil(length * _KEYED_RATE - 1e-6), _MOST - 1))
        return np.linspace(motion.start, motion.end, max(steps, 0) + 1)
    return timing.times


def motion_path(
    figure: Figure,
    motion: Motion,
    joints: Sequence[int],
    times: Floats | None = None,
    base: Pose | None = None,
    min_confidence: float = 0.0,
) -> MotionPath:
    """Return paths of joints, or of a ``PointClip``'s points, at times of the motion's own clock.

    ``times``: ``path_times`` if omitted. ``base`` provides shape and placement if the motion has
    none. Points below ``min_confidence`` are absent. RigError if motion and figure do not match.
    """
    times = path_times(motion) if times is None else np.asarray(times, dtype=np.float64)
    chosen: Ints = np.asarray(joints, dtype=np.int32)
    points = np.zeros((len(times), len(chosen), 3))
    present = np.zeros((len(times), len(chosen)), dtype=np.bool_)
    if motion.points is not None:
        before, _, _ = motion.timing.locate(times)
        if len(motion.points):
            found = motion.points[np.maximum(before, 0)][:, chosen]
            certain = (found[..., 3] > 0.0) & (found[..., 3] >= min_confidence)
            points, present = found[..., :3], certain & (before >= 0)[:, None]
        return MotionPath(times, points, present)
    count = 1 if figure.skeleton is None else figure.skeleton.n_joints
    step = max(1, _BLOCK // count)
    for first in range(0, len(times), step):
        rows = slice(first, first + step)
        frames = frames_of(figure, motion, times[rows], base)
        points[rows] = world_frames(figure, frames)[:, chosen][..., :3, 3]
        present[rows] = frames.present[:, None]
    return MotionPath(times, points, present)


def segments(path: MotionPath) -> tuple[Floats, Floats, Ints]:
    """Return segments between present times: ends (S, 2, 3), times (S, 2), path indices (S,)."""
    which, first = np.nonzero((path.present[:-1] & path.present[1:]).T)
    ends = np.stack([first, first + 1], axis=1)
    points = path.points[ends, which[:, None]]
    return points, path.times[ends], which.astype(np.int32)
