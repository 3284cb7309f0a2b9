"""Frames of a moving figure read into memory, compared with a minimal program that draws them. Both
pose, skin, draw and read 1280 x 720 pixels with the same camera; ``references/least_frame.py`` is
the minimal program. Times are processor times of all threads of the process, which include software
drivers and do not depend on other programs. The figure is PIG if its files exist, otherwise the
bundled figure.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from measure import interleaved, median_ratio, report
from references.least_frame import LeastFrame

import viewer
from viewer.rendering.offscreen import Offscreen, default_camera
from viewer.rendering.options import DisplayOptions
from viewer.rigs.kinematics import forward_kinematics, world_matrices
from viewer.rigs.pose import local_matrices
from viewer.rigs.scene import Scene, scene_box
from viewer.rigs.skeleton import FIRST_ROTATION

PIG = Path(__file__).resolve().parents[3] / "shared" / "data" / "pig" / "core_txt_files"
SIZE = 1280, 720
PLAIN = DisplayOptions(grid=False, samples=1)
CASES = (("4 samples, grid", DisplayOptions(), 4, 1.8), ("1 sample, no grid", PLAIN, 1, 1.6))
FRAMES = 5  # frames per round


def main(rounds: int = 25) -> None:
    """Print the ratios, and the times of the parts of posing."""
    scene = viewer.load(str(PIG)) if PIG.is_dir() else viewer.load()
    figure = scene.actors[0].figure
    mesh = figure.require_mesh()
    print(f"{figure.name}: {mesh.n_vertices} vertices, {figure.require_skeleton().n_joints} joints")
    for name, options, samples, goal in CASES:
        with Offscreen() as offscreen, Offscreen() as other:
            work = frames(scene, offscreen, other, options, samples)
            times = per_frame(interleaved(work, rounds, time.process_time))
        report(f"a frame into memory, {name}", times, (*times,), goal)
    kinematics(scene, rounds)


def frames(
    scene: Scene, offscreen: Offscreen, other: Offscreen, options: DisplayOptions, samples: int
) -> dict[str, Callable[[], object]]:
    """Return functions that draw ``FRAMES`` frames by the viewer and by the minimal program."""
    actor, rng = scene.actors[0], np.random.default_rng(0)
    figure, pose = actor.figure, actor.pose
    assert pose is not None
    camera, box = default_camera(scene, SIZE), scene_box(scene)
    rows = figure.require_skeleton().dof_kinds >= FIRST_ROTATION
    with other.context:
        least = LeastFrame(other.context, figure, camera, box, SIZE, samples)

    def angles() -> np.ndarray:
        return rng.normal(0.0, 0.02, (figure.require_skeleton().n_joints, 3))

    def ours() -> None:
        with offscreen.context:
            target = offscreen.target(SIZE, samples)
            for _ in range(FRAMES):
                pose.dofs[rows] = angles().ravel()
                offscreen.renderer.draw(scene, camera, options, target, box)
                target.resolve()
                target.read()

    def minimal() -> None:
        with other.context:
            for _ in range(FRAMES):
                least.frame(angles())

    return {"viewer": ours, "minimal program": minimal}


def per_frame(times: Mapping[str, Sequence[float]]) -> dict[str, list[float]]:
    """Return milliseconds per frame of the rounds."""
    return {name: [value / FRAMES for value in values] for name, values in times.items()}


def kinematics(scene: Scene, rounds: int) -> None:
    """Print the time to compute the matrices of a pose."""
    actor, rng = scene.actors[0], np.random.default_rng(1)
    skeleton, pose = actor.figure.require_skeleton(), actor.pose
    assert pose is not None
    local = local_matrices(skeleton, pose)

    def repeated(run: Callable[[], object]) -> Callable[[], None]:
        def several() -> None:
            for _ in range(FRAMES):
                pose.dofs += 1e-6 * rng.normal()
                run()

        return several

    work = {
        "DOFs to world matrices": repeated(lambda: world_matrices(skeleton, pose)),
        "local to world matrices": repeated(lambda: forward_kinematics(skeleton.parents, local)),
    }
    times = per_frame(interleaved(work, 4 * rounds, time.process_time))
    report(f"forward kinematics, {skeleton.n_joints} joints", times, (*times,))
    assert median_ratio(times, *times) > 0.0


if __name__ == "__main__":
    main()
