"""Switch for planting the feet of driven figures while the feet of the motion are in contact."""

from __future__ import annotations

from dataclasses import replace

from viewer.app.core.state import AppState
from viewer.app.retargeting.drive_changes import NOT_DRIVEN, change_drive, no_edit, shown_drive

__all__ = ["plants_feet", "toggle_feet"]


def plants_feet(state: AppState) -> bool:
    """Return whether the feet of the chosen actor are planted, or will be after retargeting."""
    drive = shown_drive(state, state.actor)
    return drive is not None and drive.plants_feet


def toggle_feet(state: AppState) -> None:
    """Switch planted feet on or off for the chosen actor and all people of its capture."""
    if no_edit(state):
        state.say_status(no_edit(state))
        return
    if state.actor.clip is None:
        state.say_status(NOT_DRIVEN)
        return
    is_on = not plants_feet(state)
    text = f"Feet: {'kept on the ground' if is_on else 'as retargeted'}"
    change_drive(
        state, lambda drive: replace(drive, plants_feet=is_on), lambda: state.say_status(text)
    )
