"""Keys and actions of the window: rows of the tables in ``features``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Concatenate, ParamSpec

from viewer.app.core.state import AppState
from viewer.data_classes import dataclass

_Rest = ParamSpec("_Rest")


def given(
    function: Callable[Concatenate[AppState, _Rest], object],
    *rest: _Rest.args,
    **named: _Rest.kwargs,
) -> Callable[[AppState], object]:
    """Return an action that calls a function of the state with further arguments."""

    def run(state: AppState) -> object:
        return function(state, *rest, **named)

    run.__name__ = " ".join([function.__name__, *map(str, rest)])
    return run


@dataclass(frozen=True, slots=True)
class Shortcut:
    """A key and its action."""

    chords: tuple[int, ...]
    """ImGui's key codes with modifiers."""
    label: str
    """Name of the key."""
    text: str
    """Effect of the key, as shown in lists of keys."""
    run: Callable[[AppState], object]
    """The action."""

    @property
    def name(self) -> str:
        """Name of the action in the preferences: it stays when key, label and module change."""
        return self.run.__name__


@dataclass(frozen=True, slots=True)
class Action:
    """An action of a menu or the command palette."""

    text: str
    """Name of the action."""
    run: Callable[[AppState], object]
    """The action."""
    reason: Callable[[AppState], str] = lambda state: ""
    """Returns the reason why the action is disabled; empty if it can be run."""
    key: str = ""
    """Label of its key in the table of keys; empty for none."""
    more: Callable[[AppState], str] = lambda state: ""
    """Returns what the action applies to now, as shown behind its name in a menu."""
