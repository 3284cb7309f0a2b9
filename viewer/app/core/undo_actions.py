"""Undo and redo as actions of the window; the same actor stays chosen."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from viewer.app.core.state import AppState
from viewer.app.core.undo_history import Step
from viewer.rendering.options import DisplayOptions
from viewer.rigs.scene import Scene

_Go = Callable[[Scene, DisplayOptions, Callable[[float], None]], Step | None]
"""``History.undo`` or ``redo``."""


def undo(state: AppState) -> None:
    """Cancel the change that is being computed, or undo the last change of pose or display."""
    job = state.job
    if job is not None and job.is_change and not job.is_cancelled:
        # Its result would override an earlier change that is undone meanwhile.
        job.cancel()
        state.say_status("Cancelled")
        return
    _go(state, state.history.undo, "Undone", "Nothing to undo")


def redo(state: AppState) -> None:
    """Redo the most recently undone change."""
    _go(state, state.history.redo, "Redone", "Nothing to redo")


def undone_next(state: AppState) -> str:
    """Return the name of the step that would be undone."""
    step = state.history.undone_next
    return "" if step is None else step.name


def redone_next(state: AppState) -> str:
    """Return the name of the step that would be redone."""
    step = state.history.redone_next
    return "" if step is None else step.name


def _go(state: AppState, go: _Go, done: str, none: str) -> None:
    """Undo or redo a step; keep the chosen actor, or choose another if it is gone."""
    before = state.actor
    step = go(state.scene, state.options, partial(state.clock.go_back, chosen=before))
    # Replaces the message about the change, which would be wrong now.
    state.say_status(none if step is None else f"{done}{step.name and ': '}{step.name}")
    actors, row = state.scene.actors, state.chosen_actor
    if row < len(actors) and actors[row] is before:
        return
    rows = [number for number, actor in enumerate(actors) if actor is before]
    state.choose_actor(rows[0] if rows else min(row, len(actors) - 1))
