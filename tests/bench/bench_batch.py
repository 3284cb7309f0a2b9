"""Conversion of 1,000 AMASS-like files by workers, one process and a shell loop; overhead per item.
Rates depend on the load of the machine, so ratios are also computed from processor time, as if all
cores were idle, for 1,000 files. Workers start once per batch. The arguments are the number of
files (1,000), of frames per file (120), and of rounds.
"""

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
from measure import CACHE, run_process

import viewer
from viewer.batching.items import Item

ROUNDS = 3
LOOPED = 20  # number of files of the shell loop
JOINTS = 52  # SMPL-H
RATE = 120.0
WORKERS = 2
FILES = 1000  # number of files to which the goals refer


@dataclass
class Cost:
    """Seconds per item, as wall time and as processor time of all processes."""

    wall: float
    work: float


def write(folder: Path, count: int, n_frames: int) -> list[str]:
    """Write motions with the keys of AMASS, as slow random walks; return their paths."""
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
    """Return immediately, so that all measured time is overhead."""


def cost(run: Callable[[], object], count: int) -> Cost:
    """Return the cost per item of a run with ``count`` items."""
    started, before = time.perf_counter(), _work()
    run()
    return Cost((time.perf_counter() - started) / count, (_work() - before) / count)


def _work() -> float:
    used = [resource.getrusage(kind) for kind in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def converted(paths: list[str], out: Path, workers: int, cluster: str = "") -> None:
    """Convert all files in one batch."""
    found = viewer.batch(
        paths, "convert", out, to="bvh", workers=workers, cluster=cluster, force=True
    )
    if found.counts["done"] != len(paths):
        raise SystemExit(f"not converted: {found.failures[:3]}")


def looped(paths: list[str], out: Path) -> None:
    """Convert files one by one in new processes, as a shell loop does."""
    out.mkdir(exist_ok=True)
    for path in paths:
        target = str(out / f"{Path(path).stem}.bvh")
        run_process(["-m", "viewer", "convert", path, "-o", target, "--force"], is_quiet=True)


def median(costs: list[Cost], kind: str) -> float:
    """Return the median of one field of the costs in seconds."""
    return statistics.median(getattr(one, kind) for one in costs)


def per_item(costs: list[Cost], start: list[Cost], count: int) -> tuple[float, float]:
    """Return the processor time of one item and that of starting the workers."""
    few, many = median(start, "work") * WORKERS, median(costs, "work") * count
    each = (many - few) / (count - WORKERS)
    return each, few - WORKERS * each


def report(costs: dict[str, list[Cost]], count: int) -> None:
    """Print rates, and ratios of wall time and processor time."""
    loop, warm, empty = (costs[name] for name in ("shell loop", "one process", "empty job"))
    for name in ("shell loop", "one process"):
        rate, work = 1.0 / median(costs[name], "wall"), 1e3 * median(costs[name], "work")
        print(f"  {name:<18} {rate:7.1f} items/s, {work:7.1f} ms of processor time per item")
    one = median(warm, "work")
    for name in ("two workers", "two Dask workers"):
        rate = 1.0 / median(costs[name], "wall")
        each, start = per_item(costs[name], costs[f"{name}, start"], count)
        print(f"  {name:<18} {rate:7.1f} items/s, {1e3 * each:7.1f} ms of processor time per item, "
              f"{start:.1f} s for their start")  # fmt: skip
        wall = median(warm, "wall") / median(costs[name], "wall")
        work = WORKERS * FILES * one / (start + FILES * each)
        said(f"{name} / one process", wall, work, 1.8)
        print(f"  once started: {WORKERS * one / each:.2f} by processor time")
    wall = median(loop, "wall") / median(warm, "wall")
    said("one process / shell loop", wall, median(loop, "work") / one, 10.0)
    least = 1e3 * median(empty, "work")
    verdict = "met" if least < 5.0 else "MISSED"
    print(f"  overhead: {least:.2f} ms of processor time per item (goal: below 5, {verdict})\n")


def said(name: str, wall: float, work: float, goal: float) -> None:
    """Print a ratio and whether it meets its goal by either measure."""
    verdict = "met" if max(wall, work) >= goal else "MISSED"
    print(f"  {name}: {wall:.2f}, by processor time {work:.2f} (goal: {goal:g}, {verdict})")


def main() -> None:
    """Measure in interleaved rounds."""
    numbers = [int(word) for word in sys.argv[1:] if word.isdecimal()]
    count, n_frames, rounds = [*numbers, *(FILES, 120, ROUNDS)[len(numbers) :]]
    os.environ["PYTHONPYCACHEPREFIX"] = CACHE.name  # used by the workers
    with tempfile.TemporaryDirectory(prefix="viewer-bench-") as name:
        folder = Path(name)
        paths = write(folder / "in", count, n_frames)
        converted(paths[:5], folder / "first", 0)  # imports
        works = works_of(paths, folder)
        costs: dict[str, list[Cost]] = {name: [] for name in works}
        for _ in range(rounds):
            for name, (work, each) in works.items():
                costs[name].append(cost(work, each))
    load = os.getloadavg()[0]
    title = f"{count} conversions of {n_frames} frames to .bvh"
    print(f"{title}, load {load:.1f} on {os.cpu_count()} cores")
    report(costs, count)


def works_of(paths: list[str], folder: Path) -> dict[str, tuple[Callable[[], object], int]]:
    """Return the measured functions and their numbers of items."""

    def batch(count: int, workers: int, cluster: str = "") -> tuple[Callable[[], object], int]:
        out = folder / f"out-{workers}{cluster}"
        return lambda: converted(paths[:count], out, workers, cluster), count

    report = folder / "r.jsonl"
    count = len(paths)
    return {
        "shell loop": (lambda: looped(paths[:LOOPED], folder / "loop"), LOOPED),
        "one process": batch(count, 0),
        "two workers, start": batch(WORKERS, WORKERS),
        "two workers": batch(count, WORKERS),
        "two Dask workers, start": batch(WORKERS, WORKERS, "local"),
        "two Dask workers": batch(count, WORKERS, "local"),
        "empty job": (
            lambda: viewer.batch(paths, nothing, report=report, workers=0, force=True),
            count,
        ),
    }


if __name__ == "__main__":
    main()
