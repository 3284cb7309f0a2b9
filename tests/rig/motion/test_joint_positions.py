"""Joint positions computed without orientations, compared with world matrices."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.rig.figure import Figure
from viewer.rig.motion.evaluation import Frames, joint_positions, world_frames
from viewer.rig.skeleton import ball_skeleton

PARENTS = np.array([-1, 0, 1, 0, -1, 4], dtype=np.int32)


@pytest.fixture
def frames():
    rng = np.random.default_rng(0)
    n_frames, n_joints = 7, len(PARENTS)
    return Frames(
        np.arange(n_frames) / 30.0,
        np.ones(n_frames, dtype=np.bool_),
        rng.normal(size=(n_frames, n_joints, 4)),  # not of unit length
        rng.normal(size=(n_frames, n_joints, 3)),
        np.ones((1, n_joints, 3)),
        np.zeros((1, 0)),
        rng.normal(size=(n_frames, 3)),
        rng.uniform(0.5, 2.0, n_frames),
    )


@pytest.fixture
def figure():
    places = np.arange(3.0 * len(PARENTS)).reshape(-1, 3)
    return Figure("a", skeleton=ball_skeleton(tuple("abcdef"), PARENTS, places))


@pytest.mark.parametrize("is_scaled", (False, True))
def test_positions_are_those_of_the_world_matrices(figure, frames, is_scaled):
    if is_scaled:
        frames = replace(frames, scales=np.random.default_rng(1).uniform(1, 2, (7, 6, 3)))
    expected = world_frames(figure, frames)[..., :3, 3]
    # The tolerance covers rounding of products of up to three matrices with entries below 100.
    assert_allclose(joint_positions(figure, frames), expected, atol=1e-12)


def test_rotation_by_90_degrees_moves_the_child_to_the_side(figure, frames):
    half = np.sqrt(0.5)
    still = replace(
        frames,
        rotations=np.tile([0.0, 0.0, half, half], (7, 6, 1)),
        translations=np.zeros((7, 6, 3)),
        figure_scales=np.full(7, 2.0),
        figure_translations=np.tile([10.0, 0.0, 0.0], (7, 1)),
    )
    # The second joint is at (3, 3, 3) from the first, at (0, 1, 2): rotated about z to (-3, 3, 3).
    assert_allclose(joint_positions(figure, still)[:, 1], np.tile([4.0, 8.0, 10.0], (7, 1)))
