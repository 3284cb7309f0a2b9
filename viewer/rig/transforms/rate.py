"""Frame rate of keyed transforms, estimated from the times of their keys."""

from __future__ import annotations

import numpy as np

from viewer.rig.memo import Memo
from viewer.rig.motion.timing import DEFAULT_RATE
from viewer.rig.motion.transform_clip import TransformClip

__all__ = ["key_rate"]

_RATES = (DEFAULT_RATE, 24.0, 25.0, 60.0)
_ON_FRAME = 1e-3  # tolerance in frames, because files store seconds in single precision

_known: Memo[TransformClip, float] = Memo()


def key_rate(clip: TransformClip) -> float:
    """Return the frame rate of a clip's keys.

    Parameters
    ----------
    clip : TransformClip
        A clip whose keys may begin at any time.

    Returns
    -------
    float
        The first of 30, 24, 25 and 60 at which all keys lie on frames, counted from time 0;
        ``DEFAULT_RATE`` if there is no such rate.
    """
    return _known.get(clip, (), lambda: _estimated(clip))


def _estimated(clip: TransformClip) -> float:
    # Most channels of a file share their times.
    lists = {channel.times.tobytes(): channel.times for channel in clip.channels}
    times = np.unique(np.concatenate([np.zeros(0), *lists.values()]))
    for rate in _RATES:
        frames = times * rate
        if (np.abs(frames - np.round(frames)) <= _ON_FRAME).all():
            return rate
    return DEFAULT_RATE
