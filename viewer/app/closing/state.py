"""State of quitting, and of the question about unsaved edits."""

from __future__ import annotations

from viewer.data_classes import dataclass

__all__ = ["Closing"]


@dataclass(slots=True)
class Closing:
    """Progress of a request to quit; also used before files replace the scene.

    Attributes
    ----------
    is_requested : bool
        Whether the user asked to quit.
    waits : bool
        Whether the running job is finished first.
    discards : bool
        Whether the user agreed to lose the unsaved edits.
    is_over : bool
        Whether the window closes.
    """

    is_requested: bool = False
    waits: bool = False
    discards: bool = False
    is_over: bool = False

    def withdraw(self) -> None:
        """Keep the window open until the user asks to quit again."""
        self.is_requested = self.waits = self.discards = False
