"""Queries for edits and drags in progress: widgets and handles held with the mouse."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.posing.state import Posing
from viewer.app.rigging.state import Rigging

__all__ = ["is_held", "stops_time"]


def is_held(state: AppState) -> bool:
    """Return whether an edit is in progress: a widget or a handle is held."""
    drag = state.of(Posing).drag
    is_dragged = drag is not None and not drag.is_over
    moves_template = state.of(Rigging).holds_mouse and imgui.is_mouse_down(imgui.MouseButton_.left)
    return imgui.is_any_item_active() or is_dragged or moves_template


def stops_time(state: AppState) -> bool:
    """Return whether time must stop: a handle is held but has not been dragged yet.

    A click must not pause playback, and a drag must start from an unchanged pose.
    """
    drag = state.of(Posing).drag
    return drag is not None and not drag.has_moved
