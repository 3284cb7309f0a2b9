"""Measurements for all benchmarks: interleaved rounds, ratios, processes."""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# The cache of compiled modules, as in an installed program; the first round fills it.
CACHE = tempfile.TemporaryDirectory(prefix="viewer-bench-")
# Readers are measured without the cache of parsed numbers; child processes have a separate cache.
os.environ["VIEWER_CACHE"] = "off"


def interleaved(
    work: Mapping[str, Callable[[], object]],
    rounds: int,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, list[float]]:
    """Time each function once per round in turn; return milliseconds by name."""
    times: dict[str, list[float]] = {name: [] for name in work}
    for number in range(rounds + 1):
        for name, run in work.items():
            started = clock()
            run()
            if number:  # the first round fills caches
                times[name].append(1e3 * (clock() - started))
    return times


def report(
    title: str, times: Mapping[str, Sequence[float]], ratio: tuple[str, str], goal: float = 0.0
):
    """Print medians with their spread, and the median of the ratios; a goal of 0 means none."""
    print(title)
    for name, values in times.items():
        ordered = sorted(values)
        low, high = ordered[len(ordered) // 10], ordered[-1 - len(ordered) // 10]
        print(f"  {name:<44} {statistics.median(values):9.2f} ms  ({low:.2f}..{high:.2f})")
    measured = median_ratio(times, *ratio)
    verdict = "met" if measured <= goal else "MISSED"
    wanted = f" (goal: at most {goal:g}, {verdict})" if goal else ""
    print(f"  {ratio[0]} / {ratio[1]}: {measured:.2f}{wanted}\n")


def median_ratio(times: Mapping[str, Sequence[float]], first: str, second: str) -> float:
    """Return the median of first / second within one round."""
    pairs = zip(times[first], times[second], strict=True)
    return statistics.median(a / b for a, b in pairs)


def run_process(arguments: Sequence[str], is_quiet: bool = False) -> tuple[float, float]:
    """Run Python with arguments; return its wall time in seconds and its peak memory in MB.
    ``is_quiet`` drops its warnings.
    """
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONPYCACHEPREFIX": CACHE.name}
    environment["VIEWER_CACHE"] = str(Path(CACHE.name) / "arrays")
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    started = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, *arguments],
        env=environment,
        cwd=ROOT,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL if is_quiet else None,
    )
    _, status, usage = os.wait4(process.pid, 0)
    took = time.perf_counter() - started
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{' '.join(arguments)}: exit code {process.returncode}")
    return took, usage.ru_maxrss / (1e3 if sys.platform != "darwin" else 1e6)
