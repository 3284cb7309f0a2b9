"""Frame rate of keyed transforms, estimated from the times of their keys."""

from __future__ import annotations

import math

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.memo import Memo
from viewer.rig.motion.timing import DEFAULT_RATE
from viewer.rig.motion.transform_clip import TransformClip

# Usual rates, the most likely first: few keys lie on the frames of several.
_RATES = (DEFAULT_RATE, 24.0, 25.0, 60.0, 120.0, 50.0, 100.0, 48.0, 90.0, 240.0)
_BROADCAST = tuple(1000.0 * rate / 1001.0 for rate in (30.0, 24.0, 60.0, 120.0))
_ON_FRAME = 1e-3  # tolerance in frames
_SINGLE = 2.0**-24  # relative rounding error of times, which files store in single precision
_FASTEST = 1000.0  # keys that are closer are at irregular times
_SLOWEST = 24.0  # keys that are further apart have frames between them
_known: Memo[TransformClip, float] = Memo()


def key_rate(clip: TransformClip) -> float:
    """Return the frame rate of a clip's keys.

    Returns the first usual rate at which all keys lie on frames, counted from the start of the
    clip. Otherwise the rate of keys at equal distances, multiplied to at least 24 frames per
    second. ``DEFAULT_RATE`` if the keys are at irregular times.
    """
    return _found(clip) or DEFAULT_RATE


def is_regular(clip: TransformClip) -> bool:
    """Return whether all keys of a clip lie on frames of ``key_rate``."""
    return _found(clip) > 0.0


def _found(clip: TransformClip) -> float:
    """Return the rate of the keys; 0 if they are at irregular times."""
    return _known.get(clip, (), lambda: _estimated(clip))


def _estimated(clip: TransformClip) -> float:
    # Most channels of a file share their times.
    lists = {channel.times.tobytes(): channel.times for channel in clip.channels}
    times = np.unique(np.concatenate([np.array([clip.start]), *lists.values()]))
    rounding = _SINGLE * float(np.abs(times[[0, -1]]).max())
    since = times - clip.start
    if len(since) == 1:
        # A pose that is held for some frames: only the end of the range tells the rate.
        since = np.array([0.0, clip.end - clip.start])
    for rate in (*_RATES, *_BROADCAST):
        if _is_on_frames(since, rate, rounding):
            return rate
    return _equal_distances(since, rounding)


def _is_on_frames(times: Floats, rate: float, rounding: float) -> bool:
    frames = times * rate
    limit = _ON_FRAME + 2.0 * rate * rounding
    return bool((np.abs(frames - np.round(frames)) <= limit).all())


def _equal_distances(times: Floats, rounding: float) -> float:
    """Return a rate at which keys that are a multiple of their smallest distance apart lie."""
    apart = np.diff(times)
    apart = apart[apart > 2.0 * rounding]
    if not len(apart) or 1.0 / apart.min() > _FASTEST:
        return 0.0
    # The whole span has a smaller relative error than one distance.
    span = float(times[-1] - times[0])
    rate = round(span / float(apart.min())) / span
    if not _is_on_frames(times - times[0], rate, rounding):
        return 0.0
    near = round(rate, 2)
    rate = near if _is_on_frames(times - times[0], near, rounding) else rate
    rate *= max(1, math.ceil(_SLOWEST / rate))
    return rate if _is_on_frames(times, rate, rounding) else 0.0
