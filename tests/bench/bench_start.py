"""From process start to the PNG of the bundled figure, against a minimal program."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from measure import ROOT, interleaved, report, run_process

FORBIDDEN = ("imgui_bundle", "glfw", "scipy")
GOAL = 1.5

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
    """Print the ratio and what was imported."""
    baseline = str(Path(__file__).parent / "baseline.py")
    with tempfile.TemporaryDirectory() as folder:
        picture = str(Path(folder) / "picture.png")
        command = ["render", "-o", picture, "--force", "--size", "1280x720", "--quality", "draft"]
        work = {
            "viewer render": lambda: run_process(["-m", "viewer", *command]),
            "baseline": lambda: run_process([baseline, picture]),
        }
        times = interleaved(work, rounds)
        report("process start to PNG, bundled figure, 1280 x 720", times, (*work,), GOAL)
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
