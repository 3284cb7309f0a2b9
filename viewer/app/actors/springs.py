"""Switch for the simulation of an actor's spring joints."""

from __future__ import annotations

from viewer.app.core.state import AppState
from viewer.rig.motion.spring_motion import has_springs, release_springs, springs_for

__all__ = ["no_springs", "toggle_springs"]


def no_springs(state: AppState) -> str:
    """Return the reason why springs cannot be switched; empty if they can."""
    return "" if has_springs(state.actor) else f"{state.actor.name} has no spring joints"


def toggle_springs(state: AppState) -> None:
    """Switch the simulation of the chosen actor's springs on or off, and pose it again."""
    actor = state.actor
    if not has_springs(actor):
        state.say_status(no_springs(state))
        return
    if actor.springs is None:
        actor.springs = springs_for(actor, state.scene.up)
    else:
        actor.springs = None
        release_springs(actor)
    state.clock.pose(actor, again=True)
    state.say_status(f"Springs: {'off' if actor.springs is None else 'on'}")
