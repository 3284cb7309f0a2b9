"""Cost of each render quality relative to draft; and of draft relative to an older checkout.

    python tests/bench/bench_quality.py [FOLDER]

FOLDER holds another checkout, such as a worktree of an older commit: both draw the same drafts in
processes that take turns, and processor time counts, as software rendering uses all cores.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
from functools import partial
from pathlib import Path

from measure import ROOT, interleaved, report

import viewer
from viewer.loading import bundled_body, bundled_files
from viewer.rendering.offscreen import Offscreen, default_camera
from viewer.rendering.options import QUALITIES, DisplayOptions
from viewer.rendering.sampling import n_passes
from viewer.rig.scene import scene_box

SIZE = 1280, 720
DRAFTS = """
import statistics, time, viewer
from viewer.loading import bundled_body, bundled_files
from viewer.rendering.offscreen import Offscreen, default_camera
from viewer.rendering.options import DisplayOptions
from viewer.rig.scene import scene_box
times = []
with Offscreen() as offscreen, offscreen.context:
    for files in (bundled_files(), [bundled_body()]):
        scene, options = viewer.load(*files), DisplayOptions()
        camera, box = default_camera(scene, (1280, 720)), scene_box(scene)
        target = offscreen.target((1280, 720), 4)
        for turn in range(30):
            camera.azimuth += 3
            started = time.process_time()
            offscreen.renderer.draw(scene, camera, options, target, box)
            offscreen.context.finish()
            times.append(time.process_time() - started)
print(1e3 * statistics.median(times))
"""


def main(rounds: int = 9) -> None:
    """Print the ratios."""
    with Offscreen() as offscreen, offscreen.context:
        for title, files in (("fox", bundled_files()), ("body", [bundled_body()])):
            scene = viewer.load(*files)
            camera, box = default_camera(scene, SIZE), scene_box(scene)

            def draw(options: DisplayOptions, scene=scene, camera=camera, box=box) -> None:
                target = offscreen.target(SIZE, options.samples)
                offscreen.renderer.draw(scene, camera, options, target, box)
                target.resolve()
                offscreen.context.finish()

            work = {name: partial(draw, DisplayOptions(quality=name)) for name in QUALITIES}
            times = interleaved(work, rounds)
            passes = n_passes(DisplayOptions(quality="final"))
            report(f"{title}, 1280 x 720, 4 samples a pixel", times, ("normal", "draft"))
            drafts = statistics.median(times["draft"])
            ratio = statistics.median(times["final"]) / drafts
            print(
                f"  final / draft: {ratio:.1f}, {ratio / passes:.2f} for each of {passes} passes\n"
            )


def against(folder: Path, rounds: int = 5) -> None:
    """Print processor time of drafts here and in another checkout."""
    found: dict[str, list[float]] = {"here": [], "there": []}
    for _ in range(rounds):
        for name, root in (("there", folder), ("here", ROOT)):
            environment = {**os.environ, "PYTHONPATH": str(root)}
            command = [sys.executable, "-c", DRAFTS]
            said = subprocess.run(
                command, cwd=root, env=environment, capture_output=True, text=True, check=True
            )
            found[name].append(float(said.stdout))
    report("drafts, processor time", found, ("here", "there"), 1.0)


if __name__ == "__main__":
    if sys.argv[1:]:
        against(Path(sys.argv[1]))
    else:
        main()
