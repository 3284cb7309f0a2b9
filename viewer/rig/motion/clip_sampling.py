"""Values of keyed curves at given times, and the resulting poses."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.motion.clip import Channel, Clip
from viewer.rig.motion.clip_table import evaluate_all, evaluate_channels
from viewer.rig.pose import Pose
from viewer.rig.skeleton import Skeleton, clamp_dofs

__all__ = ["evaluate", "sample"]


def evaluate(channel: Channel, times: Floats) -> Floats:
    """Return a curve's values: cubic Hermite between the keys, extrapolated outside.

    With u in 0..1 across a span of h seconds, v0 = h out0 and v1 = h in1, the value is
    ((a u + b) u + v0) u + p0, a = 2 p0 - 2 p1 + v0 + v1, b = -3 p0 + 3 p1 - 2 v0 - v1
    (CSE169 course notes). At a key it is exactly the key's value.

    Parameters
    ----------
    channel : Channel
        The curve; without keys it is 0 everywhere.
    times : (...)
        Seconds.

    Returns
    -------
    (...)
        Lengths or radians.
    """
    times = np.asarray(times, dtype=np.float64)
    return evaluate_channels((channel,), times.ravel())[:, 0].reshape(times.shape)


def sample(clip: Clip, skeleton: Skeleton, time: float, out: Pose) -> None:
    """Set a pose's DOFs to a clip's values at one time, clamped to their limits.

    Parameters
    ----------
    clip : Clip
        The motion.
    skeleton : Skeleton
        Provides the limits; the clip must fit the skeleton, see ``check_fit``.
    time : float
        Seconds; before ``start`` and after ``end`` the curves extrapolate.
    out : Pose
        Modified in place.
    """
    targets, values = evaluate_all(clip, np.array([time]))
    out.dofs[targets] = values[0]
    out.dofs[:] = clamp_dofs(skeleton, out.dofs)
