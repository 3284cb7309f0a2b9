"""Trimming of clips to a range of frames."""

from __future__ import annotations

import numpy as np

from viewer.errors import RigError
from viewer.rig.cleanup.frame_rows import Captured, with_rows

__all__ = ["trimmed"]


def trimmed(clip: Captured, first: int, stop: int) -> Captured:
    """Return some frames of a clip, which keep their times and numbers.

    Parameters
    ----------
    clip : SampledClip or PointClip
        Any clip.
    first, stop : int
        First frame and end frame (exclusive), counted from 0.

    Raises
    ------
    RigError
        If the range is empty or exceeds the clip.
    """
    count = clip.timing.n_frames
    if not 0 <= first < stop <= count:
        raise RigError(f"frames: expected a range within 0 to {count}, found {first} to {stop}")
    return with_rows(clip, np.arange(first, stop))
