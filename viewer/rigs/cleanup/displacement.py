"""Displacement of joints between two versions of a motion."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.rigs.captures.points import PointClip
from viewer.rigs.figure import Figure
from viewer.rigs.motion.evaluation import frames_of, world_frames
from viewer.rigs.motion.sampled_clip import SampledClip

_TOGETHER = 1000  # frames per batch, which limits the memory for matrices


@dataclass(frozen=True, slots=True)
class Displacement:
    """Distances between the joints of two motions in their common frames."""

    mean: float = 0.0
    largest: float = 0.0
    """Mean and maximum distance over all joints and frames, figure units."""
    joint: int = 0
    frame: int = 0
    """Location of the largest distance; frames are numbered as in the first motion."""
    n_frames: int = 0
    """Number of compared frames."""


def joint_displacement(figure: Figure, before: SampledClip, after: SampledClip) -> Displacement:
    """Return how far joints move, at the times of the first motion's frames."""
    timing = before.timing
    times = timing.start + np.arange(timing.n_frames) / timing.frame_rate
    inside = (times >= after.start - 1e-9) & (times <= after.end + 1e-9)
    frames = np.flatnonzero(timing.present & inside)
    total, count, worst = 0.0, 0, Displacement()
    for first in range(0, len(frames), _TOGETHER):
        chosen = frames[first : first + _TOGETHER]
        both = [frames_of(figure, clip, times[chosen]) for clip in (before, after)]
        places = [world_frames(figure, found)[..., :3, 3] for found in both]
        distances = np.linalg.norm(places[1] - places[0], axis=-1)[both[1].present]
        chosen = chosen[both[1].present]
        if not distances.size:
            continue
        total, count = total + float(distances.sum()), count + len(distances)
        row, joint = np.unravel_index(distances.argmax(), distances.shape)
        if distances[row, joint] >= worst.largest:
            number = int(chosen[row]) + timing.first_frame
            worst = Displacement(0.0, float(distances[row, joint]), int(joint), number)
    n_joints = before.n_joints
    mean = total / (count * n_joints) if count else 0.0
    return Displacement(mean, worst.largest, worst.joint, worst.frame, count)


def point_displacement(before: PointClip, after: PointClip) -> Displacement:
    """Return how far points move in the frames of the first motion in which both are visible."""
    timing = before.timing
    times = timing.start + np.arange(timing.n_frames) / timing.frame_rate
    inside = (times >= after.start - 1e-9) & (times <= after.end + 1e-9)
    rows, _, fraction = after.timing.locate(times)
    frames = np.flatnonzero(timing.present & inside & (rows >= 0) & (fraction == 0.0))
    old, new = before.points[timing.rows[frames]], after.points[rows[frames]]
    seen = (old[..., 3] > 0.0) & (new[..., 3] > 0.0)
    if not seen.any():
        return Displacement()
    distances = np.where(seen, np.linalg.norm(new[..., :3] - old[..., :3], axis=-1), 0.0)
    row, point = np.unravel_index(distances.argmax(), distances.shape)
    number = int(frames[row]) + timing.first_frame
    mean = float(distances.sum() / seen.sum())
    return Displacement(mean, float(distances.max()), int(point), number, len(frames))
