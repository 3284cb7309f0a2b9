"""Distinct colours of body parts."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats

__all__ = ["part_colors"]

# Okabe and Ito 2008, "Color Universal Design": distinguishable for colour-blind people; sRGB.
_DISTINCT = np.array(
    [
        [153, 153, 153],
        [86, 180, 233],
        [230, 159, 0],
        [0, 158, 115],
        [240, 228, 66],
        [0, 114, 178],
        [213, 94, 0],
        [204, 121, 167],
    ]
)
_DARKER = 0.55  # factor of the brightness for each repetition of the list


def part_colors(count: int) -> Floats:
    """Return a colour for each of ``count`` parts: (count, 3), linear.

    >>> part_colors(3).shape
    (3, 3)
    """
    numbers = np.arange(count)
    linear = (_DISTINCT / 255.0) ** 2.2
    return linear[numbers % len(linear)] * _DARKER ** (numbers // len(linear))[:, None]
