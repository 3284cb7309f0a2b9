import numpy as np
import pytest
from numpy.testing import assert_allclose
from rig.hand_made import turn_x, turn_y, turn_z

from viewer.rig.geometry.rotation import axis_rotations, quaternion_to_matrix

ROUNDING = 1e-15  # a few units in the last place of numbers up to 1


@pytest.mark.parametrize(
    ("axis", "start", "end"),
    [(0, [0, 1, 0], [0, 0, 1]), (1, [0, 0, 1], [1, 0, 0]), (2, [1, 0, 0], [0, 1, 0])],
)
def test_axis_rotation_is_right_handed(axis, start, end):
    assert_allclose(axis_rotations(axis, np.array(np.pi / 2)) @ start, end, atol=ROUNDING)


@pytest.mark.parametrize(("axis", "plain"), [(0, turn_x), (1, turn_y), (2, turn_z)])
def test_axis_rotation_is_the_textbook_matrix(axis, plain):
    angles = np.array([-7.0, -1.0, 0.0, 0.3, 2.0, 100.0])
    expected = np.array([plain(angle) for angle in angles])
    assert_allclose(axis_rotations(axis, angles), expected, atol=ROUNDING)


def test_axis_rotations_keep_the_batch_shape():
    assert axis_rotations(0, np.zeros((2, 5))).shape == (2, 5, 3, 3)
    assert axis_rotations(0, np.zeros(0)).shape == (0, 3, 3)


def test_identity_quaternion_is_the_identity_matrix():
    assert quaternion_to_matrix(np.array([0.0, 0, 0, 1])).tolist() == np.eye(3).tolist()


@pytest.mark.parametrize(("axis", "plain"), [(0, turn_x), (1, turn_y), (2, turn_z)])
def test_quaternion_is_half_the_angle_about_its_axis(axis, plain):
    quaternion = np.zeros(4)
    quaternion[axis], quaternion[3] = np.sin(0.35), np.cos(0.35)
    assert_allclose(quaternion_to_matrix(quaternion), plain(0.7), atol=ROUNDING)


def test_length_of_a_quaternion_does_not_change_the_rotation():
    # (1, 2, 3, 4) and ten times it: the same axis and angle.
    one, ten = quaternion_to_matrix(np.array([[1.0, 2, 3, 4], [10, 20, 30, 40]]))
    assert_allclose(one, ten, atol=ROUNDING)
    assert_allclose(one @ one.T, np.eye(3), atol=ROUNDING)
    assert_allclose(np.linalg.det(one), 1.0, atol=4 * ROUNDING)


def test_quaternion_and_its_negative_are_the_same_rotation():
    quaternion = np.array([0.1, -0.2, 0.3, 0.9])
    assert_allclose(quaternion_to_matrix(quaternion), quaternion_to_matrix(-quaternion), atol=0)


def test_quaternion_120_degrees_about_the_diagonal_permutes_the_axes():
    matrix = quaternion_to_matrix(np.array([1.0, 1, 1, 1]))
    assert matrix.tolist() == [[0, 0, 1], [1, 0, 0], [0, 1, 0]]


def test_quaternions_keep_the_batch_shape():
    batch = np.tile([0.0, 0, 0, 2.0], (4, 2, 1))
    assert quaternion_to_matrix(batch).shape == (4, 2, 3, 3)
