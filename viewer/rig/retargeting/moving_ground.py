"""Speed of the ground below motions in place, as on a treadmill or with the travel removed.

Standing feet then move at a constant velocity while the body stays in place. Contacts are found in
the axes of the moving ground.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from viewer.rig.arrays import Floats, Ints
from viewer.rig.retargeting.source_contacts import FootPath

__all__ = ["ground_velocity", "on_moving_ground"]

# Lengths and speeds are relative to the size of the body, about its height: 0.1 is 0.17 m.
_SAME = 0.08  # tolerance for the speed of standing feet, per second
_SLOWEST = 0.2  # minimum speed of the ground, per second
_DRIFT = 0.25  # maximum speed of the body relative to the speed of the ground
_USUAL = 0.4  # minimum fraction of the rows in which the lowest foot has the ground's velocity
# Minimum ratio of the number of these rows to the number of rows with a resting foot.
_OFTENER = 3.0
_WINDOW = 0.1  # seconds over which velocities are averaged
_MOST = 500  # maximum number of candidates


def ground_velocity(
    feet: Sequence[FootPath], spans: Sequence[tuple[int, int]], rate: float, size: float, up: Floats
) -> Floats | None:
    """Return the velocity of the ground, (3,) per second; None if it does not move.

    The parameters are those of ``foot_contacts``.
    """
    speeds, body = _speeds(feet, spans, rate, up)
    if not len(speeds):
        return None
    near = _SAME * size
    candidates = speeds[:: -(-len(speeds) // _MOST)]
    counts = [int((np.linalg.norm(speeds - each, axis=1) < near).sum()) for each in candidates]
    best = candidates[int(np.argmax(counts))]
    is_alike = np.linalg.norm(speeds - best, axis=1) < near
    velocity: Floats = np.median(speeds[is_alike], axis=0)
    n_resting = int((np.linalg.norm(speeds, axis=1) < near).sum())
    speed, drift = np.linalg.norm(velocity), np.linalg.norm(body.mean(axis=0))
    is_moving = speed > _SLOWEST * size and drift < _DRIFT * speed
    is_usual = is_alike.mean() > _USUAL and is_alike.sum() > _OFTENER * n_resting
    return velocity if is_moving and is_usual else None


def _speeds(
    feet: Sequence[FootPath], spans: Sequence[tuple[int, int]], rate: float, up: Floats
) -> tuple[Floats, Floats]:
    """Return the horizontal velocities of the lowest foot and of the hips, (M, 3) per second."""
    half = max(1, round(0.5 * _WINDOW * rate))
    lowest = np.array([foot.lowest(up) for foot in feet]).argmin(axis=0)
    found, body = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for first, last in spans:
        rows = np.arange(first + half, last - half, dtype=np.int32)
        own = np.zeros((len(rows), 3))
        for number, foot in enumerate(feet):
            is_toe = (foot.toe @ up <= foot.heel @ up)[rows, None]
            moved = np.where(is_toe, *(_velocities(p, rows, half) for p in (foot.toe, foot.heel)))
            own = np.where((lowest[rows] == number)[:, None], moved, own)
        found.append(own)
        body.append(np.mean([_velocities(foot.hip, rows, half) for foot in feet], axis=0))
    flat = np.eye(3) - np.outer(up, up)
    return rate * np.concatenate(found) @ flat, rate * np.concatenate(body) @ flat


def _velocities(path: Floats, rows: Ints, half: int) -> Floats:
    """Return the displacement per row around each row."""
    return (path[rows + half] - path[rows - half]) / (2.0 * half)


def on_moving_ground(feet: Sequence[FootPath], travel: Floats) -> list[FootPath]:
    """Return the paths of the feet relative to the ground, moved by ``travel`` (N, 3)."""
    result = []
    for foot in feet:
        toe = foot.toe + travel
        heel = toe if foot.heel is foot.toe else foot.heel + travel
        result.append(FootPath(toe, heel, foot.hip + travel))
    return result
