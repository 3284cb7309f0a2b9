"""State of recording: settings of the Record window, and the requested file."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np

from viewer.app.actors.following import Following
from viewer.app.core.state import AppState
from viewer.data_classes import dataclass
from viewer.media.video_kinds import MOST_GIF_RATE
from viewer.rendering.options import DisplayOptions
from viewer.rendering.recorder import Follow
from viewer.rig.arrays import Floats
from viewer.rig.motion.timing import frame_at, frame_times

KINDS = {
    ".mp4": "MP4 video (H.264)",
    ".webm": "WebM video (VP9)",
    ".gif": "Animated GIF",
    "pictures": "Numbered pictures (PNG)",
    "sheet": "Contact sheet (PNG)",
}
"""Kinds of recordings, with their labels."""
VIDEO_KINDS = (".mp4", ".webm", ".gif")
"""Kinds that are a video file, by its suffix."""
LEAST_PIXELS = 16
"""Minimum width and height of a recording."""


@dataclass(slots=True)
class RecordSettings:
    """Settings of a recording.

    Attributes
    ----------
    kind : str
        A key of ``KINDS``.
    size : str
        A key of the available sizes.
    own_size : (int, int)
        Width and height for the size ``"own"``.
    rate : float
        Frames per second; 0 for the scene's own rate.
    turntable : bool
        Whether the camera orbits once around the scene.
    seconds : float
        Duration of the orbit if there is no motion.
    n_cells : int
        Number of frames in a contact sheet.
    quality : int
        Quality of the compression of videos, 0 to 100.
    look : str
        Quality of the images, a key of ``viewer.rendering.options.QUALITIES``; empty for that of
        the view, or normal if the view is final and there are several frames.
    samples : int
        Samples per pixel; 0 for those of the view.
    background : str
        As in ``DisplayOptions``; empty for the background of the view.
    follows : bool
        Whether the camera follows the same actor or joint as in the view.
    frames : (int, int) or None
        First and last frame, numbered as in the timeline; None for the playback range.
    """

    kind: str = ".mp4"
    size: str = "view"
    own_size: tuple[int, int] = (1280, 720)
    rate: float = 0.0
    turntable: bool = False
    seconds: float = 6.0
    n_cells: int = 12
    quality: int = 75
    look: str = ""
    samples: int = 0
    background: str = ""
    follows: bool = True
    frames: tuple[int, int] | None = None

    @property
    def is_transparent(self) -> bool:
        """Whether the background is transparent and the file format supports transparency."""
        return self.background == "transparent" and self.kind != ".mp4"

    def pixels(self, view: tuple[float, float]) -> tuple[int, int]:
        """Return the width and height of the recording for a given size of the view."""
        if self.size == "view":
            wide, high = (max(round(side), LEAST_PIXELS) for side in view)
            # Videos need even sizes; losing a row of the view does not matter.
            return wide - wide % 2, high - high % 2
        if self.size == "own":
            return self.own_size
        width, _, height = self.size.partition("x")
        return int(width), int(height)


@dataclass(slots=True)
class RecordingState:
    """State of the Record window.

    Attributes
    ----------
    settings : RecordSettings or None
        Settings shown in the window; None while it is closed.
    wanted : Path or None
        Target file of a recording that starts after the frame.
    preview : int
        ID of the preview's texture; 0 if there is none.
    """

    settings: RecordSettings | None = None
    wanted: Path | None = None
    preview: int = 0


def recorded_options(state: AppState, settings: RecordSettings, n_frames: int) -> DisplayOptions:
    """Return the display options of a recording.

    Parameters
    ----------
    state : AppState
        State with the options of the view, which are copied.
    settings : RecordSettings
        Settings of the recording.
    n_frames : int
        Number of frames; several frames are not drawn in final quality unless it is chosen.
    """
    options = copy.deepcopy(state.options)
    if settings.look:
        options.quality = settings.look
    elif options.quality == "final" and n_frames > 1:
        options.quality = "normal"
    options.samples = settings.samples or options.samples
    if settings.background:
        options.background = settings.background
    if options.background == "transparent" and settings.kind == ".mp4":
        options.background = "gradient"
    return options


def recorded_follow(state: AppState, settings: RecordSettings) -> Follow | None:
    """Return the actor or joint that a recording's camera follows; None if it does not move."""
    following = state.of(Following)
    if not settings.follows or following.target is None or following.place is None:
        return None
    return Follow(*following.target, following.place)


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
