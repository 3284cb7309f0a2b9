"""Captured points at a fixed rate: one person's frames, ready for export."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.captures.points import PointLayout
from viewer.rigs.geometry.vectors import Up
from viewer.rigs.motion.sampled_animation import frame_range
from viewer.rigs.motion.upright import own_up
from viewer.rigs.scene import Actor, Scene


@dataclass(frozen=True, slots=True, eq=False)
class SampledPoints:
    """Captured points at a fixed rate."""

    name: str
    """Name of the actor."""
    layout: PointLayout
    """Names and limbs of the K points."""
    frame_rate: float
    """Frames per second."""
    first_frame: int
    """Number of the first frame."""
    times: Floats
    """(F,). Seconds."""
    present: Bools
    """(F,) bool. Whether the person is present."""
    points: Floats
    """(F, K, 3). In the unit of the capture; NaN where a point is not visible."""
    confidences: Floats
    """(F, K). 0 where a point is not visible."""


def sample_upright_points(
    scene: Scene,
    actor: Actor,
    rate: float | None = None,
    frames: tuple[int, int | None] | None = None,
    interpolate: bool = False,
) -> tuple[SampledPoints, Up]:
    """Return an actor's sampled points, rotated upright if upside down, and their up axis."""
    motion, layout = actor.clip, actor.figure.points
    if motion is None or motion.points is None or layout is None:
        raise RigError(f"{actor.name} has no motion of points")
    own = motion.timing.frame_rate
    rate = own if rate is None else rate
    first, stop = frame_range(motion, rate, frames)
    times: Floats = motion.start + np.arange(first, stop) / rate
    found = motion.sample(None, times, interpolate)
    assert found.points is not None  # it is a motion of points
    rows = np.where(found.present[:, None, None], found.points, 0.0)
    up, hangs = own_up(scene, actor)
    places, confidences = rows[..., :3], rows[..., 3]
    if hangs:
        places = places * np.array([1.0, -1.0, -1.0])
    places = np.where(confidences[..., None] > 0.0, places, np.nan)
    start = first + (motion.timing.first_frame if rate == own else 0)
    return SampledPoints(
        actor.name, layout, rate, start, times, found.present, places, confidences
    ), up
