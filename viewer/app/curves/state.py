"""State of the Curves panel: chosen curves and keys, and whether to fit them."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Curves", "KeyPlace"]

KeyPlace = tuple[int, int]
"""A curve's row and the index of one of its keys."""


@dataclass(slots=True)
class Curves:
    """The Curves panel's own state; what it edits is the actor's clip.

    Attributes
    ----------
    rows : tuple of int
        Chosen curves, as ``curves_of`` numbers them, in the order in which they were chosen.
    keys : frozenset of (row, key)
        Chosen keys.
    filter : str
        Only curves with this in their name are listed.
    wants_fit : bool
        Fit the axes in the next frame.
    wants_scroll : bool
        Scroll the list to the first chosen curve in the next frame.
    owner : (int, str, int)
        The actor, and the kind and number of curves that ``rows`` belong to.
    joint : int
        The selected joint that the rows followed last.
    """

    rows: tuple[int, ...] = ()
    keys: frozenset[KeyPlace] = frozenset()
    filter: str = ""
    wants_fit: bool = True
    wants_scroll: bool = False
    owner: tuple[int, str, int] = (-1, "", 0)
    joint: int = -1

    def choose(self, rows: tuple[int, ...]) -> None:
        """Show other curves, and all of them."""
        self.rows, self.keys, self.wants_fit = rows, frozenset(), True
