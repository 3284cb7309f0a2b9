"""Pausing of the clip that drives an actor, when its pose is edited."""

from __future__ import annotations

from viewer.app.core.state import AppState
from viewer.rig.motion.clip import Clip
from viewer.rig.motion.transform_clip import TransformClip

__all__ = ["pause_for_edit"]


def pause_for_edit(state: AppState) -> None:
    """Pause a clip that would overwrite the chosen actor's pose in the next frame; show a message.

    Parameters
    ----------
    state : AppState
        State with the chosen actor, which is about to be posed; unchanged if no clip drives it.
    """
    clip, clock = state.actor.clip, state.clock
    if clip is None:
        return
    stopped = "Paused: the" if clock.playing else "The"
    clock.playing = False
    kept = (
        "press Key to keep it"
        if isinstance(clip, Clip | TransformClip)
        else "sampled motions cannot be keyed"
    )
    state.say_status(f"{stopped} clip overwrites this pose when the time changes; {kept}")
