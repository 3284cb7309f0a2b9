"""Target of a camera that follows an actor."""

from __future__ import annotations

import numpy as np

from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.scene import Actor
from viewer.rigs.skinning import joint_matrices


def followed_point(actor: Actor, joint: int = -1) -> Floats | None:
    """Return a joint's scene position (3,), or all joints' or points' mean; None while absent."""
    if not actor.is_present:
        return None
    if actor.points is not None:
        seen = actor.points[:, 3] > 0.0
        chosen = seen & (np.arange(len(seen)) == joint) if joint >= 0 else seen
        points = actor.points[chosen, :3]
    elif actor.own_pose is not None and actor.figure.skeleton is not None:
        joints = joint_matrices(actor.figure, actor.own_pose)[:, :3, 3]
        points = joints[[joint]] if 0 <= joint < len(joints) else joints
    else:
        return None
    return apply_transform(actor.placement, points).mean(axis=0) if len(points) else None
