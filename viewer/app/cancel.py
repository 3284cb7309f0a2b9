"""Action of the Esc key: close or cancel the topmost item."""

from __future__ import annotations

from viewer.app.closing import Closing, keep_open, question_of
from viewer.app.core.state import AppState
from viewer.app.files.state import Files
from viewer.app.keys import Keyboard
from viewer.app.linting.state import Linting
from viewer.app.manual import Manual
from viewer.app.posing.tool_actions import cancel_drag
from viewer.app.preferences.preferences_window import close_preferences
from viewer.app.preferences.state import Appearance
from viewer.app.recording.state import RecordingState
from viewer.app.rigging.tools import drop_rig_tool
from viewer.app.weights.actions import unpin
from viewer.app.weights.state import Weights

__all__ = ["cancel"]


def cancel(state: AppState) -> None:
    """Close the topmost message, dialog or key list; otherwise clear the selection."""
    files = state.of(Files)
    recording = state.of(RecordingState)
    keyboard = state.of(Keyboard)
    linting = state.of(Linting)
    manual = state.of(Manual)
    if cancel_drag(state):
        return
    if state.error:
        state.error = ""
    elif files.dialog is not None:
        files.dialog = None
    elif question_of(state) is not None:
        keep_open(state)
    elif state.messages.is_open:
        state.messages.is_open = False
    elif state.of(Appearance).is_open:
        close_preferences(state)
    elif manual.topic:
        manual.topic = ""
    elif files.loader is not None:
        files.loader.cancel()
        files.loader = None
        state.say_status("Opening cancelled")
    elif state.job is not None and not state.job.is_cancelled:
        state.job.cancel()
        state.of(Closing).withdraw()
        state.say_status("Cancelled")
    elif recording.settings is not None:
        recording.settings = None
    elif files.stream is not None:
        files.stream.cancel()
        files.stream = None
        state.say_status("Reading cancelled; the frames read so far are kept")
    elif keyboard.is_listed:
        keyboard.is_listed = False
    elif drop_rig_tool(state):
        state.say_status("Template tool off")
    elif linting.chosen >= 0:
        linting.chosen = -1
    elif state.of(Weights).pinned is not None:
        unpin(state)
        state.say_status("Vertex unpinned")
    else:
        state.deselect()
