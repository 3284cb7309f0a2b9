"""Figures of one file, which keep their relative positions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rig.figure import Figure

if TYPE_CHECKING:
    from viewer.rig.captures.camera_view import CameraView

__all__ = ["FigureGroup"]


@dataclass(frozen=True, slots=True, eq=False)
class FigureGroup:
    """All figures of a file, in one common space, and its cameras.

    Attributes
    ----------
    name : str
        Title of the group.
    figures : tuple of Figure
        At least one; all have the same up axis and unit.
    views : tuple of CameraView
        Cameras of the file, in the space of the figures.
    """

    name: str
    figures: tuple[Figure, ...]
    views: tuple[CameraView, ...] = ()

    def __post_init__(self) -> None:
        if not self.figures:
            raise RigError(f"{self.name}: expected at least one figure, found none")
