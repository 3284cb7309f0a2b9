"""Actions on the window itself: panels, list of keys, message log, and requests."""

from __future__ import annotations

from viewer.app.core.state import AppState
from viewer.app.keys import Keyboard

__all__ = ["toggle_keys", "toggle_messages", "toggle_panels", "want"]


def toggle_panels(state: AppState) -> None:
    """Show or hide menus and panels."""
    state.panels_visible = not state.panels_visible


def toggle_keys(state: AppState) -> None:
    """Show or hide the list of keys."""
    keyboard = state.of(Keyboard)
    keyboard.is_listed = not keyboard.is_listed


def toggle_messages(state: AppState) -> None:
    """Open or close the window "Messages"."""
    state.messages.is_open = not state.messages.is_open


def want(state: AppState, what: str) -> None:
    """Request an action that the window runs after the frame."""
    state.wants.add(what)
