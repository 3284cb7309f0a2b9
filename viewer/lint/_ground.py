"""Where the ground is under a body in motion, judged by the levels on which its feet rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from viewer.rig.arrays import Bools, Floats

__all__ = ["Ground", "ground_of"]

Level = tuple[float, int]  # a height, and in how many frames feet rest on it

# Lengths in heights of the figure at rest: 17 mm for a person are 0.01.
_ALIKE = 0.005  # up to which heights are one level: about half of what counts as sunk
_APART = 0.01  # from which a level is another one
_CUSTOM = 0.015  # from where the ground is by custom: captures are calibrated to some 25 mm
_NEAR = 0.03  # the same, of the lowest feet where they rest nowhere
_LONG = 0.1  # seconds that a foot rests at least
_CALM = 0.006  # that it moves up or down meanwhile; at the top of a jump it falls by 12 mm
_MOST = 0.5  # of the frames that are so near where they are on average
_RESTS = 0.2  # of all frames: with fewer at rest a few are alike by chance
_SHARE = 0.1  # of the frames at rest that make a level
_TIE = 0.5  # of the frames on the longest level: from there, what is likely decides
_CLEAR = 1.0 / 3.0  # of the frames on the longest level: with more, another one may be the ground
_ROLLS = 0.02  # from the longest level: a foot that rolls makes others so near
_STEP = 0.06  # below the longest level: the ground may be so deep below a step or a seat


@dataclass(frozen=True, slots=True)
class Ground:
    """Where the ground is, or why that is not known.

    Attributes
    ----------
    height : float or None
        Along what is up.
    levels : tuple of (float, int)
        Heights on which feet rest, the longest first, and in how many frames; without any the
        ground is a guess.
    """

    height: float | None
    levels: tuple[Level, ...] = ()

    @property
    def is_guess(self) -> bool:
        """Whether feet rest nowhere, and are only near the height."""
        return not self.levels


def ground_of(
    lowest: Floats, present: Bools, step: float, size: float, likely: Sequence[float] = (0.0,)
) -> Ground:
    """Return the height on which feet rest, as far as the motion says one clearly.

    It is the one on which they rest longest, or one that is likely and comes near to that. It is
    none if they rest nearly as long on another level, or on a likely one that is a step away; and
    none if they rest on two levels below it, as on stairs that lead down.

    Parameters
    ----------
    lowest : (F,)
        Height of the lower foot's sole in every frame.
    present : (F,)
        Where False, nobody is there.
    step : float
        Seconds from frame to frame.
    size : float
        Height of the figure at rest.
    likely : sequence of float
        Where the ground is by custom, the likeliest first.
    """
    rests = lowest[_resting(lowest, present, step, size)]
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


def _guess(lowest: Floats, size: float, likely: Sequence[float]) -> float | None:
    """Return where the ground may be if feet rest nowhere, as those of noisy captures."""
    if len(lowest) == 0:
        return None
    low, middle = np.quantile(lowest, [0.1, 0.5])
    near = [height for height in likely if abs(low - height) <= _NEAR * size]
    if not near and (np.abs(lowest - middle) <= _NEAR * size).mean() > _MOST:
        near = [float(middle)]
    return next(iter(near), None)


def _level_at(rests: Floats, height: float, size: float) -> list[Level]:
    """Return the level that is nearest to a height, if feet rest near it at all."""
    near = rests[np.abs(rests - height) <= _CUSTOM * size]
    levels = _levels(near, size) if len(near) >= _SHARE * len(rests) else ()
    return sorted(levels, key=lambda level: abs(level[0] - height))[:1]


def _has_rival(levels: Sequence[Level], customs: Sequence[Level], size: float) -> bool:
    """Return whether the ground may be another level than the longest.

    A likely level on which they rest for a short time is none just below it: there, feet have sunk.
    It is one a step below, as of somebody who sits or stands on a box, and one above, as the
    longest may itself be sunk.
    """
    longest, count = levels[0]
    long = [h for h, n in levels[1:] if n > _CLEAR * count and abs(h - longest) > _ROLLS * size]
    steps = [h for h, _ in customs if longest - h > _STEP * size or h - longest > _ROLLS * size]
    return bool(long or steps)


def _resting(lowest: Floats, present: Bools, step: float, size: float) -> Bools:
    """Return where the lower foot goes neither up nor down for some time: (F,)."""
    rests = np.zeros(len(lowest), dtype=np.bool_)
    width = max(1, round(_LONG / step))
    count = len(lowest) - width
    if count < 1:
        return rests
    heights = np.where(present, lowest, np.inf)  # nobody rests who leaves meanwhile
    windows = np.lib.stride_tricks.sliding_window_view(heights, width + 1)
    highest = windows.max(axis=1)
    calm = highest <= windows.min(axis=1) + _CALM * size
    calm &= np.isfinite(highest)
    for first in range(width + 1):
        rests[first : first + count] |= calm
    return rests


def _levels(heights: Floats, size: float) -> tuple[Level, ...]:
    """Return where heights are dense, and how many lie there, the most first."""
    left = np.sort(heights)
    levels: list[Level] = []
    while len(left) and len(left) >= _SHARE * len(heights):
        ends = np.searchsorted(left, left + 2.0 * _ALIKE * size, side="right")
        counts = ends - np.arange(len(left))
        first = int(counts.argmax())
        if counts[first] < _SHARE * len(heights):
            break
        level = float(np.median(left[first : ends[first]]))
        levels.append((level, int(counts[first])))
        left = left[np.abs(left - level) > _APART * size]
    # Of levels of the same share the upper one is first: what is below it has sunk.
    return tuple(sorted(levels, key=lambda level: (-level[1], -level[0])))
