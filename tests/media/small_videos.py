"""Small images for videos, and an independent reader of video frames."""

from pathlib import Path

import numpy as np
import pytest

from viewer.media.video import VideoSink

av = pytest.importorskip("av")


def counting(frame: int, size: tuple[int, int] = (64, 48)) -> np.ndarray:
    """Return the grey value that encodes a frame number."""
    return np.full((size[1], size[0], 4), (20 * frame,) * 3 + (255,), dtype=np.uint8)


def write(sink: VideoSink, frames: list[np.ndarray]) -> None:
    for index, pixels in enumerate(frames):
        sink.write(index, pixels)
    sink.close()


def decoded(path: Path) -> list[np.ndarray]:
    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
