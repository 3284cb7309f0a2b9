"""Open and closed panels: most are open by default, some are opened on demand."""

from __future__ import annotations

from dataclasses import field

from viewer.app.core.state import AppState
from viewer.app.features import PANELS
from viewer.data_classes import dataclass

__all__ = ["ShownPanels", "is_open", "reset_layout", "set_open", "show_panel"]


@dataclass(slots=True)
class ShownPanels:
    """Panels whose state differs from the default.

    Attributes
    ----------
    closed : set of str
        Panels open by default that were closed.
    opened : set of str
        On-demand panels that were opened.
    wants_reset : bool
        Whether the default layout is to be restored.
    fronts : list of str
        Titles of panels to bring to the front of their tabs once they are drawn.
    """

    closed: set[str] = field(default_factory=set)
    opened: set[str] = field(default_factory=set)
    wants_reset: bool = False
    fronts: list[str] = field(default_factory=list)


def is_open(state: AppState, name: str) -> bool:
    """Return whether a panel is open; it is drawn only if it has something to show."""
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


def show_panel(state: AppState, name: str) -> None:
    """Open a panel, and bring it to the front of its tabs once it is drawn."""
    set_open(state, name, True)
    state.of(ShownPanels).fronts.append(PANELS[name].title)


def reset_layout(state: AppState) -> None:
    """Restore the initial arrangement of the panels."""
    state.of(ShownPanels).wants_reset = True
