"""Pausing of a clip that drives the actor while its pose is edited."""

from __future__ import annotations

from viewer.app.core.state import AppState
from viewer.rig.motion.clip import Clip

__all__ = ["pause_for_edit"]


def pause_for_edit(state: AppState) -> None:
    """Pause a clip that would overwrite the chosen actor's pose in the next frame, with a message.

    Parameters
    ----------
    state : AppState
        Whose chosen actor is about to be posed; nothing happens if no clip drives it.
    """
    clip, clock = state.actor.clip, state.clock
    if clip is None:
        return
    stopped = "Paused: the" if clock.playing else "The"
    clock.playing = False
    kept = "key it (Key) to keep it" if isinstance(clip, Clip) else "it lasts until time moves"
    state.say_status(f"{stopped} clip overwrites this pose as time moves; {kept}")
