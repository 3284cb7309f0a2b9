"""Transfer of joints with the surrounding surface."""

import numpy as np
from autorig.rigged_shapes import tube
from numpy.testing import assert_allclose, assert_array_equal

from viewer.autorig.transfer.joint_transfer import (
    boundary_weights,
    outside,
    surface_shifts,
    transfer_joints,
)
from viewer.rig.blendshapes import JointRegressor
from viewer.rig.skin import skin_from_lists

PARENTS = np.array([-1, 0, 1])
JOINTS = np.array([[0.0, 0, 0], [0, 1, 0], [0, 2, 0]])


def table(regressor, n_vertices):
    dense = np.zeros((regressor.n_joints, n_vertices))
    np.add.at(dense, (regressor.joints, regressor.vertices), regressor.weights)
    return dense


def test_boundary_has_weights_of_both_a_joint_and_its_parent():
    influences = [
        [(0, 1.0)],
        [(0, 0.25), (1, 0.75)],
        [(1, 0.5), (2, 0.5)],
        [(2, 0.5), (0, 0.5)],
        [(1, 0.2), (0, 0.8), (1, 0.2)],  # a joint listed twice is used once with the sum
    ]
    skin = skin_from_lists(influences, np.tile(np.eye(4), (3, 1, 1)))
    child = [0.0, 0.25 * 0.75, 0.0, 0.0, 0.4 * 0.8]
    expected = [child, child, [0.0, 0.0, 0.25, 0.0, 0.0]]
    assert_allclose(table(boundary_weights(skin, PARENTS), 5), expected, atol=1e-15)


def test_skin_without_influences_has_no_boundary():
    skin = skin_from_lists([[], []], np.tile(np.eye(4), (3, 1, 1)))
    assert len(boundary_weights(skin, PARENTS).weights) == 0


def regressor():
    # Joint 1 depends on vertices 0 and 1, joint 2 on vertex 2 only, and the root on none.
    return JointRegressor(3, [1, 1, 2], [0, 1, 2], [0.5, 0.5, 1.0])


SHIFTS = np.array([[1.0, 0, 0], [0, 2, 0], [0, 0, 3]])


def test_joints_move_by_the_weighted_mean_of_their_surface():
    found = transfer_joints(JOINTS, PARENTS, regressor(), SHIFTS, np.array([True, True, True]))
    assert_allclose(found.positions, [[0, 0, 0], [0.5, 2, 0], [0, 2, 3]])
    assert found.transferred.tolist() == [False, True, True]
    assert found.measurable.tolist() == [False, True, True]


def test_joint_without_surface_follows_its_parent():
    found = transfer_joints(JOINTS, PARENTS, regressor(), SHIFTS, np.array([True, False, False]))
    # Half of the weights of joint 1 remain, which is enough, but none of joint 2.
    assert_allclose(found.positions, [[0, 0, 0], [1, 1, 0], [1, 2, 0]])
    assert found.transferred.tolist() == [False, True, False]
    assert found.measurable.tolist() == [False, True, True]


def test_rows_that_cancel_out_are_ignored():
    rows = JointRegressor(3, [1, 1], [0, 1], [1.0, -0.9])
    found = transfer_joints(JOINTS, PARENTS, rows, SHIFTS, np.ones(3, bool))
    assert_array_equal(found.positions, JOINTS)
    assert not found.transferred.any()


def test_shifts_point_to_the_surface_and_are_used_if_it_is_close_and_similar():
    square = np.array([[-1.0, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    points = np.array([[0.0, 0.1, 0], [0, 0.9, 0], [0.2, 0.1, 0.3], [0.5, -0.1, 0]])
    normals = np.array([[0.0, 1, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0]])
    shifts, matched = surface_shifts(points, normals, square, triangles, 0.5)
    assert_allclose(shifts, [[0, -0.1, 0], [0, -0.9, 0], [0, -0.1, 0], [0, 0.1, 0]], atol=1e-15)
    assert matched.tolist() == [True, False, False, True]


def test_joints_inside_and_outside_the_mesh_are_distinguished():
    positions, triangles = tube()
    joints = np.array([[0.0, 1.0, 0.05], [0.0, 3.0, 0.0], [0.9, 1.0, 0.0]])
    assert outside(positions, triangles, joints).tolist() == [False, True, True]
    assert outside(positions, triangles[:, ::-1], joints).tolist() == [False, True, True]
