import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rigs.hand_made import matrix, plain_kinematics, skeleton, turn_x, turn_y, turn_z

from viewer.errors import RigError
from viewer.rigs.kinematics import (
    forward_kinematics,
    joint_worlds,
    skinning_matrices,
    world_matrices,
)
from viewer.rigs.pose import Pose, local_matrices, rest_pose

ROUNDING = 1e-15  # a few units in the last place of numbers up to 1


def printed_matrix(x, y, z, offset):
    """The matrix L as printed in the specification, entry by entry."""
    cx, sx, cy, sy, cz, sz = *trig(x), *trig(y), *trig(z)
    ox, oy, oz = offset
    return np.array(
        [
            [cy * cz, sx * sy * cz - cx * sz, cx * sy * cz + sx * sz, ox],
            [cy * sz, sx * sy * sz + cx * cz, cx * sy * sz - sx * cz, oy],
            [-sy, sx * cy, cx * cy, oz],
            [0, 0, 0, 1],
        ]
    )


def trig(angle):
    return math.cos(angle), math.sin(angle)


def euler_joint(order, values, offset=(0.0, 0.0, 0.0)):
    dofs = [(0, axis, value) for axis, value in zip(order, values, strict=True)]
    return skeleton([-1], dofs, offsets=[offset])


@pytest.mark.parametrize(
    "angles", [(0, 0, 0), (0.1, 0.2, 0.3), (-1.5, 2.0, 3.0), (math.pi / 2,) * 3, (9.0, -8.0, 7.0)]
)
def test_local_matrix_matches_the_documented_one(angles):
    joint = euler_joint("xyz", angles, (1.0, -2.0, 3.0))
    local = local_matrices(joint, rest_pose(joint))
    assert_allclose(local[0], printed_matrix(*angles, (1.0, -2.0, 3.0)), atol=ROUNDING)


def test_rotations_by_90_degrees_about_x_then_y_then_z_match_hand_calculation():
    # For the z axis, x rotates it to -y, y preserves that, and z rotates -y to +x.
    joint = euler_joint("xyz", [math.pi / 2] * 3)
    local = local_matrices(joint, rest_pose(joint))[0]
    assert_allclose(local[:3, :3] @ [0, 0, 1], [1, 0, 0], atol=ROUNDING)


@pytest.mark.parametrize("order", ["xyz", "xzy", "yxz", "yzx", "zxy", "zyx", "zx", "y", "xyx"])
def test_first_row_of_the_dof_table_is_applied_first(order):
    values = [0.4, -0.9, 1.7][: len(order)]
    joint = euler_joint(order, values)
    expected = np.eye(3)
    for axis, value in zip(order, values, strict=True):
        expected = {"x": turn_x, "y": turn_y, "z": turn_z}[axis](value) @ expected
    assert_allclose(local_matrices(joint, rest_pose(joint))[0, :3, :3], expected, atol=ROUNDING)


def test_dof_rows_of_several_joints_may_be_interleaved():
    rows = [(1, "z", 0.3), (0, "y", 0.5), (1, "tx", 4.0), (1, "x", -0.7), (0, "x", 0.2)]
    both = skeleton([-1, 0], rows, offsets=[[0, 0, 0], [1, 1, 1]])
    local = local_matrices(both, rest_pose(both))
    assert_allclose(local[0], matrix(turn_x(0.2) @ turn_y(0.5)), atol=ROUNDING)
    assert_allclose(local[1], matrix(turn_x(-0.7) @ turn_z(0.3), (5, 1, 1)), atol=ROUNDING)


def test_translation_dofs_are_added_to_the_offset_without_rotation():
    rows = [(0, "tx", 1.0), (0, "z", math.pi / 2), (0, "ty", 2.0), (0, "tz", 3.0), (0, "tx", 0.5)]
    joint = skeleton([-1], rows, offsets=[[10, 20, 30]])
    local = local_matrices(joint, rest_pose(joint))[0]
    assert local[:3, 3].tolist() == [11.5, 22, 33]
    assert_allclose(local[:3, :3], turn_z(math.pi / 2), atol=ROUNDING)


def test_joints_without_dofs_keep_their_rest_transform():
    joints = skeleton([-1, 0], [], offsets=[[0, 1, 0], [2, 0, 0]])
    local = local_matrices(joints, rest_pose(joints))
    assert local.tolist() == [matrix(None, (0, 1, 0)).tolist(), matrix(None, (2, 0, 0)).tolist()]


