"""Start of a recording that was requested in the Record window."""

from __future__ import annotations

from dataclasses import replace

from viewer.app.core.jobs import FrameJob
from viewer.app.core.state import AppState
from viewer.app.recording.state import Recording
from viewer.phrases import printable
from viewer.rendering.renderer import Renderer

__all__ = ["start_recording"]


def start_recording(state: AppState, renderer: Renderer) -> None:
    """Start a requested recording unless another job is running.

    Parameters
    ----------
    state : AppState
        Holds the request, and receives the job.
    renderer : Renderer
        Renderer of the view, whose programs and marks are used.
    """
    recording = state.of(Recording)
    path, settings, recording.wanted = recording.wanted, recording.settings, None
    if path is None or settings is None or state.job is not None:
        return
    from viewer.app.recording.recording_steps import recording_steps

    steps = recording_steps(state, renderer.programs, replace(settings), path, renderer.ghost)
    state.job = FrameJob(f"Recording {printable(path.name, 60)}", steps, "recording")
    state.clock.playing, recording.settings = False, None
