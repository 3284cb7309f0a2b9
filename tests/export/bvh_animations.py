"""Animations for BVH exports, and comparison of joint positions with an independent reader."""

from pathlib import Path

import faults
import numpy as np
from builders import quaternions
from exporting import export_frames
from plain_bvh import PlainBvh

from viewer.export import ExportOptions
from viewer.rig.figure import Figure
from viewer.rig.motion.body_motion import BodyMotion, body_clip
from viewer.rig.motion.evaluation import world_frames
from viewer.rig.motion.sampled_animation import SampledAnimation, sample_animation
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.timing import Timing
from viewer.rig.scene import Actor
from viewer.rig.skeleton import Skeleton, ball_skeleton

TENTH = 1e-5  # in metres, 0.01 mm
TO_Y = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # z up to y up: (x, y, z) -> (x, z, -y)


def body_animation(
    figure: Figure, count: int = 12, rows: list[int] | None = None, seed: int = 0
) -> SampledAnimation:
    """Return a body with large random rotations, a constant shape and some missing frames."""
    rng = np.random.default_rng(seed)
    timing = Timing(30.0, np.arange(count) if rows is None else np.array(rows))
    names = figure.skeleton.names
    vectors = rng.uniform(-1.5, 1.5, (count, len(names), 3))
    shape = rng.normal(0, 1, (1, 10))
    motion = BodyMotion("walk", timing, names, vectors, rng.normal(0, 2, (count, 3)), True, shape)
    return sample_animation(Actor(figure, clip=body_clip(motion, figure)[0]))


def rig_animation(skeleton: Skeleton, count: int = 6, seed: int = 0, **changes) -> SampledAnimation:
    rng = np.random.default_rng(seed)
    turns = quaternions(rng.uniform(-2, 2, (count, skeleton.n_joints, 3)))
    clip = SampledClip("dance", Timing(25.0, np.arange(count)), turns, **changes)
    return sample_animation(Actor(Figure("rig", skeleton=skeleton), clip=clip))


def chain(count: int = 3) -> Skeleton:
    names = tuple("abcdefgh"[:count])
    return ball_skeleton(names, np.arange(count) - 1, np.arange(count)[:, None] * [0.0, 1.0, 0.5])


def write(animation: SampledAnimation, folder: Path, **options) -> tuple[PlainBvh, list[str]]:
    path = folder / "out.bvh"
    notes = faults.lines(export_frames(animation, path, "bvh", ExportOptions(**options)))
    return PlainBvh(path), [note.replace(str(path), "PATH") for note in notes]


def joints_of(animation: SampledAnimation) -> np.ndarray:
    """Return the joint positions of the animation, (F, J, 3)."""
    return world_frames(animation.figure, animation.frames)[..., :3, 3]


def assert_places(
    found: PlainBvh,
    animation: SampledAnimation,
    factor: float = 1.0,
    turn=None,
    atol: float = TENTH,
    skip: int = 0,
) -> None:
    wanted = joints_of(animation) * factor
    wanted = wanted if turn is None else wanted @ turn.T
    assert found.n_frames == len(wanted) + skip
    for frame in np.flatnonzero(animation.frames.present):
        places = found.places(int(frame) + skip)
        for joint, name in enumerate(animation.figure.skeleton.names):
            np.testing.assert_allclose(places[name], wanted[frame, joint], atol=atol * factor)
