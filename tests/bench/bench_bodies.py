"""Frames of posed bodies: pose correctives by both methods or none, dual quaternions, and PIG."""

from pathlib import Path

import bench_skinning
import numpy as np
from measure import interleaved, median_ratio, report

import viewer
from viewer.loading import bundled_body
from viewer.rendering.gpu.corrective_sums import WAYS, Way
from viewer.rendering.gpu.posed_mesh import PosedMesh
from viewer.rendering.offscreen import Offscreen, default_camera
from viewer.rendering.options import DisplayOptions
from viewer.rigs.figure import Figure
from viewer.rigs.scene import Actor, Scene, scene_box
from viewer.rigs.skinning import Skinning

SIZE = bench_skinning.SIZE
PIG = Path(__file__).resolve().parents[3] / "shared" / "data" / "pig" / "core_txt_files"


def main(rounds: int = 30) -> None:
    """Print frame times and their ratios."""
    figure = viewer.load(bundled_body()).actors[0].figure
    assert figure.mesh is not None
    times = measure(figure, rounds)
    shown = f"{figure.name}: {figure.mesh.n_vertices} vertices, 1280 x 720"
    report(shown, times, ("correctives", "no correctives"))
    for name in WAYS:
        ratio = median_ratio(times, f"skinning alone, {name}", "skinning alone, none")
        print(f"  correctives on the {name} / none, skinning alone: {ratio:.2f}")
    print(f"  DQS / LBS: {median_ratio(times, 'DQS', 'no correctives'):.2f}\n")
    if PIG.is_dir():
        pig = viewer.load(PIG).actors[0].figure
        times = bench_skinning.measure(pig, rounds)
        report("PIG, 13 influences at most", times, (*times,), bench_skinning.GOAL)


def measure(figure: Figure, rounds: int) -> dict[str, list[float]]:
    """Time frames of a changed pose, and only their skinning pass."""
    actor = Actor(figure)
    scene, rng = Scene([actor]), np.random.default_rng(1)
    camera, box = default_camera(scene, SIZE), scene_box(scene)
    dofs = actor.pose.dofs
    with Offscreen() as offscreen, offscreen.context:
        target = offscreen.target(SIZE, 1)

        def frame(skinning: Skinning) -> None:
            options = DisplayOptions(
                background="transparent", grid=False, samples=1, skinning=skinning
            )
            dofs[:] = rng.normal(0.0, 0.2, len(dofs))
            offscreen.renderer.draw(scene, camera, options, target, box)
            offscreen.context.finish()

        frame(Skinning())
        buffers = offscreen.renderer.buffers.posed_mesh(actor).mesh
        mesh = PosedMesh(offscreen.context, offscreen.renderer.programs, buffers)

        def skin(way: Way, correctives: bool) -> None:
            target.framebuffer.use()
            dofs[:] = rng.normal(0.0, 0.2, len(dofs))
            buffers.corrective_sums.way = way
            mesh.update(actor.pose, Skinning(correctives=correctives))
            offscreen.context.finish()

        work = {
            "correctives": lambda: frame(Skinning()),
            "no correctives": lambda: frame(Skinning(correctives=False)),
            "DQS": lambda: frame(Skinning("dqs", correctives=False)),
            "skinning alone, gpu": lambda: skin("gpu", True),
            "skinning alone, cpu": lambda: skin("cpu", True),
            "skinning alone, none": lambda: skin("cpu", False),
        }
        times = interleaved(work, rounds)
        mesh.release()
        return times


if __name__ == "__main__":
    main()
