"""Animations of synthetic SMPL-family bodies, and explicit formulas for their vertices."""

import numpy as np
from builders import rotation
from plain_smpl import smpl_forward

from viewer.rigs.bodies.smpl_family import FAMILY
from viewer.rigs.figure import Figure
from viewer.rigs.motion.body_motion import BodyMotion, body_clip
from viewer.rigs.motion.sampled_animation import SampledAnimation, sample_animation
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor


def waves(*shape: int, seed: float = 0.0) -> np.ndarray:
    """Return distinct values from -0.5 to 0.5."""
    count = int(np.prod(shape))
    return 0.5 * np.sin(seed + 1.7 * np.arange(1, count + 1) ** 1.3).reshape(shape)


def family_motion(count: int, frames: int = 4, rows=None, first_frame: int = 0, **words):
    """Return a motion of all joints with large root rotations about the origin of the model."""
    vectors = waves(frames, count, 3, seed=0.1 * frames)
    vectors[:, 0] += [1.2, -0.4, 0.9]
    words = {"shape": waves(1, 10, seed=2.0), "about_origin": True, **words}
    timing = Timing(50.0, np.arange(frames) if rows is None else rows, first_frame, holds=False)
    moves = waves(frames, 3, seed=3.0)
    return BodyMotion("walk", timing, FAMILY[count].names, vectors, moves, **words)


def family_animation(
    figure: Figure, motion: BodyMotion, interpolate: bool = False
) -> SampledAnimation:
    """Return the animation of a figure for all frames of a motion."""
    clip = body_clip(motion, figure)[0]
    return sample_animation(Actor(figure, clip=clip), interpolate=interpolate)


def clip_animation(figure: Figure, clip: SampledClip) -> SampledAnimation:
    """Return the animation of a figure for a clip."""
    return sample_animation(Actor(figure, clip=clip))


def vertices_about_origin(arrays, vectors, root, move, shape=()) -> np.ndarray:
    """Return V = R X + T, for ``vectors`` that rotate all joints except the root."""
    pose = np.array(vectors)
    pose[0] = 0.0
    return smpl_forward(arrays, shape, pose)[0] @ rotation(root).T + move


def vertices_about_pelvis(arrays, vectors, move, shape=()) -> np.ndarray:
    """Return the vertices of smplx for poses and trans: the body is posed, then translated."""
    return smpl_forward(arrays, shape, vectors)[0] + move
