"""State of the Curves panel: selected curves and keys, and requests to fit the axes."""

from __future__ import annotations

from viewer.data_classes import dataclass

__all__ = ["Curves", "KeyPlace"]

KeyPlace = tuple[int, int]
"""Row of a curve and index of one of its keys."""


@dataclass(slots=True)
class Curves:
    """State of the Curves panel; the edited clip belongs to the actor.

    Attributes
    ----------
    rows : tuple of int
        Selected curves as rows of ``curves_of``, in the order of selection.
    keys : frozenset of (row, key)
        Selected keys.
    filter : str
        Text that the names of listed curves must contain.
    wants_fit : bool
        Whether the axes are fitted in the next frame.
    wants_scroll : bool
        Whether the list scrolls to the first selected curve in the next frame.
    owner : (int, str, int)
        Key of the actor, motion and number of curves for which ``rows`` are valid.
    joint : int
        Joint whose curves were last selected.
    """

    rows: tuple[int, ...] = ()
    keys: frozenset[KeyPlace] = frozenset()
    filter: str = ""
    wants_fit: bool = True
    wants_scroll: bool = False
    owner: tuple[int, str, int] = (-1, "", 0)
    joint: int = -1

    def choose(self, rows: tuple[int, ...]) -> None:
        """Select curves, and fit the axes to them."""
        self.rows, self.keys, self.wants_fit = rows, frozenset(), True
