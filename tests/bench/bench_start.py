"""Whole commands from start to exit, compared with minimal programs that do the same.

Times are processor times of the processes, which hardly depend on other programs and include
software drivers. A first round fills the cache of parsed numbers.

Elapsed times are printed too; they mean something only on a machine that does nothing else.

Idle threads of OpenBLAS busy-wait after numpy is imported; ``viewer`` shortens that time, the
minimal programs do not. So each of them is also measured with the same setting, which shows the
cost of the rest of the program.

Limits, in ms of processor time of the main thread on two 2.5 GHz cores:

- ``viewer info``: 10 for Python, 67 for numpy, 16 for 78 modules of this project at 0.2 each, 10
  for argparse, signals and typing, 5 for the file. Python cannot load these modules faster.
- ``viewer render``: 36 for 141 modules of this project, 7 for pyrr, 12 to read the files, 7 for the
  camera, 9 to detect that the surface is closed (which saves as much when it is drawn), 12 to skin,
  9 for background and grid, 12 for mipmaps, 12 to free Python's objects at exit. A minimal program
  has none of these; it spends 35 more because it uses Pillow instead of isal.
"""

import io
import json
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from measure import ROOT, interleaved, median_ratio, report, run_process
from PIL import Image

from viewer.media.png import encode_png

FORBIDDEN = ("imgui_bundle", "glfw", "scipy")
PIG = ROOT.parent / "shared" / "data" / "pig" / "core_txt_files"
SKELETON = ROOT / "assets" / "samples" / "fox.skel"

# This program runs a script in a process in which idle threads of OpenBLAS sleep.
ASLEEP = """
import os, runpy, sys
os.environ["OPENBLAS_THREAD_TIMEOUT"] = "20"
if sys.argv[1:]:
    del sys.argv[0]
    runpy.run_path(sys.argv[0], run_name="__main__")
else:
    import numpy
"""

LIST_MODULES = """
import json, sys
from viewer.cli import run
before = set(sys.modules)
code = run(sys.argv[1:])
sizes = {}
for name in sys.modules:
    top = name.partition('.')[0]
    if top not in sys.stdlib_module_names and not top.startswith('__'):
        sizes[top] = sizes.get(top, 0) + 1
print(json.dumps([code, sizes, sorted(n for n in sys.modules if n.startswith('viewer.'))]))
"""


def main(rounds: int = 11) -> None:
    """Print the ratios, the time to encode an image, and the imported modules."""
    baseline = str(Path(__file__).parent / "references" / "baseline.py")
    with tempfile.TemporaryDirectory() as folder:
        picture = str(Path(folder) / "picture.png")
        command = ["render", "-o", picture, "--force", "--size", "1280x720", "--quality", "draft"]
        compare(
            "process start to PNG, bundled figure, 1280 x 720",
            {
                "viewer render": ["-m", "viewer", *command],
                "baseline": [baseline, picture],
                "baseline, idle threads asleep": ["-c", ASLEEP, baseline, picture],
            },
            rounds,
            1.3,
        )
        encoding(picture, rounds)
        if PIG.is_dir():
            draws = ["-m", "viewer", *command, str(PIG)]
            runs = {"viewer render": draws, "baseline": [baseline, picture]}
            compare("the same, PIG from text, 1280 x 720", runs, rounds, 1.8)
            runs = {"without the cache": [*draws, "--no-cache"], "with the cache": draws}
            compare("PIG from text, without and with the cache", runs, rounds)
        listed(command)
    info = ["-m", "viewer", "info", str(SKELETON)]
    runs = {
        "viewer info": info,
        "numpy": ["-c", "import numpy"],
        "numpy, idle threads asleep": ["-c", ASLEEP],
    }
    compare("viewer info of a small file", runs, rounds, 1.4)


def compare(title: str, runs: Mapping[str, list[str]], rounds: int, goal: float = 0.0) -> None:
    """Print the processor times of programs, and the ratios of the first to the others."""
    times: dict[str, list[float]] = {name: [] for name in runs}
    elapsed: dict[str, list[float]] = {name: [] for name in runs}

    def timed(name: str) -> Callable[[], None]:
        def run() -> None:
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            seconds, _ = run_process(runs[name])
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            used = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
            times[name].append(1e3 * used)
            elapsed[name].append(1e3 * seconds)

        return run

    interleaved({name: timed(name) for name in runs}, rounds)
    # The first round compiles modules and fills caches.
    kept = {name: values[1:] for name, values in times.items()}
    waited = {name: values[1:] for name, values in elapsed.items()}
    first, second, *others = runs
    report(title, kept, (first, second), goal)
    report("  elapsed, on all cores", waited, (first, second), goal)
    for other in others:
        print(f"  {first} / {other}: {median_ratio(kept, first, other):.2f}\n")


def encoding(picture: str, rounds: int) -> None:
    """Print the time to write an image as PNG, compared with Pillow at its fastest level."""
    with Image.open(picture) as opened:
        pixels = np.array(opened.convert("RGBA"))

    def pillow() -> None:
        Image.fromarray(pixels).save(io.BytesIO(), "PNG", compress_level=1)

    times = interleaved({"encode_png": lambda: encode_png(pixels), "Pillow": pillow}, rounds)
    report("encoding that image as PNG (goal: at most 12 ms)", times, ("encode_png", "Pillow"))


def listed(command: list[str]) -> None:
    """Print the packages and modules that the command imported."""
    listing = subprocess.run(
        [sys.executable, "-c", LIST_MODULES, *command],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    _, packages, own = json.loads(listing.stdout.splitlines()[-1])
    shown = ", ".join(f"{name} ({count})" for name, count in sorted(packages.items()))
    print(f"  packages imported (modules): {shown}")
    print(f"  of ours: {', '.join(name.removeprefix('viewer.') for name in own)}")
    found = [name for name in FORBIDDEN if name in packages]
    print(f"  {', '.join(FORBIDDEN)}: {'IMPORTED: ' + ', '.join(found) if found else 'none'}\n")


if __name__ == "__main__":
    main()
