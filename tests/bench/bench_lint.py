"""Cost of checking the bundled body with 1,000 frames by ``lint``, compared with reading them.
Reading means opening body and motion like ``viewer view``; the check starts from the open scene.
The time of each check is printed as well.
"""

import statistics
import tempfile
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
from measure import interleaved, report

import viewer
from viewer.linting import lint_scene
from viewer.loading import bundled_body
from viewer.progress import receiving
from viewer.rigs.scene import Scene

GOAL = 4.0
N_FRAMES, RATE = 1000, 60.0
N_JOINTS, N_SHAPES = 52, 16  # joints of SMPL-H, as in AMASS


def motion(path: Path) -> Path:
    """Write an AMASS file of a walk-like motion with joints that swing at different speeds."""
    rng = np.random.default_rng(0)
    seconds = np.arange(N_FRAMES)[:, None] / RATE
    swing = rng.uniform(0.0, 0.3, 3 * N_JOINTS)
    poses = swing * np.sin(2.0 * np.pi * rng.uniform(0.2, 1.0, 3 * N_JOINTS) * seconds)
    # With z up, the body is rotated upright and walks along y.
    poses[:, :3] = np.pi / 2.0, 0.0, 0.0
    place = np.zeros((N_FRAMES, 3))
    place[:, 1], place[:, 2] = 0.8 * seconds[:, 0], 1.2
    np.savez(
        path,
        poses=poses,
        trans=place,
        betas=np.zeros(N_SHAPES),
        gender="neutral",
        mocap_framerate=RATE,
    )
    return path


def main(rounds: int = 7) -> None:
    """Print the time of checking relative to reading, and the time of each check."""
    with tempfile.TemporaryDirectory(prefix="viewer-bench-") as folder:
        files = [bundled_body(), motion(Path(folder) / "walk.npz")]
        scene = viewer.load(*files)
        found = lint_scene(scene)
        work = {
            "lint": lambda: lint_scene(scene),
            "read body and motion": lambda: viewer.load(*files),
        }
        times = interleaved(work, rounds)
    title = f"lint of the body with {N_FRAMES} frames: {len(found)} findings"
    report(title, times, ("lint", "read body and motion"), GOAL)
    print("where the time goes:")
    for name, spent in shares(scene).items():
        print(f"  {name:<44} {spent:9.2f} ms")


def shares(scene: Scene, rounds: int = 5) -> dict[str, float]:
    """Return the median milliseconds of each check over some rounds."""
    spent: dict[str, list[float]] = {}
    for _ in range(rounds):
        steps = steps_of(scene)
        for (what, start), (_, end) in pairwise(steps):
            spent.setdefault(what, []).append(1e3 * (end - start))
    return {name: statistics.median(values) for name, values in spent.items()}


def steps_of(scene: Scene) -> list[tuple[str, float]]:
    """Return the start time of each step of a check, and the end of the last one, in seconds."""
    steps: list[tuple[str, float]] = []

    def note(_done: int, _total: int, _unit: str, what: str) -> None:
        steps.append((what, time.perf_counter()))

    with receiving(note):
        lint_scene(scene)
    return [*steps, ("", time.perf_counter())]


if __name__ == "__main__":
    main()
