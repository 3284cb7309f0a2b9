"""Export of 1,000 frames of the bundled body, and the cost of comparing the written file."""

import sys
import tempfile
from pathlib import Path
from unittest.mock import patch

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from exporting import export_frames
from measure import interleaved, report

import viewer
from viewer.exporters import ExportOptions
from viewer.loading import bundled_body
from viewer.rigs.geometry.quaternion import rotation_vector_to_quaternion
from viewer.rigs.motion.sampled_animation import SampledAnimation, sample_animation
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor

FRAMES = 1000


def walk() -> SampledAnimation:
    """Return a motion in which every joint swings at a different rate, by at most half a radian."""
    figure = viewer.load(bundled_body()).actors[0].figure
    assert figure.skeleton is not None
    rng, count = np.random.default_rng(0), figure.skeleton.n_joints
    phases, rates, sizes = (rng.uniform(*ends, (count, 3)) for ends in ((0, 6), (3, 12), (0, 0.5)))
    times = np.arange(FRAMES)[:, None, None] / 30.0
    turns = rotation_vector_to_quaternion(sizes * np.sin(rates * times + phases))
    clip = SampledClip("walk", Timing(30.0, np.arange(FRAMES)), turns)
    return sample_animation(Actor(figure, clip=clip))


def main(rounds: int = 7) -> None:
    """Print times with and without the comparison, and their ratios."""
    animation = walk()
    with tempfile.TemporaryDirectory() as folder:
        for key, name, lost in (
            ("gltf", "a.glb", "gltf_losses"),
            ("bvh", "a.bvh", "losses.FileLosses.look"),
        ):
            path = Path(folder) / name

            def export(key: str = key, path: Path = path) -> None:
                export_frames(animation, path, key, ExportOptions())

            def alone(key: str = key, path: Path = path, lost: str = lost) -> None:
                with patch(f"viewer.exporters.{key}.{lost}", lambda *_: []):
                    export_frames(animation, path, key, ExportOptions())

            times = interleaved({"compared": export, "not compared": alone}, rounds)
            shown = f"{key}: {FRAMES} frames of {animation.figure.name}"
            report(shown, times, ("compared", "not compared"))


if __name__ == "__main__":
    main()
