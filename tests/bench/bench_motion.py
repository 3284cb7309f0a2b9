"""Cost of playback: sampling, kinematics and upload of one 62-joint actor, compared with its frame.
The frame is 1280 x 720 with the default display. The growth of memory over 500 played frames is
printed as well, for Python objects and for the whole process.
"""

import gc
import resource
import statistics
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
from bench_skinning import N_JOINTS, SIZE, synthetic
from measure import interleaved, median_ratio

from viewer.rendering.offscreen import Offscreen, default_camera
from viewer.rendering.options import DisplayOptions
from viewer.rigs.geometry.rotation import matrix_to_quaternion, rotation_vector_to_matrix
from viewer.rigs.kinematics import posed_skeleton
from viewer.rigs.motion.clip import Channel, Clip
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor, Motion, Scene, pose_actors, scene_box

GOAL = 0.05
N_FRAMES, SECONDS = 300, 10.0


def sampled() -> SampledClip:
    """Return ten seconds of capture, in which every joint rotates slightly and the figure walks."""
    rng = np.random.default_rng(0)
    turns = np.cumsum(rng.normal(0.0, 0.003, (N_FRAMES, N_JOINTS, 3)), axis=0)
    place = np.zeros((N_FRAMES, 3))
    place[:, 0] = np.linspace(-0.3, 0.3, N_FRAMES)
    rotations = matrix_to_quaternion(rotation_vector_to_matrix(turns))
    timing = Timing(N_FRAMES / SECONDS, np.arange(N_FRAMES, dtype=np.int32))
    return SampledClip("sampled", timing, rotations, figure_translations=place)


def keyed() -> Clip:
    """Return ten seconds of curves with 31 keys for each of the 186 DOFs."""
    rng = np.random.default_rng(1)
    times = np.linspace(0.0, SECONDS, 31)
    channels = [
        Channel(dof, times, rng.normal(0.0, 0.02, 31), (("smooth", "smooth"),) * 31)
        for dof in range(3 * N_JOINTS)
    ]
    return Clip("keyed", tuple(channels), 0.0, SECONDS)


def main(rounds: int = 150) -> None:
    """Print the cost of each motion relative to its frame, and memory growth over 500 frames."""
    for clip in (sampled(), keyed()):
        with Offscreen() as offscreen, offscreen.context:
            frame, prepare = pieces(offscreen, Actor(synthetic(), clip=clip))
            times = interleaved({"frame": frame, "sample, pose, upload": prepare}, rounds)
            share = median_ratio(times, "sample, pose, upload", "frame")
            verdict = "met" if share < GOAL else "MISSED"
            print(f"{clip.name} motion of {N_JOINTS} joints, 1280 x 720, default display")
            for name, values in times.items():
                print(f"  {name:<44} {statistics.median(values):9.3f} ms")
            print(f"  share of the frame: {share:.1%} (goal: below {GOAL:.0%}, {verdict})")
            held, grown = growth(frame)
            print(f"  500 frames more: Python holds {held:+.1f} kB, the process {grown:+.0f} kB\n")


def pieces(offscreen: Offscreen, actor: Actor) -> tuple[Callable[[], object], Callable[[], object]]:
    """Return functions that play a frame, with and without skinning and drawing."""
    scene, options = Scene([actor]), DisplayOptions()
    assert actor.clip is not None
    pose_actors([actor], 0.0)
    camera, box, clock = default_camera(scene, SIZE), scene_box(scene), Clock(actor.clip)
    target, renderer = offscreen.target(SIZE, options.samples), offscreen.renderer

    def frame() -> None:
        pose_actors([actor], clock.next())
        renderer.draw(scene, camera, options, target, box)
        offscreen.context.finish()

    def prepare() -> None:
        pose_actors([actor], clock.next())
        figure = actor.figure
        posed_skeleton(figure.require_skeleton(), actor.pose).palette(figure.require_skin())

    return frame, prepare


class Clock:
    """The times in a looping clip, one per frame of a 60 Hz screen."""

    def __init__(self, clip: Motion) -> None:
        self.clip, self.ticks = clip, 0

    def next(self) -> float:
        """Return the next time, which is never repeated, so that no cached result is used."""
        self.ticks += 1
        return (self.ticks / 60.0 + 1e-5 * self.ticks) % (self.clip.end - self.clip.start)


def growth(frame: Callable[[], object]) -> tuple[float, float]:
    """Return the growth of Python's memory and of the process over 500 frames in kB."""
    for _ in range(100):
        frame()
    gc.collect()
    before = resident()
    for _ in range(500):
        frame()
    grown = resident() - before
    tracemalloc.start()
    for _ in range(20):
        frame()
    gc.collect()
    started = tracemalloc.get_traced_memory()[0]
    for _ in range(500):
        frame()
    gc.collect()
    held = tracemalloc.get_traced_memory()[0] - started
    tracemalloc.stop()
    return held / 1e3, grown / 1e3


def resident() -> float:
    """Return the memory of this process in bytes, or its peak if the system states nothing else."""
    pages = Path("/proc/self/statm")
    if pages.exists():
        return int(pages.read_text().split()[1]) * resource.getpagesize()
    return 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


if __name__ == "__main__":
    main()
