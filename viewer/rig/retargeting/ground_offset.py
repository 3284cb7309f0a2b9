"""Height of the pelvis above the feet: how far a retargeted body must be raised to stand."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.retargeting.joint_matches import Matches

__all__ = ["ground_offset"]

_FEET = ("left_foot", "right_foot", "left_ankle", "right_ankle")
# Cosine of the maximum angle between the up axis and the legs of a standing person, from the pelvis
# to the feet. The legs of some files, such as those of CMU, are 20 degrees apart in the zero pose.
_UPRIGHT = np.cos(np.radians(40.0))


def ground_offset(
    source: Floats, target: Floats, matches: Matches, up: Floats, scale: float
) -> Floats:
    """Return the offset that moves the target's feet to the feet of the scaled source.

    The path is scaled by the ratio of leg lengths from hip to ankle; the sizes of feet and hips may
    have a different ratio. Without this offset, a body with high ankles sinks into the ground.

    Parameters
    ----------
    source, target : (J', 3), (J, 3)
        Joints of both skeletons in the source's rest pose, in common axes.
    matches : Matches
        Joints of the source for joints of the target.
    up : (3,)
        The up axis.
    scale : float
        Scale of the path.

    Returns
    -------
    (3,)
        Offset along the up axis, in the target's unit; 0 if pelvis or feet are unmatched, or the
        source does not stand in its rest pose.
    """
    place = {
        name: joint for joint, name in enumerate(matches.names) if matches.partners[joint] >= 0
    }
    feet = [place[name] for name in _FEET if name in place]
    if "pelvis" not in place or not feet:
        return 0.0 * up
    pelvis, partners = place["pelvis"], matches.partners
    legs = source[partners[pelvis]] - source[partners[feet]]
    theirs = (legs @ up).max()
    if theirs < _UPRIGHT * np.linalg.norm(legs, axis=1).max():
        return 0.0 * up
    mine = ((target[pelvis] - target[feet]) @ up).max()
    return (mine - scale * theirs) * up
