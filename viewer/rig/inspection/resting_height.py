"""Height at which the feet of a moving actor rest, in the scene."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.inspection.ground_height import ground_of
from viewer.rig.inspection.soles import extent, soles_of
from viewer.rig.motion.evaluation import JointMotion, frame_rate, frames_of, world_frames
from viewer.rig.motion.timing import frame_times
from viewer.rig.scene import Actor
from viewer.rig.shape import shaped

__all__ = ["RestingHeight", "resting_height"]

_MOST = 4000  # maximum number of evaluated frames
_LOW = 0.02  # quantile of the heights, for feet that never rest


@dataclass(frozen=True, slots=True)
class RestingHeight:
    """Height of the ground under an actor.

    Attributes
    ----------
    height : float
        Along the scene's up axis, scene units.
    is_clear : bool
        Whether feet rest at this height; otherwise it is the height of the lowest positions.
    """

    height: float
    is_clear: bool


def resting_height(actor: Actor, up: str) -> RestingHeight | None:
    """Return the height at which an actor's feet rest; None unless two feet are found by name.

    Parameters
    ----------
    actor : Actor
        Placed actor with a motion of joints.
    up : "y" or "z"
        Up axis of the scene.
    """
    figure, motion = actor.figure, actor.clip
    if figure.skeleton is None or not isinstance(motion, JointMotion):
        return None
    rate = frame_rate(motion)
    times = frame_times(motion.start, motion.end, rate)[:_MOST]
    frames = frames_of(figure, motion, times, actor.pose)
    soles = soles_of(shaped(figure, frames.shape_weights[0]), figure.is_attached)
    if soles is None or not frames.present.any():
        return None
    scale = float(np.cbrt(abs(np.linalg.det(actor.placement[:3, :3]))))
    axis = actor.placement[2 if up == "z" else 1]
    heights = soles.heights(world_frames(figure, frames), axis, scale).min(axis=1)
    found = ground_of(heights, frames.present, 1.0 / rate, scale * extent(figure)[1])
    if found.height is not None and not found.is_guess:
        return RestingHeight(found.height, True)
    return RestingHeight(float(np.quantile(heights[frames.present], _LOW)), False)
