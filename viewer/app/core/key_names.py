"""Names of keys in menus, buttons and tooltips, including keys changed by the user."""

from __future__ import annotations

from dataclasses import field

from viewer.app.core.state import AppState
from viewer.data_classes import dataclass

__all__ = ["KeyNames", "key_name", "with_key"]


@dataclass(slots=True)
class KeyNames:
    """Keys changed by the user.

    Attributes
    ----------
    changed : dict
        Maps the label of a key in the table of keys to the name of the key that replaces it.
    """

    changed: dict[str, str] = field(default_factory=dict)


def key_name(state: AppState, usual: str) -> str:
    """Return the current name of a key, given its label in the table of keys.

    If an action has several keys, the first is named.
    """
    return state.of(KeyNames).changed.get(usual, usual).partition(" or ")[0]


def with_key(state: AppState, text: str, usual: str) -> str:
    """Return the text of a button or tooltip, followed by the name of its key.

    Parameters
    ----------
    state : AppState
        Provides the names.
    text : str
        The text, which describes the key's effect.
    usual : str
        Label of the key in the table of keys.
    """
    return f"{text} ({key_name(state, usual)})"
