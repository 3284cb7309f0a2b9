"""Cost of qualities, shadings and onion skins relative to plain drafts, and of drafts in older
code. python tests/bench/bench_quality.py [FOLDER|COMMIT] FOLDER is another checkout; COMMIT is
checked out into a temporary worktree and defaults to the commit before the tone curve. Both draw
the same drafts in alternating processes. Times are processor times, because software rendering uses
all cores.
"""

import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

from measure import ROOT, interleaved, median_ratio, report

import viewer
from viewer.loading import bundled_body, bundled_files
from viewer.rendering.offscreen import Offscreen, default_camera
from viewer.rendering.options import QUALITIES, DisplayOptions
from viewer.rendering.sampling import n_passes
from viewer.rigs.scene import Scene, scene_box

SIZE = 1280, 720
N_ONION = 6
_EQUAL = 1.03  # the noise of medians of processor time is 3 %
BEFORE_TONE = "66bc64b~1"
"""The last commit whose shading is not scene-linear."""
DRAFTS = """
import statistics, sys, time, viewer
from viewer.loading import bundled_body, bundled_files
from viewer.rendering.offscreen import Offscreen, default_camera
from viewer.rendering.options import DisplayOptions
# Older checkouts have this module in another package.
scene_box = sys.modules[type(viewer.load()).__module__].scene_box
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
            report(f"{title}, 1280 x 720, 4 samples per pixel", times, ("normal", "draft"))
            drafts = statistics.median(times["draft"])
            ratio = statistics.median(times["final"]) / drafts
            print(
                f"  final / draft: {ratio:.1f}, {ratio / passes:.2f} for each of {passes} passes\n"
            )
            _shadings(title, draw, rounds)
    _onion(rounds)
    against(BEFORE_TONE)


def _shadings(title: str, draw: Callable[[DisplayOptions], None], rounds: int) -> None:
    """Print the cost of shadings relative to Blinn-Phong, in drafts."""
    names = "phong", "pbr", "matcap"
    times = interleaved(
        {name: partial(draw, DisplayOptions(shading=name)) for name in names}, rounds
    )
    report(f"{title}, drafts by shading", times, ("pbr", "phong"))
    print(f"  matcap / phong: {median_ratio(times, 'matcap', 'phong'):.2f}\n")


def _onion(rounds: int) -> None:
    """Print the cost of translucent actors: six poses of one motion against six opaque actors."""
    opaque, ghosts = (viewer.load(*[bundled_body()] * N_ONION) for _ in range(2))
    for number, (solid, ghost) in enumerate(zip(opaque.actors, ghosts.actors, strict=True)):
        solid.placement[0, 3] = ghost.placement[0, 3] = 0.4 * number
        ghost.opacity = (number + 1.0) / N_ONION
    # A renderer keeps the buffers of only one scene.
    with Offscreen() as first, Offscreen() as second:
        camera, box = default_camera(opaque, SIZE), scene_box(opaque)

        def draw(offscreen: Offscreen, scene: Scene) -> None:
            with offscreen.context:
                target = offscreen.target(SIZE, 4)
                offscreen.renderer.draw(scene, camera, DisplayOptions(), target, box)
                target.resolve()
                offscreen.context.finish()

        work = {"onion": partial(draw, first, ghosts), "opaque": partial(draw, second, opaque)}
        title = f"{N_ONION} bodies, drafts, all but one translucent against opaque"
        report(title, interleaved(work, rounds), ("onion", "opaque"))


def against(other: str, rounds: int = 5) -> None:
    """Print the processor time of drafts in this and in another checkout, a folder or a commit."""
    if Path(other).is_dir():
        _against(Path(other), rounds)
        return
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made, "older")
        git = ["git", "-C", str(ROOT), "worktree"]
        known = (
            subprocess.run(
                ["git", "-C", str(ROOT), "rev-parse", "-q", "--verify", other],
                capture_output=True,
                check=False,
            ).returncode
            == 0
        )
        if not known:
            print(f"drafts against {other}: this checkout has no such commit\n")
            return
        subprocess.run([*git, "add", "-q", "--detach", str(folder), other], check=True)
        try:
            _against(folder, rounds)
        finally:
            subprocess.run([*git, "remove", "--force", str(folder)], check=True)


def _against(folder: Path, rounds: int) -> None:
    found: dict[str, list[float]] = {"here": [], "there": []}
    for _ in range(rounds):
        for name, root in (("there", folder), ("here", ROOT)):
            environment = {**os.environ, "PYTHONPATH": str(root)}
            command = [sys.executable, "-c", DRAFTS]
            said = subprocess.run(
                command, cwd=root, env=environment, capture_output=True, text=True, check=True
            )
            found[name].append(float(said.stdout))
    report("drafts, processor time", found, ("here", "there"), _EQUAL)


if __name__ == "__main__":
    if sys.argv[1:]:
        against(sys.argv[1])
    else:
        main()
