"""A chain of joints with bones and a mesh that grow with a blend shape by known lengths."""

import numpy as np

from viewer.rigs.blendshapes import BlendShapes, JointRegressor
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import translation_matrix
from viewer.rigs.mesh import Mesh
from viewer.rigs.motion.sampled_animation import SampledAnimation, sample_animation
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor
from viewer.rigs.skeleton import ball_skeleton
from viewer.rigs.skin import skin_from_lists

NAMES = ("low", "middle", "high")
JOINTS = np.array([[0.0, 0, 0], [0, 1, 0], [0, 2, 0]])
POSITIONS = np.array([[0.0, 0, 0], [0, 1, 0], [0, 2, 0], [0, 3, 0]])
GROWTH = np.array([[0.0, 0, 0], [0, 0.1, 0], [0, 0.2, 0], [0, 0.5, 0]])
WEIGHTS = np.array([0.0, 0.5, -0.25, 1.0, 0.75])
WORST = 3
"""The frame with the largest difference in shape from the first frame."""


def chain(unit: str = "m") -> Figure:
    """Return three joints stacked a metre apart, with bones that grow by 0.1 m per unit of weight.
    One vertex is at each joint and follows it; the last is a metre above the highest joint, follows
    that joint, and moves by 0.5 m per unit of weight.
    """
    every = np.arange(3, dtype=np.int32)
    rows = [[(0, 1.0)], [(1, 1.0)], [(2, 1.0)], [(2, 1.0)]]
    return Figure(
        "chain",
        Mesh(POSITIONS, np.tile([0.0, 0, 1], (4, 1)), np.array([[0, 1, 2], [1, 2, 3]])),
        ball_skeleton(NAMES, np.array([-1, 0, 1]), JOINTS),
        skin_from_lists(rows, translation_matrix(-JOINTS)),
        blend_shapes=BlendShapes(("grow",), GROWTH[None]),
        joint_regressor=JointRegressor(3, every, every, np.ones(3)),
        unit=unit,
    )


def chain_animation(unit: str = "m", weights=WEIGHTS, **tracks) -> SampledAnimation:
    """Return the chain with the root rotated by 90 degrees about z in all frames."""
    count = len(weights)
    turns = np.zeros((count, 3, 4))
    turns[..., 3] = 1.0
    turns[:, 0] = [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]
    clip = SampledClip(
        "growing",
        Timing(10.0, np.arange(count)),
        turns,
        shape_weights=np.asarray(weights, dtype=float)[:, None],
        **tracks,
    )
    return sample_animation(Actor(chain(unit), clip=clip))
