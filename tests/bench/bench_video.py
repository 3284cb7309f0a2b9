"""Recording of a video and of numbered pictures, compared with only drawing and only encoding their
frames. Drawing uses the recorder with a sink that drops the frames; encoding gives stored frames to
as many threads as the sink allows. Frames have 1280 x 720 pixels and 4 samples per pixel, the video
H.264 at the default quality. The goal is for graphics cards: in software, drawing and encoding
share the processor, so the processor time of all threads per frame is printed too.
"""

import os
import statistics
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from measure import interleaved

import viewer
from viewer.media.picture_sinks import PictureSink
from viewer.media.video import VideoSink
from viewer.rendering.framing import frame_motion
from viewer.rendering.offscreen import Offscreen, default_camera
from viewer.rendering.recorder import Recording, Sink, record
from viewer.rigs.arrays import Bytes
from viewer.rigs.motion.clip import Channel, Clip
from viewer.rigs.scene import Actor, Scene

SIZE = 1280, 720
N_FRAMES, RATE = 60, 30.0
GOAL = 0.9


class _Dropped:
    """A sink that drops all frames."""

    workers, n_samples, n_kept, notes = 1, 0, 0, ()

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
    assert skeleton is not None
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
    with tempfile.TemporaryDirectory() as name, Offscreen() as offscreen, offscreen.context:
        folder = Path(name)

        def recorded(make: Callable[[], Sink]) -> Callable[[], object]:
            return lambda: list(record(recording, offscreen.renderer, make()))

        kept = _Kept()
        recorded(lambda: kept)()

        def encoded(make: Callable[[], Sink]) -> Callable[[], object]:
            def encode() -> None:
                sink = make()
                with ThreadPoolExecutor(sink.workers) as pool:
                    list(pool.map(sink.write, range(N_FRAMES), kept.frames))
                sink.close()

            return encode

        def video() -> Sink:
            return VideoSink(folder / "x.mp4", SIZE, RATE)

        def pictures() -> Sink:
            return PictureSink([folder / f"{frame}.png" for frame in range(N_FRAMES)])

        print(f"{N_FRAMES} frames of {SIZE[0]} x {SIZE[1]}, load {os.getloadavg()[0]:.1f}")
        for kind, make in (("video", video), ("pictures", pictures)):
            work = {
                "drawing alone": recorded(_Dropped),
                "encoding alone": encoded(make),
                kind: recorded(make),
            }
            used: dict[str, list[float]] = {}
            times = interleaved(
                {key: with_work(key, run, used) for key, run in work.items()}, rounds
            )
            report(times, used, kind)


def with_work(
    name: str, run: Callable[[], object], used: dict[str, list[float]]
) -> Callable[[], None]:
    """Return a function that also appends the processor time of a run, in milliseconds."""

    def measured() -> None:
        before = time.process_time()
        run()
        used.setdefault(name, []).append(1e3 * (time.process_time() - before))

    return measured


def report(times: dict[str, list[float]], used: dict[str, list[float]], kind: str) -> None:
    """Print rates, processor times, and the ratio with its goal."""
    for name, values in times.items():
        rate = N_FRAMES / (statistics.median(values) / 1e3)
        each = statistics.median(used[name]) / N_FRAMES
        print(f"  {name:<16} {rate:7.1f} frames/s, {each:6.1f} ms of processor time per frame")
    alone = zip(times["drawing alone"], times["encoding alone"], times[kind], strict=True)
    ratio = statistics.median(max(draw, code) / both for draw, code, both in alone)
    verdict = "met" if ratio >= GOAL else "MISSED"
    print(f"  speed of {kind} / of the slower one: {ratio:.2f} (goal: {GOAL:g}, {verdict})\n")


if __name__ == "__main__":
    main()
