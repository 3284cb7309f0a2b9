"""Detection of the ground height under a moving body, from the levels on which its feet rest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.feet.soles import extent, soles_of
from viewer.rigs.geometry.transform import mean_scale
from viewer.rigs.motion.evaluation import frames_of, world_frames
from viewer.rigs.motion.timing import frame_times
from viewer.rigs.scene import Actor
from viewer.rigs.shape import shaped

_Level = tuple[float, int]  # a height, and the number of frames in which feet rest at it

# Lengths are relative to the figure's height at rest: 0.01 is 17 mm for a person.
_ALIKE = 0.005  # maximum distance of heights of one level: about half the tolerance for sunk feet
_APART = 0.01  # minimum distance between separate levels
_CUSTOM = 0.015  # maximum distance from a conventional ground: calibrations err by about 25 mm
_NEAR = 0.03  # maximum distance of the lowest feet from a conventional ground if they never rest
_LONG = 0.1  # minimum seconds for which a foot rests
_CALM = 0.006  # maximum vertical motion of a resting foot; at the top of a jump, it is 12 mm
_MOST = 0.5  # minimum fraction of the frames of a rest that are this close to their mean height
_RESTS = 0.2  # minimum fraction of resting frames: with fewer, equal heights may be coincidence
_FRACTION = 0.1  # minimum fraction of the frames at rest for a level
_TIE = 0.5  # fraction of the longest level's frames above which a likely level is chosen
_CLEAR = 1.0 / 3.0  # fraction of the longest level's frames above which another level is a rival
_ROLLS = 0.02  # minimum distance from the longest level, as rolling feet create closer levels

# Maximum distance of the ground below the longest level, which may be a step or a seat.
_STEP = 0.06
_MOST_FRAMES = 4000  # maximum number of evaluated frames
_LOW = 0.02  # quantile of the heights, for feet that never rest


@dataclass(frozen=True, slots=True)
class Ground:
    """Height of the ground, or the reason why it is unknown."""

    height: float | None
    """Along the up axis; None if unknown."""
    levels: tuple[_Level, ...] = ()
    """Heights at which feet rest and their numbers of frames, the most frequent first; if empty,
    the height is only an estimate."""

    @property
    def is_guess(self) -> bool:
        """Whether feet never rest, and the height is only close to their lowest positions."""
        return not self.levels


def ground_under(actor: Actor, up: str, heights: Floats, present: Bools, step: float) -> Ground:
    """Return the ground under an actor whose soles have heights (F, N) in the scene."""
    # Likely are the height of its soles at rest, and the origin.
    figure, row = actor.figure, actor.placement["xyz".index(up)]
    sole, height = extent(figure)
    likely = float(row["xyz".index(figure.up)] * sole + row[3]), 0.0
    size = mean_scale(actor.placement) * height
    return ground_of(heights.min(axis=1), present, step, size, likely)


def ground_of(
    lowest: Floats, present: Bools, step: float, size: float, likely: Sequence[float] = (0.0,)
) -> Ground:
    """Return the height at which feet rest, if it is certain; ``lowest`` (F,): the lower sole's."""
    # The level on which feet rest longest, or a likely level on which they rest nearly as long. It
    # is unknown if another level may be the ground, or if feet rest on two lower levels, as on
    # descending stairs.
    rests = lowest[resting_frames(lowest, present, step, size)]
    levels = _levels(rests, size) if len(rests) > _RESTS * present.sum() else ()
    if not levels:
        return Ground(_guess(lowest[present], size, likely))
    customs = [level for height in likely for level in _level_at(rests, height, size)]
    ground = next((level for level, n in customs if n >= _TIE * levels[0][1]), None)
    if ground is None:
        ground = None if _has_rival(levels, customs, size) else levels[0][0]
    if ground is None or sum(height < ground - _APART * size for height, _ in levels) > 1:
        return Ground(None, levels)
    return Ground(ground, levels)