def test_local_matrix_multiplies_quaternion_then_dofs_then_scale():
    joint = euler_joint("x", [0.6], (1.0, 2.0, 3.0))
    pose = rest_pose(joint)
    pose.rotations[0] = 0, 0, math.sin(0.45), math.cos(0.45)
    pose.scales[0] = 2, 3, 4
    expected = matrix(turn_z(0.9) @ turn_x(0.6) @ np.diag([2.0, 3, 4]), (1, 2, 3))
    assert_allclose(local_matrices(joint, pose)[0], expected, atol=4 * ROUNDING)


def test_rest_pose_is_clamped():
    joint = skeleton(
        [-1], [(0, "x", -3.0, -2.0, 0.0), (0, "y", 1.0, 0.0, 0.0), (0, "z", 0.0, 1, 2)]
    )
    assert rest_pose(joint).dofs.tolist() == [-2, 0, 1]


def test_rest_poses_share_no_array_with_each_other_or_the_skeleton():
    joint = euler_joint("x", [0.5])
    pose = rest_pose(joint)
    pose.dofs[0] = pose.translations[0, 0] = 7.0
    assert rest_pose(joint).dofs.tolist() == [0.5]
    assert joint.rest_translations[0, 0] == 0.0


def test_parts_of_a_pose_are_views_and_copy_what_is_assigned():
    pose = rest_pose(skeleton([-1, 0], [(0, "x", 0.0), (1, "z", 0.0)]))
    pose.dofs, pose.translations = np.array([1.0, 2.0]), np.arange(3.0, 9.0).reshape(2, 3)
    quaternions = np.arange(9.0, 17.0).reshape(2, 4)
    pose.rotations, pose.scales = quaternions, np.arange(17.0, 23.0).reshape(2, 3)
    pose.figure_translation = np.array([23.0, 24.0, 25.0])
    assert pose.values.tolist() == list(range(1, 26))
    quaternions[:] = 0.0
    pose.scales[1, 2] *= 2.0
    held = pose.rotations
    held[0, 0] = -9.0
    assert (pose.rotations[0, 0], pose.rotations[1, 3], pose.scales[1, 2]) == (-9.0, 16.0, 44.0)
    with pytest.raises(RigError, match=r"dofs: expected numbers of shape \(2,\)"):
        pose.dofs = np.zeros(3)


@pytest.mark.parametrize(
    ("values", "n_dofs"), [(np.zeros(16), 2), (np.zeros((5, 3)), 2), (np.zeros(12), -1)]
)
def test_poses_refuse_values_that_are_not_those_of_whole_joints(values, n_dofs):
    assert Pose(np.zeros(15), 2).rotations.shape == (1, 4)
    with pytest.raises(RigError, match=r"^values|^n_dofs"):
        Pose(values, n_dofs)


@pytest.mark.parametrize("values", [[0] * 15, np.zeros(15, dtype=int), np.zeros(15, np.float32)])
def test_values_of_a_pose_become_float64(values):
    pose = Pose(values, 2)
    pose.dofs[1] = 0.1
    assert pose.values.tolist() == [0.0, 0.1, *[0.0] * 13]


def test_copy_of_a_pose_shares_no_array():
    pose = rest_pose(euler_joint("x", [0.5]))
    other = pose.copy()
    other.dofs[0], other.translations[0], other.rotations[0], other.scales[0] = 1, 1, 1, 2
    assert (pose.dofs[0], pose.translations[0, 0], pose.rotations[0, 0], pose.scales[0, 0]) == (
        0.5,
        0.0,
        0.0,
        1.0,
    )


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


def test_many_poses_of_joints_in_any_order_equal_the_direct_products():
    """Joints 1 and 3 come before their parents; joint 4 is a second root."""
    parents = np.array([-1, 3, 0, 2, -1, 4], dtype=np.int32)
    local = np.stack([random_locals(6, seed) for seed in range(3)])
    found = joint_worlds(parents, local[..., :3, :3], local[..., :3, 3])
    for pose, world in zip(local, found, strict=True):
        expected = pose.copy()
        for joint in (2, 3, 1, 5):
            expected[joint] = expected[parents[joint]] @ pose[joint]
        assert_allclose(world, expected, atol=1e-13)
