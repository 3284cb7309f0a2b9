"""Open and closed panels: most are open until closed, some closed until asked for."""

from __future__ import annotations

from dataclasses import dataclass, field

from viewer.app.core.state import AppState
from viewer.app.features import PANELS

__all__ = ["ShownPanels", "is_open", "set_open"]


@dataclass(slots=True)
class ShownPanels:
    """Which panels are not as they are at first.

    Attributes
    ----------
    closed : set of str
        Those that were closed.
    opened : set of str
        Of those that wait to be asked for, the ones that were.
    wants_reset : bool
        Whether the layout is to be made anew.
    """

    closed: set[str] = field(default_factory=set)
    opened: set[str] = field(default_factory=set)
    wants_reset: bool = False


def is_open(state: AppState, name: str) -> bool:
    """Return whether a panel is shown if there is something for it to show."""
    shown = state.of(ShownPanels)
    if PANELS[name].on_demand:
        return name in shown.opened
    return name not in shown.closed


def set_open(state: AppState, name: str, opened: bool) -> None:
    """Open or close a panel."""
    shown = state.of(ShownPanels)
    on_demand = PANELS[name].on_demand
    names = shown.opened if on_demand else shown.closed
    if opened == on_demand:
        names.add(name)
    else:
        names.discard(name)
