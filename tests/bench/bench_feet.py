"""Feet of driven figures and of captures before and after planting: sliding, distance from the
ground and sudden knees, of motions that are built from trigonometry. Files given as arguments, such
as ``.bvh``, are measured on the bundled body too.
"""

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from linting.test_held_feet import MOTIONS, path_of, slides

from viewer.loading import MotionSettings, bundled_body, load
from viewer.loading.cleaning import clean_up
from viewer.loading.settings import CleanUp
from viewer.rigs.feet.legs import legs_of
from viewer.rigs.figure import Figure
from viewer.rigs.motion.evaluation import frames_of, world_frames
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.scene import Scene

NOTES = ("F007.feet-planted", "F007.feet-gap", "X006.locked")
GROWTH, GOAL = 2.0, "knees accelerate at most twice as much, and lint finds no sliding"


def main(files: Sequence[str] = ()) -> None:
    """Print what planting and holding feet change for each motion."""
    with tempfile.TemporaryDirectory() as folder:
        paths = [path_of(name, Path(folder)) for name in MOTIONS] + [Path(name) for name in files]
        kept = [_compare(path, is_capture) for path in paths for is_capture in (False, True)]
    print(f"{sum(kept)} of {len(kept)} met the goal: {GOAL}\n")


def _compare(path: Path, is_capture: bool) -> bool:
    plain, planted = (load(path, bundled_body(), motion=MotionSettings(feet=feet))
                      for feet in (False, not is_capture))  # fmt: skip
    notes = list(planted.diagnostics)
    if is_capture:
        notes += clean_up(planted, CleanUp(locks_feet=True))
    before, after = (_knees(scene) for scene in (plain, planted))
    found = slides(planted)
    print(f"{path.stem:<12} {'--lock-feet' if is_capture else '--feet on'}")
    for note in notes:
        if note.key in NOTES:
            print(f"    {note}")
    print(
        f"    knees: {after:.0f} rad/s^2 instead of {before:.0f}" + "".join(f"; {f}" for f in found)
    )
    return after <= GROWTH * before and not found


def _knees(scene: Scene) -> float:
    """Return the largest angular acceleration of a knee, rad/s^2."""
    (actor,) = scene.actors
    clip = actor.clip
    assert isinstance(clip, SampledClip)
    rate, figure = clip.timing.frame_rate, actor.figure
    times = clip.timing.start + np.arange(clip.timing.n_frames) / rate
    points = world_frames(figure, frames_of(figure, clip, times))[..., :3, 3]
    return max(_acceleration(points, leg, rate) for leg in _legs(figure))


def _legs(figure: Figure) -> list[tuple[int, int, int]]:
    return [(leg.hip, leg.knee, leg.ankle) for leg in legs_of(figure.require_skeleton())]


def _acceleration(points: np.ndarray, leg: tuple[int, int, int], rate: float) -> float:
    hip, knee, ankle = (points[:, joint] for joint in leg)
    upper, lower = hip - knee, ankle - knee
    sines = np.linalg.norm(np.cross(upper, lower), axis=1)
    angles = np.arctan2(sines, np.einsum("fa,fa->f", upper, lower))
    return float(np.abs(np.diff(angles, 2)).max()) * rate**2


if __name__ == "__main__":
    main(sys.argv[1:])
