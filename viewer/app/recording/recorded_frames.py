"""Times and numbers of the frames of a recording."""

from __future__ import annotations

import numpy as np

from viewer.app.core.state import AppState
from viewer.app.recording.state import RecordSettings
from viewer.media.video_kinds import MOST_GIF_RATE
from viewer.rig.arrays import Floats
from viewer.rig.motion.timing import frame_at, frame_times

__all__ = ["playback_frames", "recorded_times"]


def playback_frames(state: AppState) -> tuple[int, int]:
    """Return the first and the last frame that are recorded, numbered as in the timeline."""
    clock = state.clock
    first = clock.first_frame + frame_at(clock.start - clock.origin, clock.frame_rate)
    return first, first + frame_at(clock.end - clock.start, clock.frame_rate)


def recorded_times(state: AppState, settings: RecordSettings) -> tuple[Floats, list[int], float]:
    """Return the times of all frames in seconds, their numbers, and the frame rate."""
    clock = state.clock
    rate = settings.rate or clock.frame_rate
    if settings.kind == ".gif":
        rate = min(rate, MOST_GIF_RATE)
    if not clock.has_motion:
        count = max(round(settings.seconds * rate), 1) if settings.turntable else 1
        if settings.kind == "sheet":
            count = settings.n_cells if settings.turntable else 1
        return np.zeros(count), list(range(count)), rate
    start, end = clock.start, clock.end
    if settings.frames is not None:
        start, end = (clock.frame_time(n - clock.first_frame) for n in settings.frames)
    times = frame_times(start, end, rate)
    first = clock.first_frame if rate == clock.frame_rate else 0
    first += frame_at(start - clock.origin, rate)
    if settings.kind == "sheet":
        last = len(times) - 1
        chosen = np.unique(np.rint(np.linspace(0, last, settings.n_cells)).astype(int))
        return times[chosen], (first + chosen).tolist(), rate
    return times, list(range(first, first + len(times))), rate
