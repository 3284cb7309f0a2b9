"""State of recording: settings of the Record window, and the requested file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

__all__ = ["KINDS", "LEAST_PIXELS", "RecordSettings", "Recording"]

KINDS = {
    ".mp4": "MP4 video (H.264)",
    ".webm": "WebM video (VP9)",
    ".gif": "Animated GIF",
    "pictures": "Numbered pictures (PNG)",
    "sheet": "Contact sheet (PNG)",
}
"""Kinds of recordings, with their labels."""

LEAST_PIXELS = 16
"""Smallest width and height of a recording."""


@dataclass(slots=True)
class RecordSettings:
    """Settings of a recording.

    Attributes
    ----------
    kind : str
        A key of ``KINDS``.
    size : str
        A key of the sizes offered.
    own_size : (int, int)
        Width and height for the size ``"own"``.
    rate : float
        Frames per second; 0 for the scene's own rate.
    turntable : bool
        Whether the camera orbits once around the scene.
    seconds : float
        Duration of the orbit if there is no motion.
    transparent : bool
        Whether the background is transparent.
    n_cells : int
        Frames of a contact sheet.
    quality : int
        Quality of videos, 0 to 100.
    """

    kind: str = ".mp4"
    size: str = "view"
    own_size: tuple[int, int] = (1280, 720)
    rate: float = 0.0
    turntable: bool = False
    seconds: float = 6.0
    transparent: bool = False
    n_cells: int = 12
    quality: int = 75

    def pixels(self, view: tuple[float, float]) -> tuple[int, int]:
        """Return the width and height of the recording for a given size of the view."""
        if self.size == "view":
            wide, high = (max(round(side), LEAST_PIXELS) for side in view)
            # Videos need even sizes; a lost row of the view does not matter.
            return wide - wide % 2, high - high % 2
        if self.size == "own":
            return self.own_size
        width, _, height = self.size.partition("x")
        return int(width), int(height)


@dataclass(slots=True)
class Recording:
    """State of the Record window.

    Attributes
    ----------
    settings : RecordSettings or None
        Settings shown in the window; None while it is closed.
    wanted : Path or None
        Target file of a recording that starts after the frame.
    """

    settings: RecordSettings | None = None
    wanted: Path | None = None
