"""Table of video formats, and usual settings, available without importing an encoder."""

from __future__ import annotations

from dataclasses import field
from pathlib import Path

from viewer.data_classes import dataclass
from viewer.errors import UnsupportedFormatError

MOST_GIF_RATE = 50.0
"""Frames per second; browsers play delays below 2/100 s as 10/100 s."""

QUALITY = 75.0
"""Usual quality of the compression, 0 to 100."""

TURN_SECONDS = 6.0
"""Usual duration of a full revolution of the camera about a still scene."""


@dataclass(frozen=True, slots=True)
class VideoKind:
    """Properties of a video format."""

    title: str
    """Name in menus."""
    encoders: tuple[str, ...]
    """FFmpeg's names of its encoders, best first."""
    has_alpha: bool
    """Whether it supports transparency."""
    needs_even: bool
    """Whether width and height must be even, because colours have half the resolution."""
    muxer: dict[str, str] = field(default_factory=dict)


VIDEOS = {
    ".mp4": VideoKind(
        "MP4 video (H.264)",
        ("libx264", "libopenh264", "mpeg4"),
        False,
        True,
        {"movflags": "+faststart"},  # the index comes first, so that browsers can start immediately
    ),
    ".webm": VideoKind("WebM video (VP9)", ("libvpx-vp9",), True, True),
    ".gif": VideoKind("animated GIF", ("gif",), True, False),
}
"""Video formats by suffix."""


def video_kind(path: Path) -> VideoKind:
    """Return the video format for a file's suffix; the error for another one lists all formats."""
    suffix = path.suffix.lower()
    if suffix not in VIDEOS:
        known = ", ".join(VIDEOS)
        raise UnsupportedFormatError(f'videos cannot be written as "{suffix}"; supported: {known}')
    return VIDEOS[suffix]
