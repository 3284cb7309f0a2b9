"""Frames of a video as the images of a capture's camera."""

from __future__ import annotations

from pathlib import Path

from viewer.diagnostics import note
from viewer.errors import FormatError
from viewer.media.video_reading import VideoFrames
from viewer.rigs.captures.cameras import CameraImage


class VideoImages:
    """Frames of a video as the images of one camera; the last one shown is cached."""

    def __init__(self, path: Path, first: float, end: float, cameras: tuple[str, ...] = ()) -> None:
        self.cameras, self._video = cameras, VideoFrames(path)
        self.rate, self.size = self._video.rate, self._video.size
        self._first, self._end = first, end
        self._shown: tuple[int, CameraImage | None] | None = None
        self._faults: dict[str, None] = {}

    def at(self, camera: str, seconds: float) -> CameraImage | None:
        """Return the frame at a time; see ``viewer.rigs.captures.cameras``."""
        if camera not in self.cameras:
            return None
        number = round((seconds + self._first) * self._video.rate)
        if self._shown is None or self._shown[0] != number:
            self._shown = number, self._read(number / self._video.rate)
        return self._shown[1]

    def _read(self, seconds: float) -> CameraImage | None:
        try:
            pixels = self._video.at(seconds)
        except FormatError as problem:
            self._faults[str(problem)] = None
            return None
        return None if pixels is None else CameraImage(pixels)

    def size_of(self, camera: str) -> tuple[int, int] | None:
        """Return the size of the video; None for other cameras."""
        return self.size if camera in self.cameras else None

    def notes_of(self, camera: str) -> list[str]:
        """Return messages about the video: damaged frames, and an end before the capture's."""
        if camera not in self.cameras:
            return []
        video, notes = self._video, [*self._faults]
        length = video.n_frames / video.rate
        if video.n_frames and length + 0.5 / video.rate < self._end:
            values = {"seconds": length, "end": self._end}
            notes.append(
                str(
                    note(
                        "F007.video-short: the video ends at {seconds:.2f} s, the capture at "
                        "{end:.2f} s",
                        video.path,
                        **values,
                    )
                )
            )
        return notes


def video_rate(path: Path) -> float:
    """Return the frames per second of a video; errors as of ``VideoImages``."""
    return VideoFrames(path).rate
