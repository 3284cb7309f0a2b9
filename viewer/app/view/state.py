"""State of picking: the click that has not been handled yet."""

from __future__ import annotations

from viewer.data_classes import dataclass

__all__ = ["Picking"]


@dataclass(slots=True)
class Picking:
    """State of picking in the view.

    Attributes
    ----------
    wanted : (x, y, aims) or None
        Position of a click, relative to the upper left corner of the view, and whether the camera
        is aimed there.
    menu_at : (x, y) or None
        Position of a right click without a drag.
    """

    wanted: tuple[float, float, bool] | None = None
    menu_at: tuple[float, float] | None = None
