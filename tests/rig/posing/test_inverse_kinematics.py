"""Inverse kinematics, compared with the closed form of a two-link arm and finite differences."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.errors import RigError
from viewer.rig.kinematics import world_matrices
from viewer.rig.pose import rest_pose
from viewer.rig.posing.inverse_kinematics import chain_above, place_jacobian, reach
from viewer.rig.skeleton import Skeleton, ball_skeleton

NO_LIMIT = (-np.inf, np.inf)


def arm(limits: dict[int, tuple[float, float]] | None = None) -> Skeleton:
    """Return two links of length 1 along x; each joint rotates about z."""
    chosen = limits or {}
    return Skeleton(
        names=("shoulder", "elbow", "hand"),
        parents=np.array([-1, 0, 1]),
        rest_translations=np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 0]]),
        rest_rotations=np.tile([0.0, 0, 0, 1], (3, 1)),
        rest_scales=np.ones((3, 3)),
        dof_joints=np.array([0, 1]),
        dof_kinds=np.array([5, 5]),
        rest_dofs=np.clip(np.zeros(2), *np.array([chosen.get(i, NO_LIMIT) for i in (0, 1)]).T),
        dof_limits=np.array([chosen.get(i, NO_LIMIT) for i in (0, 1)]),
    )


def hand_at(skeleton: Skeleton, dofs: np.ndarray) -> np.ndarray:
    """Return the position of the hand by trigonometry."""
    first, second = dofs
    return np.array(
        [np.cos(first) + np.cos(first + second), np.sin(first) + np.sin(first + second), 0.0]
    )


def test_arm_reaches_a_target_by_the_law_of_cosines():
    skeleton = arm()
    pose = rest_pose(skeleton)
    pose.dofs[:] = 0.3, 0.4
    found = reach(skeleton, pose, 2, np.array([1.0, 1.0, 0.0]))
    assert found.distance < 1e-6
    # |target|^2 = 2 = 2 + 2 cos(elbow), so the elbow is at a right angle.
    assert_allclose(abs(found.dofs[1]), np.pi / 2, atol=1e-5)
    assert_allclose(hand_at(skeleton, found.dofs), [1, 1, 0], atol=1e-6)
    assert_allclose(pose.dofs, [0.3, 0.4])  # the start pose is unchanged


def test_unreachable_target_is_pointed_at_with_a_straight_arm():
    skeleton = arm()
    pose = rest_pose(skeleton)
    pose.dofs[:] = 0.5, 1.0
    found = reach(skeleton, pose, 2, np.array([0.0, 5.0, 0.0]), rounds=300)
    assert_allclose(found.distance, 3.0, atol=1e-3)
    assert_allclose(hand_at(skeleton, found.dofs), [0, 2, 0], atol=0.05)


def test_straight_arm_bends_for_a_target_towards_its_shoulder():
    skeleton = arm()
    found = reach(skeleton, rest_pose(skeleton), 2, np.array([1.0, 0.0, 0.0]), rounds=200)
    assert found.distance < 1e-5
    assert_allclose(abs(found.dofs[1]), 2 * np.pi / 3, atol=1e-4)  # an equilateral triangle


def test_elbow_bends_only_to_the_side_that_its_limits_allow():
    skeleton = arm({1: (0.0, 2.5)})
    found = reach(skeleton, rest_pose(skeleton), 2, np.array([1.0, 0.0, 0.0]), rounds=200)
    assert found.distance < 1e-5
    assert_allclose(found.dofs[1], 2 * np.pi / 3, atol=1e-4)


def test_reached_limit_is_reported_and_another_joint_compensates():
    skeleton = arm({1: (0.0, 1.0)})
    pose = rest_pose(skeleton)
    pose.dofs[:] = 0.1, 0.5
    # With the elbow at its limit the hand is sqrt(2 + 2 cos 1) from the shoulder. It can reach any
    # point of that circle, but no point nearer to the shoulder.
    radius = np.sqrt(2 + 2 * np.cos(1.0))
    found = reach(skeleton, pose, 2, np.array([0.0, 1.0, 0.0]), rounds=300)
    assert_allclose(found.distance, radius - 1.0, atol=1e-4)
    assert found.limited.tolist() == [1]
    assert_allclose(found.dofs[0], np.pi / 2 - 0.5, atol=1e-2)


def test_start_outside_its_limits_is_clamped():
    skeleton = arm({1: (0.0, 1.0)})
    pose = rest_pose(skeleton)
    pose.dofs[1] = 2.0
    assert 0 <= reach(skeleton, pose, 2, np.array([2.0, 0, 0])).dofs[1] <= 1


def test_jacobian_matches_finite_differences():
    rng = np.random.default_rng(3)
    skeleton = ball_skeleton(("a", "b", "c", "d"), np.array([-1, 0, 1, 2]), rng.normal(size=(4, 3)))
    turned = rng.normal(size=(4, 4))
    skeleton = replace(
        skeleton,
        rest_scales=rng.uniform(0.5, 2.0, (4, 3)),
        rest_rotations=turned / np.linalg.norm(turned, axis=1, keepdims=True),
    )
    pose = rest_pose(skeleton)
    pose.dofs[:] = rng.normal(size=12)
    rows = np.arange(9, dtype=np.int32)
    found = place_jacobian(skeleton, pose, world_matrices(skeleton, pose), 3, rows)
    for row in rows:
        ends = []
        for step in (1e-5, -1e-5):
            moved = pose.copy()
            moved.dofs[row] += step
            ends.append(world_matrices(skeleton, moved)[3, :3, 3])
        assert_allclose(found[:, row], (ends[0] - ends[1]) / 2e-5, atol=1e-8)


def test_chain_has_the_nearest_rotatable_joints():
    skeleton = ball_skeleton(tuple("abcd"), np.array([-1, 0, 1, 2]), np.zeros((4, 3)))
    assert chain_above(skeleton, 3, 2).tolist() == [2, 1]
    assert chain_above(skeleton, 3, 9).tolist() == [2, 1, 0]
    limits = skeleton.dof_limits.copy()
    limits[6:9] = 0.0  # joint c is locked
    assert chain_above(replace(skeleton, dof_limits=limits), 3, 2).tolist() == [1, 0]


def test_chain_of_one_does_not_move_the_joints_above_it():
    skeleton = arm()
    found = reach(skeleton, rest_pose(skeleton), 2, np.array([1.0, 1.0, 0.0]), length=1)
    assert_allclose(found.dofs, [0.0, np.pi / 2], atol=1e-5)


def test_root_has_no_chain():
    with pytest.raises(RigError, match=r"^no joint above shoulder can rotate$"):
        reach(arm(), rest_pose(arm()), 0, np.zeros(3))
