"""Undo and redo as actions of the window; the same actor stays chosen."""

from __future__ import annotations

from functools import partial

from viewer.app.core.state import AppState
from viewer.rig.scene import Actor


def undo(state: AppState) -> None:
    """Cancel the change that is being computed, or undo the last change of pose or display."""
    if _cancels_change(state):
        state.say_status("Cancelled")
        return
    before = state.actor
    pose_at = partial(state.clock.go_back, chosen=before)
    is_undone = state.history.undo(state.scene, state.options, pose_at)
    # Replaces the message about the change, which would be wrong now.
    state.say_status("Undone" if is_undone else "Nothing to undo")
    _keep_choice(state, before)


def redo(state: AppState) -> None:
    """Redo the most recently undone change."""
    before = state.actor
    pose_at = partial(state.clock.go_back, chosen=before)
    is_redone = state.history.redo(state.scene, state.options, pose_at)
    state.say_status("Redone" if is_redone else "Nothing to redo")
    _keep_choice(state, before)


def _cancels_change(state: AppState) -> bool:
    """Cancel a job whose result would override an earlier change that is undone; say if so."""
    job = state.job
    if job is None or not job.is_change or job.is_cancelled:
        return False
    job.cancel()
    return True


def _keep_choice(state: AppState, before: Actor) -> None:
    """Keep the chosen actor at its new index, or choose another if it is gone."""
    actors, row = state.scene.actors, state.chosen_actor
    if row < len(actors) and actors[row] is before:
        return
    rows = [number for number, actor in enumerate(actors) if actor is before]
    state.choose_actor(rows[0] if rows else min(row, len(actors) - 1))
