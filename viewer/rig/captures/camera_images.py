"""Images recorded by the calibrated cameras of a capture."""

from __future__ import annotations

from typing import Protocol

from viewer.data_classes import dataclass
from viewer.rig.arrays import Bytes

__all__ = ["CameraImage", "CameraImages"]


@dataclass(frozen=True, slots=True, eq=False)
class CameraImage:
    """One image: its pixels (H, W, 4) uint8, sRGB, first row at the top, with lens distortion."""

    pixels: Bytes


class CameraImages(Protocol):
    """Source of camera images, which are read when they are drawn."""

    @property
    def cameras(self) -> tuple[str, ...]:
        """Names of the cameras that have images."""

    def at(self, camera: str, seconds: float) -> CameraImage | None:
        """Return the image of a camera at a time of the scene; None if there is none.

        While the image stays the same, the same object is returned. File errors become notes.
        """

    def size_of(self, camera: str) -> tuple[int, int] | None:
        """Return the width and height of a camera's images, pixels; None if it has no images."""

    def notes_of(self, camera: str) -> list[str]:
        """Return messages about a camera's missing or unusable images, one line each."""
