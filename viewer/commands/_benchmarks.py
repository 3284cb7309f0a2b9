"""Speed of this machine: starting, drawing and saving, as measured by ``viewer doctor --bench``."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from viewer.data_classes import dataclass
from viewer.errors import RenderError
from viewer.loading import bundled_body, bundled_files, load

if TYPE_CHECKING:
    from viewer.rendering.offscreen import Offscreen
    from viewer.rendering.options import DisplayOptions
    from viewer.rig.scene import Scene

__all__ = ["Measured", "measured"]

_SIZE = 1280, 720
_STARTS, _FRAMES = 5, 9  # numbers of repetitions; the median is used
_INSTANCES, _ROUNDS_OF_MANY = 100, 3
# A minimal program that draws: it imports numpy and creates an OpenGL context.
_LEAST = "from viewer.rendering.gpu.context import headless_context; headless_context()"


@dataclass(frozen=True, slots=True)
class Measured:
    """A duration in milliseconds, and the duration that it is compared with, if any."""

    subject: str
    milliseconds: float
    relative: float = 0.0
    to: str = ""

    def __str__(self) -> str:
        ratio = f"   {self.relative:.2f} times {self.to}" if self.to else ""
        return f"{self.subject:<54}{self.milliseconds:9.2f} ms{ratio}"


def measured() -> Iterator[Measured]:
    """Yield durations as they are measured, medians of several repetitions.

    Raises
    ------
    RenderError
        If drawing is impossible; raised after the measurements that need no drawing.
    """
    yield from _starts()
    yield from _frames()
    yield from _parts()


def _starts() -> Iterator[Measured]:
    """Measure whole programs, from start to exit."""
    with tempfile.TemporaryDirectory(prefix="viewer-bench-") as folder:
        picture = str(Path(folder) / "picture.png")
        draw = ["-m", "viewer", "render", "-o", picture, "--force", "--quality", "draft"]
        runs = (
            ("import numpy", "", ["-c", "import numpy"]),
            ("viewer info, a skeleton", "import numpy", ["-m", "viewer", "info", _skeleton()]),
            ("OpenGL context", "", ["-c", _LEAST]),
            ("viewer render, bundled figure to PNG", "OpenGL context", draw),
            ("the same without the cache", "OpenGL context", [*draw, "--no-cache"]),
            ("bundled body to PNG", "OpenGL context", [*draw, str(bundled_body())]),
        )
        own = {"VIEWER_CACHE": str(Path(folder) / "cache")}
        times = _interleaved({name: _process(words, own) for name, _, words in runs}, _STARTS)
    for name, base, _ in runs:
        ratio = _ratio(times[name], times[base]) if base else 0.0
        yield Measured(f"start to end: {name}", statistics.median(times[name]), ratio, base)


def _skeleton() -> str:
    return next(str(file) for file in bundled_files() if Path(file).suffix == ".skel")


def _ratio(times: Sequence[float], others: Sequence[float]) -> float:
    """Return the median ratio of times that were measured alternately."""
    return statistics.median(one / other for one, other in zip(times, others, strict=True))


def _process(arguments: Sequence[str], environment: dict[str, str]) -> Callable[[], object]:
    """Return a function that runs Python with the given arguments."""

    def run() -> None:
        done = subprocess.run(
            [sys.executable, *arguments],
            env={**os.environ, **environment},
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            raise RenderError((done.stderr.strip().splitlines() or ["it crashed"])[-1])

    return run


def _frames() -> Iterator[Measured]:
    """Measure frames of the bundled body, rendered and read into memory."""
    from viewer.rendering.offscreen import Offscreen
    from viewer.rendering.options import DisplayOptions

    scene = load(bundled_body())
    crowd, many = _crowd(scene), f"{_INSTANCES} bodies"
    plain = DisplayOptions(grid=False, samples=1)
    cases = (
        ("a body that moves, 4 samples and grid", scene, DisplayOptions(), _FRAMES, "a still body"),
        ("a body that moves, 1 sample, no grid", scene, plain, _FRAMES, "a still body"),
        (
            f"{many} that move, 1 sample, no grid",
            crowd,
            plain,
            _ROUNDS_OF_MANY,
            f"{_INSTANCES} still bodies",
        ),
    )
    with Offscreen() as offscreen:
        for subject, drawn, options, rounds, base in cases:
            work = {
                "still": _drawn(offscreen, drawn, options),
                "moved": _drawn(offscreen, drawn, options, moves=True),
            }
            times = _interleaved(work, rounds)
            ratio = _ratio(times["moved"], times["still"])
            yield Measured(f"frame of {subject}", statistics.median(times["moved"]), ratio, base)


def _drawn(
    offscreen: Offscreen, scene: Scene, options: DisplayOptions, moves: bool = False
) -> Callable[[], object]:
    """Return a function that draws a scene into memory, in a new pose each time if it moves."""
    from viewer.rendering.offscreen import default_camera
    from viewer.rig.scene import scene_box

    camera, box = default_camera(scene, _SIZE), scene_box(scene)

    def draw() -> None:
        if moves:
            _pose(scene)
        offscreen.render(scene, _SIZE, camera, options, box)

    return draw


def _crowd(scene: Scene) -> Scene:
    """Return copies of the first figure, in rows of ten."""
    from viewer.rig.scene import Actor, Scene

    actors = [Actor(scene.actors[0].figure) for _ in range(_INSTANCES)]
    for number, actor in enumerate(actors):
        actor.placement[:3, 3] = number % 10, 0.0, -(number // 10)
    return Scene(actors)


def _pose(scene: Scene) -> None:
    """Give every actor a new pose."""
    import numpy as np

    now = time.perf_counter()
    for number, actor in enumerate(scene.actors):
        pose = actor.require_pose()
        pose.dofs[:] = 0.1 * np.sin(now + number + np.arange(len(pose.dofs)))


def _parts() -> Iterator[Measured]:
    """Measure the parts of a frame other than drawing."""
    import numpy as np

    from viewer.media.png import encode_png
    from viewer.rig.kinematics import world_matrices

    scene = load(bundled_body())
    actor = scene.actors[0]
    skeleton, pose = actor.figure.require_skeleton(), actor.require_pose()

    def place() -> None:
        _pose(scene)
        world_matrices(skeleton, pose)

    # Smooth shading with a little noise, as in a rendered image.
    ramp = np.add.outer(np.arange(_SIZE[1]), np.arange(_SIZE[0]))[..., None] // 16
    noise = np.random.default_rng(0).integers(0, 2, (_SIZE[1], _SIZE[0], 1))
    pixels = (ramp + noise + np.array([0, 40, 80, 0])).astype(np.uint8)
    pixels[..., 3] = 255
    times = _interleaved({"place": place, "encode": lambda: encode_png(pixels)}, 5 * _FRAMES)
    yield Measured(f"pose of {skeleton.n_joints} joints", statistics.median(times["place"]))
    yield Measured("PNG of 1280 x 720 pixels", statistics.median(times["encode"]))


def _interleaved(work: dict[str, Callable[[], object]], rounds: int) -> dict[str, list[float]]:
    """Time all functions once per round, after a warm-up round: milliseconds by name."""
    times: dict[str, list[float]] = {name: [] for name in work}
    for number in range(rounds + 1):
        for name, run in work.items():
            started = time.perf_counter()
            run()
            if number:  # the warm-up round compiles and fills caches
                times[name].append(1e3 * (time.perf_counter() - started))
    return times
