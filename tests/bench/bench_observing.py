"""Cost of observing edits in a large scene, relative to posing its actors. 300 actors play a
motion. In every frame the history compares the scene with its last state and follows the clock, and
a key determines whether the picture is out of date. Both must be cheap compared with posing. The
whole frame of the window is printed as well, at 320 x 200 with all panels.
"""

import numpy as np
from measure import interleaved, median_ratio, report

import viewer
from viewer.app.core.state import AppState
from viewer.app.headless import HeadlessApp
from viewer.app.pace import picture_key
from viewer.loading import bundled_body
from viewer.rendering.offscreen import default_camera
from viewer.rendering.options import DisplayOptions
from viewer.rigs.geometry.rotation import matrix_to_quaternion, rotation_vector_to_matrix
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor, Scene, scene_box

COUNT, N_FRAMES, RATE, SIZE = 300, 60, 30.0, (320, 200)
GOAL = 0.2


def instances(count: int) -> Scene:
    """Return actors in rows of twenty that play the same motion with different start times."""
    figure = viewer.load(bundled_body()).actors[0].figure
    n_joints = figure.require_skeleton().n_joints
    rng = np.random.default_rng(0)
    vectors = np.cumsum(rng.normal(0.0, 0.003, (N_FRAMES, n_joints, 3)), axis=0)
    rotations = matrix_to_quaternion(rotation_vector_to_matrix(vectors))
    clip = SampledClip("sway", Timing(RATE, np.arange(N_FRAMES, dtype=np.int32)), rotations)
    actors = []
    for number in range(count):
        actor = Actor(figure, clip=clip)
        actor.placement[:3, 3] = number % 20, 0.0, -(number // 20)
        actor.offset = number % N_FRAMES / RATE
        actors.append(actor)
    return Scene(actors)


class Observed:
    """The parts of a frame that depend on the number of actors."""

    def __init__(self, state: AppState) -> None:
        self._state = state

    def pose(self) -> None:
        """Pose all actors for the next frame of the motion."""
        clock = self._state.clock
        clock.seek((clock.time + 1.0 / RATE) % ((N_FRAMES - 1) / RATE))
        clock.pose(self._state.actor)

    def observe(self) -> None:
        """Adopt the poses that the clock has set, and look for edits."""
        state = self._state
        state.history.follow(state.update_version(), state.clock.time)
        state.observe()

    def key(self) -> None:
        """Build the key of the picture."""
        picture_key(self._state, SIZE)


def whole_frame(parts: Observed, app: HeadlessApp) -> None:
    """Pose the scene and draw the window."""
    parts.pose()
    app.step()


def main(rounds: int = 30) -> None:
    """Print the ratios."""
    print(f"{COUNT} moving actors\n")
    scene = instances(COUNT)
    camera, options = default_camera(scene, SIZE), DisplayOptions(samples=1)
    with HeadlessApp(AppState(scene, camera, options, scene_box(scene)), SIZE) as app:
        app.step()
        parts = Observed(app.state)
        work = {
            "posing": parts.pose,
            "observing edits": parts.observe,
            "picture key": parts.key,
            "whole frame": lambda: whole_frame(parts, app),
        }
        times = interleaved(work, rounds)
    report("parts of a frame", times, ("observing edits", "posing"), GOAL)
    for name in ("picture key", "whole frame"):
        print(f"  {name} / posing: {median_ratio(times, name, 'posing'):.2f}")


if __name__ == "__main__":
    main()
