"""State of the view: where it was clicked."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Picking"]


@dataclass(slots=True)
class Picking:
    """What was asked for with the mouse.

    Attributes
    ----------
    wanted : (x, y, aims) or None
        Where the view was clicked, from its corner; whether the camera aims there.
    """

    wanted: tuple[float, float, bool] | None = None
