"""Display options and camera of a recording, for its frames and for the preview."""

from __future__ import annotations

import copy

from viewer.app.actors.following import Following
from viewer.app.core.state import AppState
from viewer.app.recording.state import RecordSettings
from viewer.rendering.options import DisplayOptions
from viewer.rendering.recorder import Follow

__all__ = ["recorded_follow", "recorded_options"]


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
