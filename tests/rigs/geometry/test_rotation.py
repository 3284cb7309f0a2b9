"""Rotations, quaternions and transforms."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rigs.hand_made import matrix, turn_x, turn_y, turn_z

from viewer.rigs.geometry.quaternion import (
    between,
    multiply,
    rotation_vector_to_quaternion,
    slerp,
)
from viewer.rigs.geometry.rotation import (
    axis_rotations,
    matrix_to_euler,
    matrix_to_quaternion,
    matrix_to_rotation_vector,
    nearest_rotations,
    quaternion_to_matrix,
    rotation_vector_to_matrix,
)
from viewer.rigs.geometry.transform import apply_transform, translation_matrix
from viewer.rigs.pose import axis_products

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


VECTOR_ROUNDING = 4e-15  # a dozen units in the last place of values up to 1
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


@pytest.mark.parametrize("axis", AXES)
def test_rotation_vector_rotates_about_its_direction_by_its_length(axis):
    for angle in ANGLES:
        found = rotation_vector_to_matrix(angle * unit_axis(axis))
        # An angle of 100 is rounded to 1e-14.
        assert_allclose(found, about(axis, angle), atol=VECTOR_ROUNDING * max(1.0, angle))


@pytest.mark.parametrize(("axis", "plain"), [(0, turn_x), (1, turn_y), (2, turn_z)])
def test_rotation_vector_along_an_axis_is_the_textbook_matrix(axis, plain):
    found = rotation_vector_to_matrix(4.2 * np.eye(3)[axis])
    assert_allclose(found, plain(4.2), atol=VECTOR_ROUNDING)


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
        assert_allclose(found, 2.0 * np.outer(unit, unit) - np.eye(3), atol=VECTOR_ROUNDING)


@pytest.mark.parametrize("axis", AXES)
def test_rotation_vector_up_to_180_degrees_round_trips(axis):
    for angle in (1e-12, 1e-9, 1e-4, 0.3, 3.0, np.pi - 1e-6, np.pi - 1e-9):
        vector = angle * unit_axis(axis)
        found = matrix_to_rotation_vector(rotation_vector_to_matrix(vector))
        assert_allclose(found, vector, atol=VECTOR_ROUNDING)


@pytest.mark.parametrize("axis", AXES)
def test_rotation_by_180_degrees_round_trips_up_to_its_sign(axis):
    vector = np.pi * unit_axis(axis)
    found = matrix_to_rotation_vector(rotation_vector_to_matrix(vector))
    sign = 1.0 if found @ vector > 0.0 else -1.0
    assert_allclose(sign * found, vector, atol=VECTOR_ROUNDING)


@pytest.mark.parametrize("axis", AXES)
def test_rotation_over_180_degrees_returns_the_shorter_rotation(axis):
    vector = matrix_to_rotation_vector(rotation_vector_to_matrix(4.2 * unit_axis(axis)))
    assert_allclose(vector, (4.2 - 2.0 * np.pi) * unit_axis(axis), atol=VECTOR_ROUNDING)
    whole = matrix_to_rotation_vector(rotation_vector_to_matrix(2.0 * np.pi * unit_axis(axis)))
    assert_allclose(whole, 0.0, atol=VECTOR_ROUNDING)


def test_matrices_round_trip_through_rotation_vectors():
    matrices = random_rotations(2_000)
    vectors = matrix_to_rotation_vector(matrices)
    assert np.linalg.norm(vectors, axis=1).max() <= np.pi
    assert_allclose(rotation_vector_to_matrix(vectors), matrices, atol=VECTOR_ROUNDING)


def test_matrices_round_trip_through_quaternions():
    matrices = random_rotations(5_000, seed=1)
    quaternions = matrix_to_quaternion(matrices)
    assert_allclose(np.linalg.norm(quaternions, axis=1), 1.0, atol=VECTOR_ROUNDING)
    assert (quaternions[:, 3] >= 0.0).all()
    assert_allclose(quaternion_to_matrix(quaternions), matrices, atol=VECTOR_ROUNDING)


@pytest.mark.parametrize("w", [0.0, 1e-17, 1e-9, 1e-5])
@pytest.mark.parametrize("axis", AXES)
def test_quaternions_at_and_near_180_degrees_round_trip(axis, w):
    quaternion = np.array([*unit_axis(axis), w])
    quaternion /= np.linalg.norm(quaternion)
    found = matrix_to_quaternion(quaternion_to_matrix(quaternion))
    assert abs(found @ quaternion) == pytest.approx(1.0, abs=VECTOR_ROUNDING)
    assert_allclose(found * np.sign(found @ quaternion), quaternion, atol=VECTOR_ROUNDING)


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
    assert_allclose(matrix_to_euler(matrices), angles, atol=20 * VECTOR_ROUNDING)


def test_euler_angles_are_in_their_ranges_and_reproduce_the_rotation():
    matrices = random_rotations(1_000, seed=3)
    angles = matrix_to_euler(matrices)
    assert (np.abs(angles) <= np.array([np.pi, np.pi / 2, np.pi])).all()
    again = np.array([plain_euler(*row) for row in angles])
    assert_allclose(again, matrices, atol=VECTOR_ROUNDING)


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
    assert_allclose(rotation, np.eye(3), atol=VECTOR_ROUNDING)
    assert_allclose(stretch, np.diag([2.0, 0.5, 7.0]), atol=VECTOR_ROUNDING)


@pytest.mark.parametrize("shear", [0.1, 1.0, 10.0])
def test_shear_rotates_by_the_angle_of_its_polar_decomposition(shear):
    matrix = np.eye(3)
    matrix[0, 1] = shear
    rotation, stretch = nearest_rotations(matrix)
    # In the plane, the angle of R is that of the vector (m00 + m11, m10 - m01).
    assert_allclose(rotation, turn_z(np.arctan2(-shear, 2.0)), atol=VECTOR_ROUNDING)
    assert_allclose(stretch, stretch.T, atol=VECTOR_ROUNDING * (1 + shear))
    assert_allclose(rotation @ stretch, matrix, atol=VECTOR_ROUNDING * (1 + shear))


def test_reflection_is_split_into_a_proper_rotation_and_a_reflecting_stretch():
    # The shortest of the three axes is flipped, which gives the nearest proper rotation.
    rotation, stretch = nearest_rotations(np.diag([-1.0, 2.0, 3.0]))
    assert_allclose(rotation, np.eye(3), atol=VECTOR_ROUNDING)
    assert_allclose(stretch, np.diag([-1.0, 2.0, 3.0]), atol=VECTOR_ROUNDING)
    turned = about((1, 2, 3), 2.0)
    rotation, stretch = nearest_rotations(turned @ np.diag([4.0, -1.0, 3.0]))
    assert_allclose(rotation, turned, atol=VECTOR_ROUNDING)
    assert np.linalg.det(stretch) == pytest.approx(-12.0)


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_nearest_rotation_is_nearer_than_any_other(mirror):
    rng = np.random.default_rng(7)
    others = random_rotations(3_000, seed=8)
    for given in rng.normal(size=(20, 3, 3)):
        given *= mirror * np.sign(np.linalg.det(given))
        rotation, stretch = nearest_rotations(given)
        assert np.linalg.det(rotation) == pytest.approx(1.0)
        assert_allclose(rotation @ stretch, given, atol=1e-14)
        nearest = np.linalg.norm(given - rotation)
        assert nearest <= np.linalg.norm(others - given, axis=(1, 2)).min()


def test_singular_matrices_have_a_nearest_rotation():
    for given in (np.zeros((3, 3)), np.diag([1.0, 1.0, 0.0]), np.diag([0.0, 2.0, 0.0])):
        rotation, stretch = nearest_rotations(given)
        assert np.linalg.det(rotation) == pytest.approx(1.0)
        assert_allclose(rotation @ stretch, given, atol=VECTOR_ROUNDING)


def test_sampled_random_rotations_include_180_degrees():
    angles = angle_between(random_rotations(5_000, seed=1), np.eye(3))
    assert angles.max() > 3.1


RANDOM = np.random.default_rng(5)


def about_z(degrees):
    half = np.radians(degrees) / 2
    return np.array([0.0, 0.0, np.sin(half), np.cos(half)])


@pytest.mark.parametrize("size", [0.0, 1e-300, 1e-12, 1e-5, 0.3, np.pi, 6.0, 40.0])
def test_quaternions_rotate_vectors_like_their_matrices(size):
    axes = RANDOM.normal(size=(20, 3))
    vectors = size * axes / np.linalg.norm(axes, axis=1, keepdims=True)
    found = rotation_vector_to_quaternion(vectors)
    assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-15)
    assert_allclose(
        quaternion_to_matrix(found), rotation_vector_to_matrix(vectors), atol=3e-15 * (1 + size)
    )


def test_smallest_rotation_points_one_vector_at_another():
    starts = np.vstack([RANDOM.normal(size=(20, 3)), np.eye(3), np.eye(3)])
    ends = np.vstack([RANDOM.normal(size=(20, 3)), -2.0 * np.eye(3), 3.0 * np.eye(3)])
    found = between(starts, ends)
    assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-15)
    turned = np.einsum("nab,nb->na", quaternion_to_matrix(found), starts)
    sizes = np.linalg.norm(ends, axis=1) / np.linalg.norm(starts, axis=1)
    assert_allclose(turned * sizes[:, None], ends, atol=1e-14)
    # The smallest rotation has the angle between the vectors: cos = 2 w^2 - 1.
    cosines = np.einsum("na,na->n", starts, ends) / np.prod(
        [np.linalg.norm(each, axis=1) for each in (starts, ends)], axis=0
    )
    assert_allclose(2.0 * found[:, 3] ** 2 - 1.0, cosines, atol=1e-14)
    assert_allclose(between(np.zeros(3), np.ones(3)), [0.0, 0.0, 0.0, 1.0], atol=0)


def test_product_is_the_product_of_matrices():
    first, second = RANDOM.normal(size=(2, 30, 4))
    wanted = quaternion_to_matrix(first) @ quaternion_to_matrix(second)
    assert_allclose(quaternion_to_matrix(multiply(first, second)), wanted, atol=1e-14)
    assert_allclose(multiply(about_z(30), about_z(50)), about_z(80), atol=1e-15)


@pytest.mark.parametrize(
    ("start", "end", "fraction", "expected"),
    [
        (0, 90, 0.5, 45),
        (0, 90, 0.1, 9),
        (10, 170, 0.25, 50),
        (0, 200, 0.5, -80),  # the shorter arc is 160 degrees in the opposite direction
        (350, 10, 0.5, 360),
        (20, 20 + 1e-7, 0.5, 20 + 5e-8),
        (20, 20, 0.7, 20),
    ],
)
def test_slerp_takes_the_shorter_arc_at_constant_speed(start, end, fraction, expected):
    found = slerp(about_z(start), about_z(end), fraction)
    assert_allclose(
        quaternion_to_matrix(found), quaternion_to_matrix(about_z(expected)), atol=1e-13
    )


def test_slerp_returns_its_ends_exactly():
    first, second = RANDOM.normal(size=(2, 50, 4))
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second /= np.linalg.norm(second, axis=1, keepdims=True)
    assert_allclose(slerp(first, second, 0.0), first, atol=1e-15)
    assert_allclose(
        quaternion_to_matrix(slerp(first, second, 1.0)), quaternion_to_matrix(second), atol=1e-14
    )


def test_slerp_agrees_with_the_power_of_the_relative_rotation():
    # An independent formula: R(u) = R0 exp(u log(R0^T R1)), with the angle from the trace.
    for _ in range(20):
        a, b = rotation_vector_to_matrix(RANDOM.uniform(-1.2, 1.2, (2, 3)))
        relative = a.T @ b
        angle = np.arccos(np.clip((np.trace(relative) - 1) / 2, -1, 1))
        axis = np.array(
            [
                relative[2, 1] - relative[1, 2],
                relative[0, 2] - relative[2, 0],
                relative[1, 0] - relative[0, 1],
            ]
        )
        axis /= np.linalg.norm(axis)
        fraction = RANDOM.uniform()
        wanted = a @ rotation_vector_to_matrix(fraction * angle * axis)
        from viewer.rigs.geometry.rotation import matrix_to_quaternion

        found = slerp(matrix_to_quaternion(a), matrix_to_quaternion(b), fraction)
        assert_allclose(quaternion_to_matrix(found), wanted, atol=1e-12)


@pytest.mark.parametrize("shape", [(), (2, 3)])
def test_products_equal_those_multiplied_one_by_one(shape):
    rng = np.random.default_rng(0)
    # Joints 0 and 3 have three rotations, 1 has none, 2 has five; the DOFs alternate.
    joints = np.array([2, 0, 3, 2, 2, 0, 3, 2, 0, 2, 3], dtype=np.int32)
    axes = rng.integers(0, 3, len(joints)).astype(np.int32)
    rows = 2 * np.arange(len(joints))
    dofs = rng.uniform(-3.0, 3.0, (*shape, 2 * len(joints)))
    expected = np.broadcast_to(np.eye(3), (*shape, 4, 3, 3)).copy()
    for joint, axis, row in zip(joints, axes, rows, strict=True):
        rotation = axis_rotations(int(axis), dofs[..., row])
        expected[..., joint, :, :] = rotation @ expected[..., joint, :, :]
    found = axis_products(4, joints, axes, rows).at(dofs)
    assert found.shape == (*shape, 4, 3, 3)
    assert_allclose(found, expected, atol=1e-15)


def test_products_are_exact_at_all_angles():
    """The half-angle formula has poles at odd multiples of pi, which no float equals."""
    one, quarters = np.zeros(1, dtype=np.int32), np.arange(-8, 9) * (math.pi / 2)
    angles = np.concatenate([quarters, np.nextafter(quarters, 9.0), [1e-300, 1e-9, 3.0, 1e6]])
    found = axis_products(1, one, one, np.zeros(1, np.intp)).at(angles[:, None])[:, 0]
    expected = [[[1, 0, 0], [0, c, -s], [0, s, c]] for c, s in map(cos_and_sin, angles.tolist())]
    assert_allclose(found, expected, atol=4e-16)
    # Small angles keep their relative precision.
    assert_allclose(found[-4:-2, 2, 1], angles[-4:-2], rtol=1e-15)


def cos_and_sin(angle: float) -> tuple[float, float]:
    return math.cos(angle), math.sin(angle)


def test_joints_without_rotations_have_the_identity():
    none = np.zeros(0, dtype=np.int32)
    products = axis_products(2, none, none, np.zeros(0, dtype=np.intp))
    assert_array_equal(products.at(np.ones(3)), [np.eye(3)] * 2)


def test_translation_matrix_has_the_offset_in_its_last_column():
    assert translation_matrix(np.array([1.0, 2, 3])).tolist() == [
        [1, 0, 0, 1],
        [0, 1, 0, 2],
        [0, 0, 1, 3],
        [0, 0, 0, 1],
    ]


def test_translation_matrices_keep_the_batch_shape():
    batch = translation_matrix(np.arange(12.0).reshape(2, 2, 3))
    assert batch.shape == (2, 2, 4, 4)
    assert batch[1, 0, :, 3].tolist() == [6, 7, 8, 1]


def test_apply_transform_rotates_before_translating():
    quarter = matrix(np.round(turn_z(np.pi / 2)), (10, 0, 0))
    points = np.array([[1.0, 0, 5], [0, 1, 0]])
    assert apply_transform(quarter, points).tolist() == [[10, 1, 5], [9, 0, 0]]


def test_apply_transform_accepts_one_point_and_no_points():
    move = translation_matrix(np.array([1.0, 0, 0]))
    assert apply_transform(move, np.zeros(3)).tolist() == [1, 0, 0]
    assert apply_transform(move, np.zeros((0, 3))).shape == (0, 3)
