"""Rotation vectors, quaternions, Euler angles and nearest rotations, compared with closed forms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rig.hand_made import turn_x, turn_y, turn_z

from viewer.rig.geometry.rotation import (
    matrix_to_euler,
    matrix_to_quaternion,
    matrix_to_rotation_vector,
    nearest_rotations,
    quaternion_to_matrix,
    rotation_vector_to_matrix,
)

ROUNDING = 4e-15  # a dozen units in the last place of values up to 1
ANGLES = [0.0, 1e-300, 1e-9, 9.9e-5, 1.01e-4, 0.5, np.pi - 1e-9, np.pi, 4.2, 2 * np.pi, 100.0]
AXES = [
    (1, 0, 0),
    (0, 1, 0),
    (0, 0, 1),
    (-1, 0, 0),
    (1, 1, 0),
    (0, 1, -1),
    (1, 0, 1),
    (1, 1, 1),
    (1, -1, 1),
    (-3, 2, 1e-9),
]


def about(axis, angle):
    """Rotate about any axis: map the axis to z, rotate about z, and map back."""
    z = np.array(axis, dtype=float) / np.linalg.norm(axis)
    x = np.cross(z, np.eye(3)[np.abs(z).argmin()])
    x /= np.linalg.norm(x)
    frame = np.stack([x, np.cross(z, x), z], axis=1)
    return frame @ turn_z(angle) @ frame.T


def unit_axis(axis):
    return np.array(axis, dtype=float) / np.linalg.norm(axis)


def random_rotations(count, seed=0):
    """Return random rotations about all axes and by all angles, as orthonormalised frames."""
    frames, upper = np.linalg.qr(np.random.default_rng(seed).normal(size=(count, 3, 3)))
    frames *= np.sign(np.diagonal(upper, axis1=1, axis2=2))[:, None, :]
    return frames * np.sign(np.linalg.det(frames))[:, None, None]


def angle_between(first, second):
    """Return the angle between rotations from the length of their difference, 2 sqrt 2 sin(t/2)."""
    lengths = np.linalg.norm(first - second, axis=(-2, -1))
    return 2.0 * np.arcsin(np.clip(lengths / np.sqrt(8.0), 0.0, 1.0))


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("axis", AXES)
def test_rotation_vector_rotates_about_its_direction_by_its_length(axis, angle):
    found = rotation_vector_to_matrix(angle * unit_axis(axis))
    # An angle of 100 is rounded to 1e-14.
    assert_allclose(found, about(axis, angle), atol=ROUNDING * max(1.0, angle))


@pytest.mark.parametrize(("axis", "plain"), [(0, turn_x), (1, turn_y), (2, turn_z)])
def test_rotation_vector_along_an_axis_is_the_textbook_matrix(axis, plain):
    found = rotation_vector_to_matrix(4.2 * np.eye(3)[axis])
    assert_allclose(found, plain(4.2), atol=ROUNDING)


def test_zero_vector_is_the_identity_exactly():
    assert rotation_vector_to_matrix(np.zeros((2, 3))).tolist() == [np.eye(3).tolist()] * 2


def test_tiny_rotation_keeps_its_precision():
    # sin t / t is 1 to the last digit, and t^2 / 2 is smaller than that, so R = I + [r]x.
    found = rotation_vector_to_matrix(np.array([1e-9, -2e-9, 3e-9]))
    assert_allclose(found[[2, 0, 1], [1, 2, 0]], [1e-9, -2e-9, 3e-9], rtol=1e-8)
    # Near 0 the diagonal contains -t^2 / 2, which (1 - cos t) / t^2 would lose.
    found = rotation_vector_to_matrix(np.array([0.0, 0.0, 1e-6]))
    assert_allclose(found[0, 0] - 1.0, -0.5e-12, atol=1.2e-16)


def test_rotation_by_180_degrees_is_twice_the_projection_minus_the_identity():
    for axis in AXES:
        unit = unit_axis(axis)
        found = rotation_vector_to_matrix(np.pi * unit)
        assert_allclose(found, 2.0 * np.outer(unit, unit) - np.eye(3), atol=ROUNDING)


@pytest.mark.parametrize("angle", [1e-12, 1e-9, 1e-4, 0.3, 3.0, np.pi - 1e-6, np.pi - 1e-9])
@pytest.mark.parametrize("axis", AXES)
def test_rotation_vector_up_to_180_degrees_round_trips(axis, angle):
    vector = angle * unit_axis(axis)
    found = matrix_to_rotation_vector(rotation_vector_to_matrix(vector))
    assert_allclose(found, vector, atol=ROUNDING)


@pytest.mark.parametrize("axis", AXES)
def test_rotation_by_180_degrees_round_trips_up_to_its_sign(axis):
    vector = np.pi * unit_axis(axis)
    found = matrix_to_rotation_vector(rotation_vector_to_matrix(vector))
    sign = 1.0 if found @ vector > 0.0 else -1.0
    assert_allclose(sign * found, vector, atol=ROUNDING)


@pytest.mark.parametrize("axis", AXES)
def test_rotation_over_180_degrees_returns_the_shorter_rotation(axis):
    vector = matrix_to_rotation_vector(rotation_vector_to_matrix(4.2 * unit_axis(axis)))
    assert_allclose(vector, (4.2 - 2.0 * np.pi) * unit_axis(axis), atol=ROUNDING)
    whole = matrix_to_rotation_vector(rotation_vector_to_matrix(2.0 * np.pi * unit_axis(axis)))
    assert_allclose(whole, 0.0, atol=ROUNDING)


def test_matrices_round_trip_through_rotation_vectors():
    matrices = random_rotations(2_000)
    vectors = matrix_to_rotation_vector(matrices)
    assert np.linalg.norm(vectors, axis=1).max() <= np.pi
    assert_allclose(rotation_vector_to_matrix(vectors), matrices, atol=ROUNDING)


def test_matrices_round_trip_through_quaternions():
    matrices = random_rotations(5_000, seed=1)
    quaternions = matrix_to_quaternion(matrices)
    assert_allclose(np.linalg.norm(quaternions, axis=1), 1.0, atol=ROUNDING)
    assert (quaternions[:, 3] >= 0.0).all()
    assert_allclose(quaternion_to_matrix(quaternions), matrices, atol=ROUNDING)


@pytest.mark.parametrize("w", [0.0, 1e-17, 1e-9, 1e-5])
@pytest.mark.parametrize("axis", AXES)
def test_quaternions_at_and_near_180_degrees_round_trip(axis, w):
    quaternion = np.array([*unit_axis(axis), w])
    quaternion /= np.linalg.norm(quaternion)
    found = matrix_to_quaternion(quaternion_to_matrix(quaternion))
    assert abs(found @ quaternion) == pytest.approx(1.0, abs=ROUNDING)
    assert_allclose(found * np.sign(found @ quaternion), quaternion, atol=ROUNDING)


def test_conversions_keep_the_batch_shape():
    batch = np.broadcast_to(np.eye(3), (2, 5, 3, 3))
    assert matrix_to_quaternion(batch).shape == (2, 5, 4)
    assert matrix_to_rotation_vector(batch).shape == (2, 5, 3)
    assert matrix_to_euler(batch).shape == (2, 5, 3)
    assert rotation_vector_to_matrix(np.zeros((2, 5, 3))).shape == (2, 5, 3, 3)
    for none in (matrix_to_quaternion, matrix_to_rotation_vector, matrix_to_euler):
        assert len(none(np.zeros((0, 3, 3)))) == 0


def plain_euler(x, y, z):
    return turn_z(z) @ turn_y(y) @ turn_x(x)


def test_euler_angles_round_trip():
    rng = np.random.default_rng(2)
    angles = rng.uniform(-1.0, 1.0, (500, 3)) * [np.pi, 1.5, np.pi]
    matrices = np.array([plain_euler(*row) for row in angles])
    # At 0.07 from a right angle, an error in R is amplified fourteenfold.
    assert_allclose(matrix_to_euler(matrices), angles, atol=20 * ROUNDING)


def test_euler_angles_are_in_their_ranges_and_reproduce_the_rotation():
    matrices = random_rotations(1_000, seed=3)
    angles = matrix_to_euler(matrices)
    assert (np.abs(angles) <= np.array([np.pi, np.pi / 2, np.pi])).all()
    again = np.array([plain_euler(*row) for row in angles])
    assert_allclose(again, matrices, atol=ROUNDING)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("gap", [0.0, 1e-16, 1e-15, 1e-12, 1e-10, 1e-9, 1e-6])
def test_euler_angles_reproduce_the_rotation_at_a_right_angle_about_y(gap, side):
    rng = np.random.default_rng(4)
    for x, z in rng.uniform(-np.pi, np.pi, (50, 2)):
        matrix = plain_euler(x, side * (np.pi / 2 - gap), z)
        again = plain_euler(*matrix_to_euler(matrix))
        assert_allclose(again, matrix, atol=1e-12)


def test_euler_angles_of_an_exact_right_angle_are_exact():
    # Whole numbers, so both cosines of the formula are exactly 0.
    matrix = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    x, y, z = matrix_to_euler(matrix)
    assert y == pytest.approx(np.pi / 2)
    assert x - z == pytest.approx(0.0)


def random_stretch(rng):
    frame = random_rotations(1, seed=int(rng.integers(1 << 30)))[0]
    return frame @ np.diag(rng.uniform(0.2, 5.0, 3)) @ frame.T


def test_rotation_and_stretch_are_separated():
    rng = np.random.default_rng(5)
    rotations = random_rotations(200, seed=6)
    stretches = np.array([random_stretch(rng) for _ in rotations])
    found, left = nearest_rotations(rotations @ stretches)
    assert_allclose(found, rotations, atol=1e-13)  # stretches differ by a factor of up to 25
    assert_allclose(left, stretches, atol=5e-14)


def test_scale_along_axes_has_no_rotation():
    rotation, stretch = nearest_rotations(np.diag([2.0, 0.5, 7.0]))
    assert_allclose(rotation, np.eye(3), atol=ROUNDING)
    assert_allclose(stretch, np.diag([2.0, 0.5, 7.0]), atol=ROUNDING)


@pytest.mark.parametrize("shear", [0.1, 1.0, 10.0])
def test_shear_rotates_by_the_angle_of_its_polar_decomposition(shear):
    matrix = np.eye(3)
    matrix[0, 1] = shear
    rotation, stretch = nearest_rotations(matrix)
    # In the plane, the angle of R is that of the vector (m00 + m11, m10 - m01).
    assert_allclose(rotation, turn_z(np.arctan2(-shear, 2.0)), atol=ROUNDING)
    assert_allclose(stretch, stretch.T, atol=ROUNDING * (1 + shear))
    assert_allclose(rotation @ stretch, matrix, atol=ROUNDING * (1 + shear))


def test_reflection_is_split_into_a_proper_rotation_and_a_reflecting_stretch():
    # The shortest of the three axes is flipped, which gives the nearest proper rotation.
    rotation, stretch = nearest_rotations(np.diag([-1.0, 2.0, 3.0]))
    assert_allclose(rotation, np.eye(3), atol=ROUNDING)
    assert_allclose(stretch, np.diag([-1.0, 2.0, 3.0]), atol=ROUNDING)
    turned = about((1, 2, 3), 2.0)
    rotation, stretch = nearest_rotations(turned @ np.diag([4.0, -1.0, 3.0]))
    assert_allclose(rotation, turned, atol=ROUNDING)
    assert np.linalg.det(stretch) == pytest.approx(-12.0)


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_nearest_rotation_is_nearer_than_any_other(mirror):
    rng = np.random.default_rng(7)
    others = random_rotations(3_000, seed=8)
    for matrix in rng.normal(size=(20, 3, 3)):
        matrix *= mirror * np.sign(np.linalg.det(matrix))
        rotation, stretch = nearest_rotations(matrix)
        assert np.linalg.det(rotation) == pytest.approx(1.0)
        assert_allclose(rotation @ stretch, matrix, atol=1e-14)
        nearest = np.linalg.norm(matrix - rotation)
        assert nearest <= np.linalg.norm(others - matrix, axis=(1, 2)).min()


def test_singular_matrices_have_a_nearest_rotation():
    for matrix in (np.zeros((3, 3)), np.diag([1.0, 1.0, 0.0]), np.diag([0.0, 2.0, 0.0])):
        rotation, stretch = nearest_rotations(matrix)
        assert np.linalg.det(rotation) == pytest.approx(1.0)
        assert_allclose(rotation @ stretch, matrix, atol=ROUNDING)


def test_sampled_random_rotations_include_180_degrees():
    angles = angle_between(random_rotations(5_000, seed=1), np.eye(3))
    assert angles.max() > 3.1
