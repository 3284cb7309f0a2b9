"""Skeleton styles and outlines, compared with the same picture with boxes or without an outline.
The bundled body has a new pose in each frame, at 1280 x 720 with one sample. Frames alternate, so
that the speed of the machine cancels out.
"""

from collections.abc import Callable

import numpy as np
from measure import interleaved, report

import viewer
from viewer.loading import bundled_body
from viewer.rendering.offscreen import Offscreen, default_camera
from viewer.rendering.options import DisplayOptions
from viewer.rigs.scene import Scene, scene_box

SIZE, ROUNDS = (1280, 720), 30


def frames(offscreen: Offscreen, scene: Scene, options: DisplayOptions) -> Callable[[], object]:
    """Return a function that changes the pose, draws the scene, and waits for the image."""
    camera, box = default_camera(scene, SIZE), scene_box(scene)
    rng = np.random.default_rng(0)

    def run() -> None:
        pose = scene.actors[0].pose
        pose.dofs[:] = rng.normal(0.0, 0.15, len(pose.dofs))
        offscreen.render(scene, SIZE, camera, options, box)

    return run


def main() -> None:
    """Print the medians and ratios."""
    scene = viewer.load(bundled_body())
    with Offscreen() as offscreen:
        styles = ("boxes", "octahedra", "sticks", "axes")
        work = {
            style: frames(offscreen, scene, DisplayOptions(show="both", samples=1, bones=style))
            for style in styles
        }
        for name, outline in (("no outline", False), ("outline of the body", True)):
            options = DisplayOptions(samples=1, outline=outline)
            work[name] = frames(offscreen, scene, options)
        times = interleaved(work, ROUNDS)
    report("Styles of skeletons", {style: times[style] for style in styles}, ("octahedra", "boxes"))
    pair = ("outline of the body", "no outline")
    report("Outlines", {name: times[name] for name in pair}, pair)


if __name__ == "__main__":
    main()
