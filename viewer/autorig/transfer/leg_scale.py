"""Ratio of the leg lengths of two figures, by which paths and heights are scaled.

The root's height above the feet is roughly the leg length, and step length is proportional
to it. If limbs were scaled or the whole figure was stretched, root heights and translations
therefore scale with the legs.
"""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.kinematics import world_matrices
from viewer.rig.pose import rest_pose
from viewer.rig.skeleton import Skeleton

__all__ = ["leg_scale"]

# Maximum distance of feet from the lowest joint, as a fraction of the joints' vertical extent.
_LOW = 0.1
# Minimum distance of the root from the feet of a figure with legs, as a fraction of that extent.
_LEGS = 0.2


def leg_scale(before: Skeleton, after: Skeleton, up: str, otherwise: float) -> float:
    """Return the ratio of the heights of two skeletons' roots above the feet, both at rest.

    Parameters
    ----------
    before, after : Skeleton
        Skeletons with the same joints.
    up : "y" or "z"
        Up axis of both skeletons.
    otherwise : float
        Result if there are no legs, as for hands, heads, or a root on the ground.
    """
    axis = "xyz".index(up)
    heights = _heights(before, axis)
    low, span = heights.min(), np.ptp(heights)
    feet = heights <= low + _LOW * span
    own = heights[0] - heights[feet].mean()
    if own <= _LEGS * span:
        return otherwise
    other = _heights(after, axis)
    found = float((other[0] - other[feet].mean()) / own)
    return found if found > 0.0 else otherwise


def _heights(skeleton: Skeleton, axis: int) -> Floats:
    heights: Floats = world_matrices(skeleton, rest_pose(skeleton))[:, axis, 3]
    return heights
