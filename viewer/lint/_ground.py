"""Where the ground is under a body in motion, judged by the levels on which its feet rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from viewer.rig.arrays import Bools, Floats

__all__ = ["Ground", "ground_of"]

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
_CLEAR = 1.0 / 3.0  # of the frames on the longest level: with more, another one may be the ground
_ROLLS = 0.02  # from the longest level: a foot that rolls makes others so near


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
    levels: tuple[tuple[float, int], ...] = ()

    @property
    def is_guess(self) -> bool:
        """Whether feet rest nowhere, and are only near the height."""
        return not self.levels


def ground_of(
    lowest: Floats, present: Bools, step: float, size: float, likely: Sequence[float] = (0.0,)
) -> Ground:
    """Return the height on which feet rest, as far as the motion says one clearly.

    It is the one that is likely, if they rest there, else the one on which they rest longest, if
    they rest much shorter on others; but none if they rest on two levels below it, as on stairs
    that lead down.

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
    at_likely = (_level_at(rests, height, size) for height in likely)
    ground = next((height for height in at_likely if height is not None), None)
    if ground is None:
        longest, count = levels[0]
        rivals = (n > _CLEAR * count and abs(h - longest) > _ROLLS * size for h, n in levels[1:])
        ground = None if any(rivals) else longest
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


def _level_at(rests: Floats, height: float, size: float) -> float | None:
    """Return the level nearest to a height, None if feet hardly rest there."""
    near = rests[np.abs(rests - height) <= _CUSTOM * size]
    if len(near) < _SHARE * len(rests):
        return None
    return min((level for level, _ in _levels(near, size)), key=lambda level: abs(level - height))


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


def _levels(heights: Floats, size: float) -> tuple[tuple[float, int], ...]:
    """Return where heights are dense, and how many lie there, the most first."""
    left = np.sort(heights)
    levels: list[tuple[float, int]] = []
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
