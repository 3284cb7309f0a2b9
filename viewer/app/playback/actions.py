"""Actions that move time, and the range that is played."""

from __future__ import annotations

from viewer.app.core.reasons import no_motion
from viewer.app.core.state import AppState
from viewer.rig.number_text import number_text

__all__ = ["go_to_end", "play", "range_in", "range_out", "step"]


def play(state: AppState) -> None:
    """Play or pause."""
    if not state.playback.has_motion:
        state.say_status(no_motion(state))
        return
    state.playback.toggle()
    state.say_status("Playing" if state.playback.playing else "Paused")


def step(state: AppState, frames: int) -> None:
    """Go some frames on, or back."""
    if state.playback.has_motion:
        state.playback.step(frames)


def go_to_end(state: AppState, last: bool) -> None:
    """Go to the first or last frame of the range that is played."""
    playback = state.playback
    if playback.has_motion:
        playback.seek(playback.end if last else playback.start)


def range_in(state: AppState) -> None:
    """Let the range that is played start at the present time."""
    playback = state.playback
    if playback.has_motion:
        playback.set_range(playback.time, max(playback.end, playback.time))
        state.say_status(f"The range starts at {number_text(playback.start, '.3f')} s")


def range_out(state: AppState) -> None:
    """Let the range that is played end at the present time."""
    playback = state.playback
    if playback.has_motion:
        playback.set_range(min(playback.start, playback.time), playback.time)
        state.say_status(f"The range ends at {number_text(playback.end, '.3f')} s")
