"""One linear step of the pose fit, which must recover known motions."""

import numpy as np
import pytest
from autorig.rigged_shapes import arm
from numpy.testing import assert_allclose

from viewer.autorig.alignment.pose_fit import AlignedTemplate, Pairs, solve_step
from viewer.autorig.alignment.proportions import limbs_of
from viewer.rig.mesh import vertex_normals

FIGURE = arm()
LIMBS = limbs_of(FIGURE)
PARENTS = FIGURE.skeleton.parents
X = FIGURE.mesh.positions
LAID = AlignedTemplate(
    X,
    vertex_normals(X, FIGURE.mesh.triangles),
    np.array([[0.0, 0, 0], [0, 1, 0]]),
    LIMBS.axes,
)
SIZE = 2.4
NONE = np.zeros((2, 3)), np.zeros((2, 2))


def solved(targets, scales=True, before=NONE):
    every = np.arange(len(X))
    # Each vertex occurs three times with normals along x, y and z, which is equivalent to distances
    # of points.
    normals = np.repeat(np.eye(3), len(X), axis=0)
    pairs = Pairs(np.tile(every, 3), np.tile(targets, (3, 1)), normals, every, targets)
    return solve_step(LAID, LIMBS, PARENTS, pairs, SIZE, *before, scales)


def test_rotated_joint_is_found():
    turn = np.array([0.0, 0.0, 0.02])
    targets = X + LIMBS.fractions[:, 1:] * np.cross(turn, X - [0, 1, 0])
    step = solved(targets)
    assert_allclose(step.rotation_vectors, [[0, 0, 0], turn], atol=2e-4)
    assert_allclose(step.rotation, 0.0, atol=2e-4)
    assert_allclose(step.limb_growths, 0.0, atol=5e-4)


def test_overall_translation_and_scale_are_found():
    step = solved(X * 1.03 + [0.1, -0.2, 0.3])
    assert_allclose(step.growth, 0.03, atol=1e-3)
    middle = np.tile(X, (3, 1)).mean(axis=0)
    assert_allclose(step.shift, 0.03 * middle + [0.1, -0.2, 0.3], atol=1e-3)
    assert_allclose(step.rotation_vectors, 0.0, atol=1e-3)


def test_longer_limb_is_distinguished_from_overall_scale():
    fraction = LIMBS.fractions[:, 1]
    # The base is 5 % longer; its vertices stretch, and the tip moves with it.
    up = 0.05 * ((1 - fraction) * X[:, 1] + fraction)
    step = solved(X + up[:, None] * [0.0, 1.0, 0.0])
    along, across = step.limb_growths + step.growth
    assert_allclose(along[0] - along[1], 0.05, atol=5e-3)
    assert_allclose(across[0], 0.0, atol=5e-3)


def test_known_scale_is_not_changed():
    step = solved(X * 1.03, scales=False)
    assert abs(step.growth) < 1e-8 and np.abs(step.limb_growths).max() < 1e-8


def test_steps_are_bounded():
    turn = np.array([0.0, 0.0, 2.0])
    step = solved(X + LIMBS.fractions[:, 1:] * np.cross(turn, X - [0, 1, 0]))
    assert_allclose(np.linalg.norm(step.rotation_vectors[1]), 0.3)
    step = solved(3.0 * X)
    assert step.growth == 0.2


def test_unsupported_rotations_of_earlier_iterations_decay():
    # The axis of the tip is y, and a rotation about it slides a round section along itself; there
    # is only one pair, which does not constrain the tip.
    pairs = Pairs(np.array([0]), X[:1], np.array([[0.0, 0, 1.0]]), np.array([0]), X[:1])
    rotated = np.array([[0.0, 0, 0], [0, 0.1, 0]])
    step = solve_step(LAID, LIMBS, PARENTS, pairs, SIZE, rotated, np.zeros((2, 2)), True)
    # The penalties are 3e-6 on the total rotation and 1e-5 on one step, so 0.1 * 3 / 13 is
    # reverted.
    assert step.rotation_vectors[1, 1] == pytest.approx(-0.1 * 3 / 13, rel=1e-6)
