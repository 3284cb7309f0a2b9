"""Actions on time and the playback range."""

from __future__ import annotations

from viewer.app.core.reasons import no_motion
from viewer.app.core.state import AppState
from viewer.rig.number_text import number_text

__all__ = ["go_to_end", "play", "range_in", "range_out", "step"]


def play(state: AppState) -> None:
    """Play or pause."""
    if not state.clock.has_motion:
        state.say_status(no_motion(state))
        return
    state.clock.toggle()
    state.say_status("Playing" if state.clock.playing else "Paused")


def step(state: AppState, frames: int) -> None:
    """Step by some frames, forwards or backwards."""
    if state.clock.has_motion:
        state.clock.step(frames)


def go_to_end(state: AppState, last: bool) -> None:
    """Go to the first or last frame of the playback range."""
    clock = state.clock
    if clock.has_motion:
        clock.seek(clock.end if last else clock.start)


def range_in(state: AppState) -> None:
    """Start the playback range at the current time."""
    clock = state.clock
    if clock.has_motion:
        clock.set_range(clock.time, max(clock.end, clock.time))
        state.say_status(f"The range starts at {number_text(clock.start, '.3f')} s")


def range_out(state: AppState) -> None:
    """End the playback range at the current time."""
    clock = state.clock
    if clock.has_motion:
        clock.set_range(min(clock.start, clock.time), clock.time)
        state.say_status(f"The range ends at {number_text(clock.end, '.3f')} s")
