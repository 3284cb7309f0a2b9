"""Quaternion features of STAR and SUPR, compared with half-angle formulas."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rig.hand_made import mesh, skeleton

from viewer.errors import RigError
from viewer.rig.blendshapes import Correctives
from viewer.rig.bodies.pose_features import QuaternionFeature
from viewer.rig.figure import Figure
from viewer.rig.pose import rest_pose
from viewer.rig.shape import pose_weights, rest_positions
from viewer.rig.skin import skin_from_lists

ROUNDING = 1e-12


def chain():
    dofs = [(joint, axis, 0.0) for joint in range(3) for axis in "xyz"]
    return skeleton([-1, 0, 1], dofs)


def test_weights_are_half_angle_sines_and_cosines():
    bones = chain()
    pose = rest_pose(bones)
    pose.dofs[[0, 4, 8]] = 0.4, -1.0, 3.0  # x of the root, y and z of the others
    pose.shape_weights = np.array([9.0, 0.7])
    found = QuaternionFeature(3, has_root=False, shape=1).weights(bones, pose)
    second = [0.0, np.sin(-0.5), 0.0, np.cos(0.5) - 1.0]
    third = [0.0, 0.0, np.sin(1.5), np.cos(1.5) - 1.0]
    assert_allclose(found, [*second, *third, 0.7], atol=ROUNDING)
    root = QuaternionFeature(3, has_root=True).weights(bones, pose)
    assert_allclose(root[:4], [np.sin(0.2), 0.0, 0.0, np.cos(0.2) - 1.0], atol=ROUNDING)
    assert len(root) == QuaternionFeature(3, has_root=True).n_weights == 12


def test_rest_pose_has_zero_weights_and_missing_shapes_are_zero():
    bones = chain()
    found = QuaternionFeature(3, has_root=False, shape=1).weights(bones, rest_pose(bones))
    assert_allclose(found, np.zeros(9), atol=ROUNDING)


def test_feature_correctives_move_the_rest_mesh():
    bones = chain()
    offsets = np.zeros((9, 3, 3))
    offsets[1, 0] = 1.0, 2.0, 3.0  # sine of the second joint about y
    offsets[8, 2] = 0.0, 0.0, 5.0  # shape
    figure = Figure(
        "arm",
        mesh=mesh([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]),
        skeleton=bones,
        skin=skin_from_lists([[(0, 1.0)]] * 3, np.tile(np.eye(4), (3, 1, 1))),
        correctives=Correctives(offsets, QuaternionFeature(3, has_root=False, shape=0)),
    )
    pose = rest_pose(bones)
    pose.dofs[4], pose.shape_weights = np.pi / 3, np.array([2.0])
    assert pose_weights(figure.correctives, bones, pose).shape == (9,)
    moved = rest_positions(figure, figure.mesh, pose) - figure.mesh.positions
    assert_allclose(moved, [[0.5, 1.0, 1.5], [0, 0, 0], [0, 0, 10]], atol=ROUNDING)


def test_correctives_without_a_row_per_feature_weight_are_refused():
    with pytest.raises(RigError, match=r"\(8, 3, 3\)"):
        Correctives(np.zeros((9, 3, 3)), QuaternionFeature(3, has_root=False))
