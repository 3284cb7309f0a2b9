"""Detection of the frames in which a joint of a foot is on the ground, by its height and speed."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Bools, Floats
from viewer.rig.cleanup.frames import runs_of
from viewer.rig.feet.contacts import mean_speeds

# Heights and speeds are relative to the figure's height at rest: 0.02 is 34 mm for a person.
_LOW, _HIGH = 0.02, 0.035  # heights above the lowest positions at which a contact begins and ends
_SLOW, _FAST = 0.3, 0.5  # speeds per second at which a contact begins and ends
_LOWEST = 0.05  # fraction of the frames that are below the ground level
_SHORTEST = 0.1  # minimum duration of a contact, seconds


def contacts(positions: Floats, present: Bools, rate: float, size: float, up: int) -> Bools:
    """Return the frames in which a joint is on the ground: low and slow, with hysteresis.

    ``positions``: (F, 3), positions of the joint. ``present``: (F,), frames that have positions.
    ``rate``: frames per second. Returns (F,), contacts of at least 0.1 seconds.
    """
    result = np.zeros(len(positions), dtype=np.bool_)
    if not present.any():
        return result
    heights = positions[:, up] - np.quantile(positions[present, up], _LOWEST)
    flat = [axis for axis in range(3) if axis != up]
    for start, stop in runs_of(present):
        speeds = mean_speeds(positions[start:stop][:, flat], rate)
        above = heights[start:stop]
        begins = (above < _LOW * size) & (speeds < _SLOW * size)
        lasts = (above < _HIGH * size) & (speeds < _FAST * size)
        for first, last in runs_of(lasts):
            is_long = last - first >= max(2, round(_SHORTEST * rate))
            if is_long and begins[first:last].any():
                result[start + first : start + last] = True
    return result
