"""1,000 AMASS-like conversions by workers, one process, and a shell loop; overhead per item.

Rates depend on what else the machine does, so ratios are also given by processor time: what they
would be if all cores were free. The first argument is the number of files (1,000), the second that
of frames per file (120).
"""

from __future__ import annotations

import os
import resource
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from measure import run_process

import viewer
from viewer.batching.items import Item

ROUNDS = 3
LOOPED = 20  # files of the shell loop
JOINTS = 52  # SMPL-H
RATE = 120.0
WORKERS = 2


@dataclass
class Cost:
    """Seconds per item: on the clock, and of processor time in all processes."""

    wall: float
    work: float


def write(folder: Path, count: int, n_frames: int) -> list[str]:
    """Write motions with AMASS's keys: a slow walk of noise; return their paths."""
    rng = np.random.default_rng(0)
    paths = []
    for number in range(count):
        steps = rng.normal(scale=0.01, size=(n_frames, 3 * JOINTS)).cumsum(axis=0)
        path = folder / f"subject_{number % 20:02}" / f"walk_{number:05}_poses.npz"
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez(
            path,
            poses=steps,
            trans=steps[:, :3],
            betas=np.zeros(16),
            gender="neutral",
            mocap_framerate=RATE,
        )
        paths.append(str(path))
    return paths


def nothing(item: Item) -> None:
    """Do nothing, as a job whose time is all overhead."""


def cost(run: Callable[[], object], count: int) -> Cost:
    """Return what each of ``count`` items costs."""
    started, before = time.perf_counter(), _work()
    run()
    return Cost((time.perf_counter() - started) / count, (_work() - before) / count)


def _work() -> float:
    used = [resource.getrusage(kind) for kind in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def converted(paths: list[str], out: Path, workers: int, cluster: str = "") -> None:
    """Convert all files by a batch."""
    found = viewer.batch(
        paths, "convert", out, to="bvh", workers=workers, cluster=cluster, force=True
    )
    if found.counts["done"] != len(paths):
        raise SystemExit(f"not converted: {found.failures[:3]}")


def looped(paths: list[str], out: Path) -> None:
    """Convert files as a shell loop does, one program after another."""
    out.mkdir(exist_ok=True)
    for path in paths:
        target = str(out / f"{Path(path).stem}.bvh")
        run_process(["-m", "viewer", "convert", path, "-o", target, "--force"], is_quiet=True)


def ratio(first: list[Cost], second: list[Cost], kind: str, factor: float = 1.0) -> float:
    """Return the median of second / first within one round."""
    pairs = zip(first, second, strict=True)
    return factor * statistics.median(getattr(b, kind) / getattr(a, kind) for a, b in pairs)


def report(costs: dict[str, list[Cost]]) -> None:
    """Print rates and ratios."""
    for name, values in costs.items():
        rate = 1.0 / statistics.median(one.wall for one in values)
        work = 1e3 * statistics.median(one.work for one in values)
        print(f"  {name:<44} {rate:8.1f} items/s, {work:8.2f} ms of processor time per item")
    loop, warm, two, cluster, empty = costs.values()
    for text, wall, work, goal in (
        ("two workers / one process", ratio(two, warm, "wall"),
         ratio(two, warm, "work", WORKERS), 1.8),
        ("two Dask workers / one process", ratio(cluster, warm, "wall"),
         ratio(cluster, warm, "work", WORKERS), 1.8),
        ("one process / shell loop", ratio(warm, loop, "wall"), ratio(warm, loop, "work"), 10.0),
    ):  # fmt: skip
        verdict = "met" if max(wall, work) >= goal else "MISSED"
        print(f"  {text}: {wall:.2f}, by processor time {work:.2f} (goal: {goal:g}, {verdict})")
    least = 1e3 * statistics.median(one.work for one in empty)
    verdict = "met" if least < 5.0 else "MISSED"
    print(f"  overhead: {least:.2f} ms of processor time per item (goal: below 5, {verdict})\n")


def main() -> None:
    """Measure interleaved rounds."""
    numbers = [int(word) for word in sys.argv[1:] if word.isdecimal()]
    count, n_frames = [*numbers, *(1000, 120)[len(numbers) :]]
    with tempfile.TemporaryDirectory(prefix="viewer-bench-") as name:
        folder = Path(name)
        paths = write(folder / "in", count, n_frames)
        converted(paths[:5], folder / "first", 0)  # imports
        works: dict[str, tuple[Callable[[], object], int]] = {
            "shell loop": (lambda: looped(paths[:LOOPED], folder / "loop"), LOOPED),
            "one warm process": (lambda: converted(paths, folder / "one", 0), count),
            "two workers, with their start": (
                lambda: converted(paths, folder / "two", WORKERS),
                count,
            ),
            "two Dask workers, with their start": (
                lambda: converted(paths, folder / "dask", WORKERS, "local"),
                count,
            ),
            "an empty job in one process, with a report": (
                lambda: viewer.batch(
                    paths, nothing, report=folder / "r.jsonl", workers=0, force=True
                ),
                count,
            ),
        }
        costs: dict[str, list[Cost]] = {name: [] for name in works}
        for _ in range(ROUNDS):
            for name, (work, each) in works.items():
                costs[name].append(cost(work, each))
    load = os.getloadavg()[0]
    title = f"{count} conversions of {n_frames} frames to .bvh"
    print(f"{title}, load {load:.1f} on {os.cpu_count()} cores")
    report(costs)


if __name__ == "__main__":
    main()