def resting_height(actor: Actor, up: str) -> tuple[float, bool] | None:
    """Return the scene height at which feet rest, and whether they clearly do; None without feet.

    If they never clearly rest, it is the height of their lowest positions.
    """
    figure, motion = actor.figure, actor.joint_motion
    if figure.skeleton is None or motion is None:
        return None
    rate = motion.frame_rate
    times = frame_times(motion.start, motion.end, rate)[:_MOST_FRAMES]
    frames = frames_of(figure, motion, times, actor.own_pose)
    soles = soles_of(shaped(figure, frames.shape_weights[0]), figure.is_attached)
    if soles is None or not frames.present.any():
        return None
    heights = soles.scene_heights(world_frames(figure, frames), actor.placement, up)
    found = ground_under(actor, up, heights, frames.present, 1.0 / rate)
    if found.height is not None and not found.is_guess:
        return found.height, True
    return float(np.quantile(heights.min(axis=1)[frames.present], _LOW)), False


def _guess(lowest: Floats, size: float, likely: Sequence[float]) -> float | None:
    """Return an estimate of the ground height if feet never rest, as in noisy captures."""
    if len(lowest) == 0:
        return None
    low, middle = np.quantile(lowest, [0.1, 0.5])
    near = [height for height in likely if abs(low - height) <= _NEAR * size]
    if not near and (np.abs(lowest - middle) <= _NEAR * size).mean() > _MOST:
        near = [float(middle)]
    return next(iter(near), None)


def _level_at(rests: Floats, height: float, size: float) -> list[_Level]:
    """Return the level nearest to a height, if feet rest close to it."""
    near = rests[np.abs(rests - height) <= _CUSTOM * size]
    levels = _levels(near, size) if len(near) >= _FRACTION * len(rests) else ()
    return sorted(levels, key=lambda level: abs(level[0] - height))[:1]


def _has_rival(levels: Sequence[_Level], customs: Sequence[_Level], size: float) -> bool:
    """Return whether a level other than the longest may be the ground."""
    # A likely level with few frames just below the longest is no rival: feet have sunk into the
    # ground there. It is one if it is a step below, as for a person who sits or stands on a box, or
    # above, because feet may have sunk into the ground at the longest level.
    longest, count = levels[0]
    long = [h for h, n in levels[1:] if n > _CLEAR * count and abs(h - longest) > _ROLLS * size]
    steps = [h for h, _ in customs if longest - h > _STEP * size or h - longest > _ROLLS * size]
    return bool(long or steps)


def resting_frames(
    lowest: Floats, present: Bools, step: float, size: float, seconds: float = _LONG
) -> Bools:
    """Return a mask (F,) of frames in which the lower foot rests at a constant height."""
    rests = np.zeros(len(lowest), dtype=np.bool_)
    width = max(1, round(seconds / step))
    count = len(lowest) - width
    if count < 1:
        return rests
    heights = np.where(present, lowest, np.inf)  # feet do not rest while the person is absent
    windows = np.lib.stride_tricks.sliding_window_view(heights, width + 1)
    highest = windows.max(axis=1)
    calm = highest <= windows.min(axis=1) + _CALM * size
    calm &= np.isfinite(highest)
    for first in range(width + 1):
        rests[first : first + count] |= calm
    return rests


def _levels(heights: Floats, size: float) -> tuple[_Level, ...]:
    """Return the most frequent heights and their numbers of frames, in decreasing order."""
    left = np.sort(heights)
    levels: list[_Level] = []
    while len(left) and len(left) >= _FRACTION * len(heights):
        ends = np.searchsorted(left, left + 2.0 * _ALIKE * size, side="right")
        counts = ends - np.arange(len(left))
        first = int(counts.argmax())
        if counts[first] < _FRACTION * len(heights):
            break
        level = float(np.median(left[first : ends[first]]))
        levels.append((level, int(counts[first])))
        left = left[np.abs(left - level) > _APART * size]
    # Of levels with the same number of frames, the upper one is first: at the lower one, feet have
    # sunk into the ground.
    return tuple(sorted(levels, key=lambda level: (-level[1], -level[0])))
