"""Frame rate of the chosen actor's capture, or the rate at which keyed clips are counted."""

from __future__ import annotations

import math

from viewer.app.core.state import AppState
from viewer.rig.captures.points import PointClip
from viewer.rig.motion.retimed import with_rate
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.scene import Actor

__all__ = ["LIMITS", "foreign_rate", "rate_of", "set_rate"]

LIMITS = (0.01, 1000.0)
"""Lowest and highest rate that can be set, frames per second."""


def rate_of(state: AppState) -> float:
    """Return the frame rate of the chosen actor's motion, frames per second."""
    clip = state.actor.clip
    if isinstance(clip, SampledClip | PointClip):
        return clip.timing.frame_rate
    return state.clock.frame_rate


def foreign_rate(state: AppState) -> str:
    """Return the reason why the actor's rate cannot be set: another actor defines the frames."""
    clock = state.clock
    if not clock.has_frames or isinstance(state.actor.clip, SampledClip | PointClip):
        return ""
    return "the frames belong to another motion: select its actor"


def set_rate(state: AppState, rate: float) -> None:
    """Set the frame rate of the chosen actor and of all people of its capture.

    Keyed clips have no frames: only the rate for stepping and frame numbers is set for them.

    Parameters
    ----------
    state : AppState
        State with the actors; their clips are replaced, so that the edit can be undone.
    rate : float
        Frames per second; a rate outside ``LIMITS`` is rejected with a message.
    """
    if foreign_rate(state) or rate == rate_of(state):
        return
    if not (math.isfinite(rate) and LIMITS[0] <= rate <= LIMITS[1]):
        low, high = LIMITS
        state.say(f"frames per second: expected {low:g} to {high:g}, found {rate:g}")
        return
    clip = state.actor.clip
    if not isinstance(clip, SampledClip | PointClip):
        state.clock.count_by(rate)
        state.say_status(f"Frames of keyed clips are numbered at {rate:g} frames per second")
        return
    together = [actor for actor in state.scene.actors if _is_together(actor, state.actor)]
    for actor in together:
        if isinstance(actor.clip, SampledClip | PointClip):
            actor.clip = with_rate(actor.clip, rate)
    who = f" for {len(together)} actors of this capture" if len(together) > 1 else ""
    state.say_status(f"{rate:g} frames per second{who}")


def _is_together(one: Actor, other: Actor) -> bool:
    """Return whether two actors are identical or belong to the same capture."""
    first, second = one.clip, other.clip
    if one is other:
        return True
    if not isinstance(first, SampledClip | PointClip):
        return False
    if not isinstance(second, SampledClip | PointClip):
        return False
    if one.person is None or other.person is None or first.name != second.name:
        return False
    a, b = first.timing, second.timing
    return (a.frame_rate, a.n_frames, a.first_frame, a.start) == (
        b.frame_rate, b.n_frames, b.first_frame, b.start,
    )  # fmt: skip
