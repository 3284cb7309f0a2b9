"""Quaternions, compared with rotation matrices and closed forms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.rig.geometry.quaternion import (
    between,
    multiply,
    rotation_vector_to_quaternion,
    slerp,
)
from viewer.rig.geometry.rotation import quaternion_to_matrix, rotation_vector_to_matrix

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
        from viewer.rig.geometry.rotation import matrix_to_quaternion

        found = slerp(matrix_to_quaternion(a), matrix_to_quaternion(b), fraction)
        assert_allclose(quaternion_to_matrix(found), wanted, atol=1e-12)
