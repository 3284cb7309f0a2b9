import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rig.hand_made import matrix, plain_kinematics, skeleton, turn_x, turn_y, turn_z

from viewer.rig.kinematics import forward_kinematics, skinning_matrices, world_matrices
from viewer.rig.pose import rest_pose


def random_locals(n_joints, seed):
    rng = np.random.default_rng(seed)
    angles, offsets = rng.uniform(-3, 3, (n_joints, 3)), rng.uniform(-1, 1, (n_joints, 3))
    return np.array(
        [
            matrix(turn_z(z) @ turn_y(y) @ turn_x(x), offset)
            for (x, y, z), offset in zip(angles, offsets, strict=True)
        ]
    )


@pytest.mark.parametrize("n_joints", [1, 2, 3, 4, 5, 62])
def test_chain_equals_the_direct_product(n_joints):
    parents = np.arange(-1, n_joints - 1, dtype=np.int32)
    local = random_locals(n_joints, n_joints)
    expected = plain_kinematics(parents, local)
    # Offsets are at most 1.8 long, so 62 of them add up to 110, and rounding stays below 1e-12.
    assert_allclose(forward_kinematics(parents, local), expected, atol=1e-12)


@pytest.mark.slow
def test_chain_of_1000_equals_the_direct_product():
    parents = np.arange(-1, 999, dtype=np.int32)
    local = random_locals(1000, 7)
    world, expected = forward_kinematics(parents, local), plain_kinematics(parents, local)
    # 1000 products with rounding of 1e-16 at lengths of 1000.
    assert_allclose(world, expected, atol=1e-10)


def test_chain_of_unit_offsets_has_their_sum():
    parents = np.arange(-1, 999, dtype=np.int32)
    local = np.tile(matrix(None, (1.0, 0, 0)), (1000, 1, 1))
    assert forward_kinematics(parents, local)[:, 0, 3].tolist() == list(range(1, 1001))


@pytest.mark.parametrize("seed", range(10))
def test_random_tree_equals_the_direct_product(seed):
    rng = np.random.default_rng(seed)
    n_joints = int(rng.integers(1, 80))
    # A few joints become additional roots.
    parents = np.array([int(rng.integers(-1, joint)) if joint else -1 for joint in range(n_joints)])
    local = random_locals(n_joints, seed + 100)
    expected = plain_kinematics(parents, local)
    assert_allclose(forward_kinematics(parents.astype(np.int32), local), expected, atol=1e-12)


def test_star_equals_the_direct_product():
    parents = np.array([-1] + [0] * 50, dtype=np.int32)
    local = random_locals(51, 3)
    assert_allclose(
        forward_kinematics(parents, local), plain_kinematics(parents, local), atol=1e-13
    )


def test_root_placement_is_applied_last():
    parents = np.array([-1, 0, -1], dtype=np.int32)
    local = random_locals(3, 1)
    root = matrix(turn_y(0.5), (1, 2, 3))
    expected = np.array([root @ world for world in plain_kinematics(parents, local)])
    assert_allclose(forward_kinematics(parents, local, root), expected, atol=1e-14)


def test_forward_kinematics_does_not_modify_its_arguments():
    parents = np.array([-1, 0, 1], dtype=np.int32)
    local = random_locals(3, 2)
    before = local.copy()
    forward_kinematics(parents, local)
    assert parents.tolist() == [-1, 0, 1]
    assert np.array_equal(local, before)


def test_world_matrices_rotate_the_child_about_its_parent():
    # An arm of length 2 along x, on a root at (0, 1, 0) rotated by 90 degrees about z.
    arm = skeleton([-1, 0], [(0, "z", math.pi / 2)], offsets=[[0, 1, 0], [2, 0, 0]])
    world = world_matrices(arm, rest_pose(arm))
    assert_allclose(world[1, :3, 3], [0, 3, 0], atol=1e-15)
    assert_allclose(world[1, :3, :3] @ [1, 0, 0], [0, 1, 0], atol=1e-15)


def test_skinning_matrices_are_the_identity_where_the_skin_was_bound():
    world = random_locals(5, 4)
    palette = skinning_matrices(world, np.linalg.inv(world))
    assert_allclose(palette, np.tile(np.eye(4), (5, 1, 1)), atol=1e-14)
