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
    return _is_widget_held() or is_dragged or moves_template


def _is_widget_held() -> bool:
    """Return whether a widget is held. A text field changes nothing until it loses the focus.

    Tab goes from field to field without a frame in between, and each number is a separate edit.
    """
    active = imgui.internal.get_active_id()
    # This state persists after typing: the same slider may be dragged afterwards.
    is_text = imgui.internal.get_input_text_state(active) is not None
    return active != 0 and not (is_text and imgui.get_io().want_text_input)


def stops_time(state: AppState) -> bool:
    """Return whether time must stop: a handle is held but has not been dragged yet.

    A click must not pause playback, and a drag must start from an unchanged pose.
    """
    drag = state.of(Posing).drag
    return drag is not None and not drag.has_moved
