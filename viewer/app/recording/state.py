"""State of recording: settings of the Record window, and the requested file."""

from __future__ import annotations

from pathlib import Path

from viewer.data_classes import dataclass

__all__ = ["KINDS", "LEAST_PIXELS", "VIDEO_KINDS", "RecordSettings", "Recording"]

KINDS = {
    ".mp4": "MP4 video (H.264)",
    ".webm": "WebM video (VP9)",
    ".gif": "Animated GIF",
    "pictures": "Numbered pictures (PNG)",
    "sheet": "Contact sheet (PNG)",
}
"""Kinds of recordings, with their labels."""

VIDEO_KINDS = (".mp4", ".webm", ".gif")
"""Kinds that are a video file, by its suffix."""

LEAST_PIXELS = 16
"""Minimum width and height of a recording."""


@dataclass(slots=True)
class RecordSettings:
    """Settings of a recording.

    Attributes
    ----------
    kind : str
        A key of ``KINDS``.
    size : str
        A key of the available sizes.
    own_size : (int, int)
        Width and height for the size ``"own"``.
    rate : float
        Frames per second; 0 for the scene's own rate.
    turntable : bool
        Whether the camera orbits once around the scene.
    seconds : float
        Duration of the orbit if there is no motion.
    n_cells : int
        Number of frames in a contact sheet.
    quality : int
        Quality of the compression of videos, 0 to 100.
    look : str
        Quality of the images, a key of ``viewer.rendering.options.QUALITIES``; empty for that of
        the view, or normal if the view is final and there are several frames.
    samples : int
        Samples per pixel; 0 for those of the view.
    background : str
        As in ``DisplayOptions``; empty for the background of the view.
    follows : bool
        Whether the camera follows the same actor or joint as in the view.
    frames : (int, int) or None
        First and last frame, numbered as in the timeline; None for the playback range.
    """

    kind: str = ".mp4"
    size: str = "view"
    own_size: tuple[int, int] = (1280, 720)
    rate: float = 0.0
    turntable: bool = False
    seconds: float = 6.0
    n_cells: int = 12
    quality: int = 75
    look: str = ""
    samples: int = 0
    background: str = ""
    follows: bool = True
    frames: tuple[int, int] | None = None

    @property
    def is_transparent(self) -> bool:
        """Whether the background is transparent and the file format supports transparency."""
        return self.background == "transparent" and self.kind != ".mp4"

    def pixels(self, view: tuple[float, float]) -> tuple[int, int]:
        """Return the width and height of the recording for a given size of the view."""
        if self.size == "view":
            wide, high = (max(round(side), LEAST_PIXELS) for side in view)
            # Videos need even sizes; losing a row of the view does not matter.
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
    preview : int
        ID of the preview's texture; 0 if there is none.
    """

    settings: RecordSettings | None = None
    wanted: Path | None = None
    preview: int = 0
