"""Recording of a video, compared with only drawing and only encoding its frames. Drawing uses the
recorder with a sink that drops the frames; encoding uses the video sink with stored frames. The
video has 1280 x 720 pixels, 4 samples per pixel, and H.264 at the default quality.
"""

import statistics
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from measure import interleaved

import viewer
from viewer.media.video import VideoSink
from viewer.rendering.framing import frame_motion
from viewer.rendering.offscreen import Offscreen, default_camera
from viewer.rendering.recorder import Recording, Sink, record
from viewer.rig.arrays import Bytes
from viewer.rig.motion.clip import Channel, Clip
from viewer.rig.scene import Actor, Scene

SIZE = 1280, 720
N_FRAMES, RATE = 60, 30.0
GOAL = 0.8


class _Dropped:
    """A sink that drops all frames."""

    workers, n_samples = 1, 0

    def look(self, pixels: Bytes) -> None:
        pass

    def write(self, frame: int, pixels: Bytes) -> None:
        pass

    def close(self) -> None:
        pass

    def abort(self) -> None:
        pass


class _Kept(_Dropped):
    """A sink that stores the frames."""

    def __init__(self) -> None:
        self.frames: list[Bytes] = []

    def write(self, frame: int, pixels: Bytes) -> None:
        self.frames.append(np.ascontiguousarray(pixels))


def moving() -> Actor:
    """Return the bundled fox with a motion that swings all joints."""
    actor = viewer.load().actors[0]
    skeleton = actor.figure.skeleton
    assert skeleton is not None and actor.pose is not None
    end, channels = N_FRAMES / RATE, []
    for dof in np.flatnonzero(skeleton.dof_kinds >= 3):
        rest = actor.pose.dofs[dof]
        values = rest + 0.15 * np.array([0.0, 1.0, 0.0, -1.0, 0.0])
        tangents = (("smooth", "smooth"),) * 5
        channels.append(Channel(int(dof), np.linspace(0.0, end, 5), values, tangents))
    actor.clip = Clip("swings", tuple(channels), 0.0, end)
    return actor


def main(rounds: int = 5) -> None:
    """Print frames per second, and the ratio of recording to the slower of drawing and encoding."""
    scene = Scene([moving()])
    recording = Recording(scene, np.arange(N_FRAMES) / RATE, default_camera(scene, SIZE), SIZE)
    _, recording.box = frame_motion(recording)
    with tempfile.TemporaryDirectory() as folder, Offscreen() as offscreen, offscreen.context:
        path = Path(folder) / "x.mp4"

        def recorded(make: Callable[[], Sink]) -> Callable[[], object]:
            return lambda: list(record(recording, offscreen.renderer, make()))

        kept = _Kept()
        recorded(lambda: kept)()

        def encode() -> None:
            sink = VideoSink(path, SIZE, RATE)
            for frame, pixels in enumerate(kept.frames):
                sink.write(frame, pixels)
            sink.close()

        work = {
            "drawing alone": recorded(_Dropped),
            "encoding alone": encode,
            "video": recorded(lambda: VideoSink(path, SIZE, RATE)),
        }
        times = interleaved(work, rounds)
    print(f"{N_FRAMES} frames of {SIZE[0]} x {SIZE[1]}")
    for name, values in times.items():
        print(f"  {name:<16} {N_FRAMES / (statistics.median(values) / 1e3):7.1f} frames/s")
    alone = zip(times["drawing alone"], times["encoding alone"], times["video"], strict=True)
    ratio = statistics.median(max(draw, code) / both for draw, code, both in alone)
    verdict = "met" if ratio >= GOAL else "MISSED"
    print(f"  speed of the video / of the slower one: {ratio:.2f} (goal: {GOAL:g}, {verdict})\n")


if __name__ == "__main__":
    main()
