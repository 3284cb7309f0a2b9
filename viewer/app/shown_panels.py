"""Which panels are open: most until they are closed, some only when they are asked for."""

from __future__ import annotations

from viewer.app.core.state import AppState
from viewer.app.features import PANELS

__all__ = ["is_open", "set_open"]


def is_open(state: AppState, name: str) -> bool:
    """Return whether a panel is shown if there is something for it to show."""
    if PANELS[name].on_demand:
        return name in state.opened_panels
    return name not in state.closed_panels


def set_open(state: AppState, name: str, opened: bool) -> None:
    """Open or close a panel."""
    on_demand = PANELS[name].on_demand
    names = state.opened_panels if on_demand else state.closed_panels
    if opened == on_demand:
        names.add(name)
    else:
        names.discard(name)
