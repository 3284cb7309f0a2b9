"""Undo and redo as actions of the window; the same actor stays chosen."""

from __future__ import annotations

from functools import partial

from viewer.app.core.state import AppState
from viewer.rig.scene import Actor

__all__ = ["redo", "undo"]


def undo(state: AppState) -> None:
    """Undo the last change of pose or display."""
    before = state.actor
    pose_at = partial(state.clock.go_back, chosen=before)
    if not state.history.undo(state.scene, state.options, pose_at):
        state.say_status("Nothing to undo")
    _keep_choice(state, before)


def redo(state: AppState) -> None:
    """Redo the most recently undone change."""
    before = state.actor
    pose_at = partial(state.clock.go_back, chosen=before)
    if not state.history.redo(state.scene, state.options, pose_at):
        state.say_status("Nothing to redo")
    _keep_choice(state, before)


def _keep_choice(state: AppState, before: Actor) -> None:
    """Keep the chosen actor at its new index, or choose another if it is gone."""
    actors, row = state.scene.actors, state.chosen_actor
    if row < len(actors) and actors[row] is before:
        return
    rows = [number for number, actor in enumerate(actors) if actor is before]
    state.choose_actor(rows[0] if rows else min(row, len(actors) - 1))
