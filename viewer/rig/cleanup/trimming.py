"""Trimming of clips to a range of frames."""

from __future__ import annotations

import numpy as np

from viewer.errors import RigError
from viewer.rig.cleanup.frame_rows import Captured, with_rows

__all__ = ["trimmed"]


def trimmed(clip: Captured, first: int | None = None, stop: int | None = None) -> Captured:
    """Return a range of frames of a clip, with unchanged times and numbers.

    Parameters
    ----------
    clip : SampledClip or PointClip
        Any clip.
    first, stop : int, optional
        First frame and end frame (exclusive), in the numbering of the file; the ends of the clip if
        omitted.

    Raises
    ------
    RigError
        If the range is empty or exceeds the clip.
    """
    low = clip.timing.first_frame
    high = low + clip.timing.n_frames
    start, end = low if first is None else first, high if stop is None else stop
    if not low <= start < end <= high:
        asked = ":".join("" if number is None else str(number) for number in (first, stop))
        raise RigError(
            f"frames to keep: expected a range within {low}:{high} (frames {low} to {high - 1}), "
            f"found {asked}"
        )
    return with_rows(clip, np.arange(start - low, end - low))
