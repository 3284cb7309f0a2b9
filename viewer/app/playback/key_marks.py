"""Times of keys, marked on the tracks of the timeline."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.memo import Memo
from viewer.rig.motion.clip import Clip
from viewer.rig.motion.transform_clip import TransformChannel, TransformClip
from viewer.rig.scene import Actor

__all__ = ["key_times"]

_times: Memo[Clip | TransformClip, Floats] = Memo(kept=4)


def key_times(actor: Actor, joint: int) -> Floats:
    """Return the times of an actor's keys.

    Parameters
    ----------
    actor : Actor
        An actor with any motion; a sampled motion has no keys.
    joint : int
        Joint whose keys are returned; -1 for the keys of all channels.

    Returns
    -------
    (N,)
        Scene times in seconds, increasing.
    """
    clip, skeleton = actor.clip, actor.figure.skeleton
    if skeleton is None or not isinstance(clip, Clip | TransformClip):
        return np.zeros(0)
    dof_joints = skeleton.dof_joints

    def found() -> Floats:
        # Most channels of a file share their times.
        lists = {}
        for channel in clip.channels:
            if isinstance(channel, TransformChannel):
                own = channel.joint
            else:
                own = int(dof_joints[channel.target])
            if joint < 0 or own == joint:
                lists[channel.times.tobytes()] = channel.times
        return np.unique(np.concatenate([np.zeros(0), *lists.values()]))

    return _times.get(clip, joint, found) + actor.offset
