"""Frames of a video by time, decoded with PyAV, which is imported only when needed."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import wording
from viewer.errors import FormatError, ViewerError, reason_of
from viewer.phrases import Remedy
from viewer.rigs.arrays import Bytes

_PICTURES = ("_pipe", "image2")  # FFmpeg's formats of single pictures
_BYTES = 96_000_000  # size of the cache of decoded frames, which makes stepping back fast
_FEWEST = 2  # minimum number of cached frames, regardless of their size
_AHEAD = 2.0  # up to this number of seconds, decoding forwards is faster than seeking
_ON_TIME = 1e-6  # tolerance of times, seconds


@dataclass(frozen=True, slots=True)
class _Decoded:
    """A decoded frame, which is shown from halfway after the previous one."""

    begins: float
    ends: float
    """Seconds between which it is the nearest frame."""
    frame: Any


class VideoFrames:
    """Reads the frame of a video that is nearest to a time.

    Frames are decoded in the order of time. The last ones are cached; an earlier time, or one far
    ahead, is reached by seeking to the key frame before it. ``size``: of the upright picture.
    ``rate``: frames per second, on average. ``n_frames``: according to the file; 0 if unknown.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            import av
        except ImportError:
            raise ViewerError("videos need PyAV, which is not installed: pip install av") from None
        self._errors: Any = av
        try:
            path.open("rb").close()  # FFmpeg's own messages do not state the reason
        except OSError as problem:
            raise FormatError.fault(
                "F001.video: unreadable video: {reason}",
                path,
                reason=reason_of(problem),
            ) from None
        try:
            self._container = self._errors.open(str(path))
        except (self._errors.FFmpegError, ValueError):
            raise FormatError.fault(wording.VIDEO, path) from None
        if self._container.format.name.endswith(_PICTURES):
            raise FormatError.fault(
                "F002.video-picture: expected a video, found a picture{remedy}",
                path,
                remedy=Remedy("", " (--images takes a folder of pictures)"),
            )
        streams = self._container.streams.video
        if not streams:
            raise FormatError.fault(
                "F002.video-stream: expected a video, found a file without video frames", path
            )
        self._stream = streams[0]
        self._stream.thread_type = "AUTO"
        self.rate = float(self._stream.average_rate or self._stream.guessed_rate or 0.0)
        self.n_frames = int(self._stream.frames)
        self._kept: deque[_Decoded] = deque()
        self._source: Iterator[Any] = iter(())
        self._start, self._is_over = 0.0, False
        self._restart(0.0)
        first = self._next()
        if first is None or not self.rate > 0.0:
            raise FormatError.fault(wording.VIDEO, path)
        turned = _quarter_turns(first.frame) % 2
        wide, high = first.frame.width, first.frame.height
        self.size = (high, wide) if turned else (wide, high)

    def at(self, seconds: float) -> Bytes | None:
        """Return the frame nearest to a time, (H, W, 4) uint8, upright; None outside the video."""
        found = self._find(seconds)
        if found is None:
            return None
        pixels: Bytes = found.frame.to_ndarray(format="rgba")
        return np.ascontiguousarray(np.rot90(pixels, _quarter_turns(found.frame)))

    def _find(self, seconds: float) -> _Decoded | None:
        half = 0.5 / self.rate
        if seconds < -half - _ON_TIME:
            return None
        last = self._kept[-1].ends if self._kept else np.inf
        first = self._kept[0].begins if self._kept else np.inf
        if seconds < first or (seconds > last + _AHEAD and not self._is_over):
            self._restart(seconds)
        for known in self._kept:
            if known.begins - _ON_TIME <= seconds < known.ends - _ON_TIME:
                return known
        while (found := self._next()) is not None:
            if seconds < found.ends - _ON_TIME:
                return found
        return None

    def _restart(self, seconds: float) -> None:
        """Continue decoding at the key frame before a time."""
        stream = self._stream
        begin = stream.start_time or 0
        self._start = float(begin * stream.time_base)
        # One frame earlier, since the frame before the wanted one determines when that begins.
        target = max(seconds - 1.5 / (self.rate or 1.0), 0.0)
        try:
            self._container.seek(begin + int(target / stream.time_base), stream=stream)
        except self._errors.FFmpegError:
            raise FormatError.fault(wording.VIDEO_DAMAGED, self.path, seconds=seconds) from None
        self._source, self._is_over = self._container.decode(stream), False
        self._kept.clear()

    def _next(self) -> _Decoded | None:
        """Return the next frame and cache it; None after the last one."""
        half = 0.5 / (self.rate or 1.0)
        try:
            frame = next(self._source, None)
        except self._errors.FFmpegError:
            self._source = iter(())
            seconds = self._kept[-1].ends if self._kept else 0.0
            raise FormatError.fault(wording.VIDEO_DAMAGED, self.path, seconds=seconds) from None
        if frame is None:
            self._is_over = True
            return None
        time = float(frame.time or 0.0) - self._start
        begins = self._kept[-1].ends if self._kept else time - half
        found = _Decoded(begins, time + half, frame)
        self._kept.append(found)
        size = 2 * frame.width * frame.height  # upper bound for common pixel formats
        while len(self._kept) > max(_FEWEST, _BYTES // max(size, 1)):
            self._kept.popleft()
        return found


def _quarter_turns(frame: Any) -> int:
    """Return the number of anticlockwise 90-degree rotations that make a frame upright."""
    return round(getattr(frame, "rotation", 0) / 90) % 4
