"""Inverse kinematics, compared with the closed form of a two-link arm and finite differences."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.errors import RigError
from viewer.rigs.constraints.constraint import Constraint
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.pose import dof_rotations, rest_pose
from viewer.rigs.posing.inverse_kinematics import (
    ChainPosition,
    FigurePosition,
    Reach,
    Reaching,
    chain_above,
    position_of,
)
from viewer.rigs.skeleton import FIRST_ROTATION, Skeleton, ball_skeleton

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


def hinged_arm(limits: np.ndarray) -> Skeleton:
    """Return a shoulder that rotates about all axes, a hinge, and a hand: links 0.3 and 0.25 m."""
    joints = np.array([[0.0, 1.4, 0], [0.3, 1.4, 0], [0.55, 1.4, 0]])
    skeleton = ball_skeleton(("shoulder", "elbow", "hand"), np.array([-1, 0, 1]), joints)
    return replace(skeleton, dof_limits=np.concatenate([limits, np.zeros((3, 2))]))


FREE_SHOULDER = np.radians([[-400, 400], [-400, 400], [-400, 400]])
NARROW_SHOULDER = np.radians([[-60, 60], [-90, 45], [-80, 80]])
HINGE = np.radians([[0, 0], [-150, 0], [0, 0]])


def drag(skeleton: Skeleton, start: np.ndarray, targets: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return DOFs (F, 9) and distances (F,) of a hand that is dragged to targets (F, 3)."""
    pose = rest_pose(skeleton)
    pose.dofs[:6] = start
    reaching = Reaching(skeleton, pose, 2)
    found = [reaching.follow(target) for target in targets]
    return np.array([each.dofs for each in found]), np.array([each.distance for each in found])


def reached(skeleton: Skeleton, pose, joint: int, target: np.ndarray, length: int = 2) -> Reach:
    """Drag a joint to a target at once, and wait until it settles there."""
    reaching = Reaching(skeleton, pose, joint, length)
    for _ in range(300):
        found = reaching.follow(target)
        if found.is_settled:
            return found
    pytest.fail("never settled")


def angles_between(skeleton: Skeleton, dofs: np.ndarray) -> np.ndarray:
    """Return the largest angle, degrees, by which a joint rotates from each row to the next."""
    turns = dof_rotations(skeleton, dofs)
    traces = np.einsum("fjab,fjab->fj", turns[1:], turns[:-1])
    return np.degrees(np.arccos(np.clip((traces - 1.0) / 2.0, -1.0, 1.0))).max(axis=1)


def walk(seed: int, center: np.ndarray, radius: float, start: np.ndarray, count: int) -> np.ndarray:
    """Return (F, 3) points, a centimetre apart, of a random walk within a ball."""
    rng = np.random.default_rng(seed)
    points, way = [start], rng.normal(size=3)
    for _ in range(count):
        way = 0.9 * way + 0.44 * rng.normal(size=3)
        step = 0.01 * way / np.linalg.norm(way)
        if np.linalg.norm(points[-1] + step - center) > radius:
            way, step = -way, -step
        points.append(points[-1] + step)
    return np.array(points)


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
    found = reached(skeleton, pose, 2, np.array([1.0, 1.0, 0.0]))
    assert found.distance < 1e-6
    # |target|^2 = 2 = 2 + 2 cos(elbow), so the elbow is at a right angle.
    assert_allclose(abs(found.dofs[1]), np.pi / 2, atol=1e-5)
    assert_allclose(hand_at(skeleton, found.dofs), [1, 1, 0], atol=1e-6)
    assert_allclose(pose.dofs, [0.3, 0.4])  # the start pose is unchanged


def test_unreachable_target_is_pointed_at_with_a_straight_arm():
    skeleton = arm()
    pose = rest_pose(skeleton)
    pose.dofs[:] = 0.5, 1.0
    found = reached(skeleton, pose, 2, np.array([0.0, 5.0, 0.0]))
    assert_allclose(found.distance, 3.0, atol=1e-3)
    assert_allclose(hand_at(skeleton, found.dofs), [0, 2, 0], atol=0.05)


def test_straight_arm_bends_for_a_target_towards_its_shoulder():
    skeleton = arm()
    found = reached(skeleton, rest_pose(skeleton), 2, np.array([1.0, 0.0, 0.0]))
    assert found.distance < 1e-5
    assert_allclose(abs(found.dofs[1]), 2 * np.pi / 3, atol=1e-4)  # an equilateral triangle


def test_elbow_bends_only_to_the_side_that_its_limits_allow():
    skeleton = arm({1: (0.0, 2.5)})
    found = reached(skeleton, rest_pose(skeleton), 2, np.array([1.0, 0.0, 0.0]))
    assert found.distance < 1e-5
    assert_allclose(found.dofs[1], 2 * np.pi / 3, atol=1e-4)


def test_reached_limit_is_reported_and_another_joint_compensates():
    skeleton = arm({1: (0.0, 1.0)})
    pose = rest_pose(skeleton)
    pose.dofs[:] = 0.1, 0.5
    # With the elbow at its limit the hand is sqrt(2 + 2 cos 1) from the shoulder. It can reach any
    # point of that circle, but no point nearer to the shoulder.
    radius = np.sqrt(2 + 2 * np.cos(1.0))
    found = reached(skeleton, pose, 2, np.array([0.0, 1.0, 0.0]))
    # A drag settles where a step would bring the hand nearer by less than 0.1 %. The distance is
    # stationary there, so the angle is off by about the root of that.
    assert_allclose(found.distance, radius - 1.0, atol=1e-3)
    assert found.limited.tolist() == [1]
    assert_allclose(found.dofs[0], np.pi / 2 - 0.5, atol=0.03)


def test_start_outside_its_limits_is_clamped():
    skeleton = arm({1: (0.0, 1.0)})
    pose = rest_pose(skeleton)
    pose.dofs[1] = 2.0
    assert 0 <= reached(skeleton, pose, 2, np.array([2.0, 0, 0])).dofs[1] <= 1


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
    pose.translations[:] = rng.normal(size=(4, 3))
    # The DOFs of the first joint and one of the second stay, and are part of the constant maps.
    rows = np.array([4, 5, 6, 7, 8], dtype=np.int32)
    place, found = position_of(skeleton, pose, 3, rows).at(pose.dofs[rows])
    assert_allclose(place, world_matrices(skeleton, pose)[3, :3, 3], atol=1e-12)
    for column, row in zip(found.T, rows, strict=True):
        ends = []
        for step in (1e-5, -1e-5):
            moved = pose.copy()
            moved.dofs[row] += step
            ends.append(world_matrices(skeleton, moved)[3, :3, 3])
        assert_allclose(column, (ends[0] - ends[1]) / 2e-5, atol=1e-8)


@pytest.mark.parametrize("kind", [ChainPosition, FigurePosition])
def test_curvature_matches_finite_differences(kind):
    rng = np.random.default_rng(4)
    joints = rng.normal(size=(4, 3))
    skeleton = ball_skeleton(tuple("abcd"), np.array([-1, 0, 1, 2]), joints)
    skeleton = replace(skeleton, rest_scales=rng.uniform(0.5, 2.0, (4, 3)))
    pose = rest_pose(skeleton)
    pose.dofs[:] = rng.normal(size=12)
    rows, along, step = np.array([1, 4, 5, 8], dtype=np.int32), rng.normal(size=3), 1e-3

    def height(*changes: tuple[int, float]) -> float:
        moved = pose.copy()
        for row, change in changes:
            moved.dofs[row] += change
        return world_matrices(skeleton, moved)[3, :3, 3] @ along

    found = kind(skeleton, pose, 3, rows).curvature(pose.dofs[rows], along)
    for i, first in enumerate(rows.tolist()):
        for j, second in enumerate(rows.tolist()):
            both = [
                sign * other * height((first, sign * step), (second, other * step))
                for sign in (1, -1)
                for other in (1, -1)
            ]
            # Central differences of second order, with an error of about the square of the step.
            assert_allclose(found[i, j], sum(both) / (4.0 * step**2), atol=1e-4)


def test_each_call_of_a_drag_is_short_wherever_it_leads(monkeypatch):
    # Searches for another pose, of which limits need many here, are spread over calls.
    calls, at = [], ChainPosition.at
    monkeypatch.setattr(ChainPosition, "at", lambda self, x: (calls.append(1), at(self, x))[1])
    joints = np.cumsum([[0.0, 1.0, 0], *[[0.15, 0.0, 0.02]] * 5], axis=0)
    skeleton = ball_skeleton(tuple("abcdef"), np.arange(-1, 5), joints)
    limits = np.tile(np.radians([-40.0, 40.0]), (18, 1))
    skeleton = replace(skeleton, dof_limits=limits)
    reaching = Reaching(skeleton, rest_pose(skeleton), 5, 5)
    counts = []
    for target in walk(1, joints[0], 0.9, joints[5], 150):
        calls.clear()
        reaching.follow(target)
        counts.append(len(calls))
    # Eight steps towards the target, three in a search, four that shorten the rotation, some
    # of which are tried again, one that eases it, and two of which the nearer one is shown.
    assert max(counts) <= 20


def test_joint_that_copies_another_bends_with_it():
    joints = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]])
    skeleton = ball_skeleton(tuple("abcd"), np.array([-1, 0, 1, 2]), joints)
    limits = np.where(skeleton.dof_kinds[:, None] == 5, skeleton.dof_limits, 0.0)
    limits[6:9] = 0.0
    skeleton = replace(skeleton, dof_limits=limits, constraints=(Constraint(2, 1, "rotation"),))
    pose = rest_pose(skeleton)
    pose.dofs[5] = 0.2
    found = reached(skeleton, pose, 3, np.array([2.0, 0, 0]))
    # Both joints bend by b, so the end is |1 + e^(ib) + e^(2ib)| = 1 + 2 cos b from the first one.
    assert_allclose(found.dofs[5], np.arccos(0.5), atol=1e-5)


def test_chain_has_the_nearest_rotatable_joints():
    skeleton = ball_skeleton(tuple("abcd"), np.array([-1, 0, 1, 2]), np.zeros((4, 3)))
    assert chain_above(skeleton, 3, 2).tolist() == [2, 1]
    assert chain_above(skeleton, 3, 9).tolist() == [2, 1, 0]
    limits = skeleton.dof_limits.copy()
    limits[6:9] = 0.0  # joint c is locked
    assert chain_above(replace(skeleton, dof_limits=limits), 3, 2).tolist() == [1, 0]


def test_chain_of_one_does_not_move_the_joints_above_it():
    skeleton = arm()
    found = reached(skeleton, rest_pose(skeleton), 2, np.array([1.0, 1.0, 0.0]), length=1)
    assert_allclose(found.dofs, [0.0, np.pi / 2], atol=1e-5)


def test_root_has_no_chain():
    with pytest.raises(RigError, match=r"^no joint above shoulder can rotate$"):
        reached(arm(), rest_pose(arm()), 0, np.zeros(3))


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("shoulder", [FREE_SHOULDER, NARROW_SHOULDER])
def test_drag_rotates_joints_by_few_degrees_a_centimetre_wherever_it_leads(shoulder, seed):
    # The walk leads through the shoulder, beyond the arm's length, and to places that the limits
    # of the shoulder and of the hinge forbid. Three times 5 degrees a centimetre are allowed where
    # the hand follows, for an arm of 50 cm.
    skeleton = hinged_arm(np.concatenate([shoulder, HINGE]))
    start = np.array([0.1, -0.3, 0.2, 0.0, -1.0, 0.0])
    pose = rest_pose(skeleton)
    pose.dofs[:6] = start
    hand = world_matrices(skeleton, pose)[2, :3, 3]
    targets = walk(seed, np.array([0.0, 1.4, 0.0]), 0.63, hand, 120)
    dofs, _ = drag(skeleton, start, targets)
    # The rotation is known by its linearisation, to a few percent.
    assert angles_between(skeleton, dofs).max() <= 1.1 * 15.0 * 50 / 55
    low, high = skeleton.dof_limits.T
    assert (dofs >= low - 1e-12).all() and (dofs <= high + 1e-12).all()


def test_drag_follows_a_reachable_path_exactly_and_hardly_faster_than_the_path():
    # The path is that of an arm whose DOFs move by known angles, so the hand can follow it.
    skeleton = hinged_arm(np.concatenate([NARROW_SHOULDER, HINGE]))
    times = np.linspace(0.0, 2.0 * np.pi, 160)[:, None]
    path = [0.1, -0.3, 0.2, 0, -1.2, 0] + np.sin(times * [1, 2, 1, 0, 3, 0]) * [
        0.4, 0.5, 0.5, 0, 0.5, 0
    ]  # fmt: skip
    pose, targets = rest_pose(skeleton), []
    for row in path:
        pose.dofs[:6] = row
        targets.append(world_matrices(skeleton, pose)[2, :3, 3])
    dofs, distances = drag(skeleton, path[0], np.array(targets))
    assert distances.max() < 0.001 * 0.55
    known = np.concatenate([path, np.zeros((len(path), 3))], axis=1)
    assert angles_between(skeleton, dofs).max() <= 1.1 * angles_between(skeleton, known).max()


@pytest.mark.parametrize("seed", [1, 8])
def test_limits_do_not_catch_a_hand_on_its_way_along_a_path_that_it_can_follow(seed):
    # The path is that of a collar, a shoulder and a hinge that wave within their limits. An arm
    # that only rotates as little as possible is caught by its limits, 7 to 13 cm from the targets.
    joints = np.array([[0.0, 1.4, 0], [0.12, 1.4, 0], [0.4, 1.4, 0], [0.65, 1.4, 0]])
    skeleton = ball_skeleton(("collar", "shoulder", "elbow", "hand"), np.arange(-1, 3), joints)
    collar = np.radians([[-10, 10], [-20, 20], [-20, 20]])
    limits = np.concatenate([collar, NARROW_SHOULDER, HINGE, np.zeros((3, 2))])
    skeleton = replace(skeleton, dof_limits=limits)
    rng, times = np.random.default_rng(seed), np.linspace(0.0, 2.0 * np.pi, 240)[:, None]
    path = np.zeros((240, 12))
    path[:, 7] = -1.0  # the hinge
    for rank in (1, 2, 3, 4):
        size, phase = 0.7 * rng.normal(size=12) / rank, rng.uniform(0.0, 6.0, 12)
        path += size * np.sin(rank * times + phase)
    path = np.clip(path, *limits.T)
    pose, targets = rest_pose(skeleton), []
    for row in path:
        pose.dofs[:] = row
        targets.append(world_matrices(skeleton, pose)[3, :3, 3])
    pose.dofs[:] = path[0]
    reaching = Reaching(skeleton, pose, 3, 3)
    assert max(reaching.follow(target).distance for target in targets) < 0.001


@pytest.mark.parametrize("way", [-1.5, 1.5])
@pytest.mark.parametrize("elbow", [[0, -1, -5], [0, -1, 5], [0, 0, 5]])
def test_dof_at_its_limit_does_not_swing_the_others(elbow, way):
    # The shoulder's last rotation, by 1.5 degrees, leads the hand to each target alone. Its second
    # one is at its limit, and the arm nearly straight. Steps that stopped there one by one rotated
    # the first one by 11 to 14 degrees instead.
    stiff = np.radians([[-5, 5], [-150, 0], [-5, 5]])
    skeleton = hinged_arm(np.concatenate([NARROW_SHOULDER, stiff]))
    start = np.radians([0, 45, 0, *elbow])
    pose, targets = rest_pose(skeleton), []
    for step in range(12):
        pose.dofs[:6] = start + np.radians([0, 0, step * way, 0, 0, 0])
        targets.append(world_matrices(skeleton, pose)[2, :3, 3])
    dofs, distances = drag(skeleton, start, np.array(targets))
    assert distances.max() < 1e-4
    moved = 100.0 * np.linalg.norm(np.diff(targets, axis=0), axis=1)
    assert (angles_between(skeleton, dofs) / moved).max() <= 5.0


@pytest.mark.parametrize("tilt", [-1.2, -1.0, 0.6])
def test_stiff_arm_turns_by_the_arc_of_its_hand_beside_gimbal_lock(tilt):
    # The shortest rotation that leads a hand along a great circle is the angle of its arc. Near
    # gimbal lock, at 90 degrees, the smallest change of the DOFs is not the shortest rotation.
    skeleton = hinged_arm(np.concatenate([FREE_SHOULDER, 0.0 * HINGE]))
    pose, start = rest_pose(skeleton), np.array([0.3, tilt, 0.2, 0.0, 0.0, 0.0])
    pose.dofs[:6] = start
    first = world_matrices(skeleton, pose)[2, :3, 3] - [0.0, 1.4, 0.0]
    side = np.cross(first, [0.3, 1.0, 0.2])
    side *= 0.55 / np.linalg.norm(side)
    arc = np.arange(0.0, 0.4, 0.02)[:, None]
    targets = [0.0, 1.4, 0.0] + np.cos(arc) * first + np.sin(arc) * side
    dofs, distances = drag(skeleton, start, targets)
    assert distances.max() < 1e-4
    assert angles_between(skeleton, dofs).max() <= 1.05 * np.degrees(0.02)


def test_hand_is_approached_smoothly_at_full_length_and_keeps_its_side():
    # An arm of two links a, b = 1 at distance d has an elbow angle q with d = 2 cos(q / 2), so the
    # exact angle changes by 1 / sin(q / 2) per length: without limit at d = 2.
    skeleton = arm()
    pose = rest_pose(skeleton)
    pose.dofs[:] = -0.6, 1.2
    reaching = Reaching(skeleton, pose, 2)
    way = np.append(np.arange(2 * np.cos(0.6), 2.2, 0.01), np.arange(2.2, 1.6, -0.01))
    found = [reaching.follow(np.array([x, 0.0, 0.0])) for x in way]
    elbow = np.array([each.dofs[1] for each in found])
    # 5 degrees a centimetre for an arm of 50 cm are 4.4 radians per length; 2 is the length here.
    assert np.abs(np.diff(elbow)).max() <= 3 * np.radians(250) * 0.01 / 2 + 1e-9
    assert (elbow > 0.0).all()
    exact = 2.0 * np.arccos(np.clip(way / 2.0, 0.0, 1.0))
    far = way < 1.9
    assert_allclose(elbow[far], exact[far], atol=1e-4)


def test_straight_hand_settles_at_the_target_while_that_rests():
    skeleton = arm()
    reaching = Reaching(skeleton, rest_pose(skeleton), 2)
    target = np.array([1.99, 0.0, 0.0])
    first = reaching.follow(target)
    # The exact angle is 2 acos(1.99 / 2) = 11.5 degrees, more than 0.01 of movement allows.
    assert not first.is_settled and abs(first.dofs[1]) < np.radians(4)
    found = [reaching.follow(target) for _ in range(5)]
    assert found[-1].is_settled and found[-1].distance < 1e-5
    assert abs(found[-1].dofs[1]) == pytest.approx(2 * np.arccos(1.99 / 2), abs=1e-4)
    steps = np.abs(np.diff([each.dofs[1] for each in [first, *found]]))
    assert steps.max() <= np.radians(4) + 1e-9


def test_new_drag_continues_in_the_pose_that_the_last_one_left():
    skeleton = arm()
    pose = rest_pose(skeleton)
    pose.dofs[:] = 0.3, 0.8
    reaching = Reaching(skeleton, pose, 2)
    hand = hand_at(skeleton, pose.dofs)
    for step in range(30):
        found = reaching.follow(hand + step * np.array([0.02, 0.01, 0.0]))
    pose.dofs[:] = found.dofs
    again = Reaching(skeleton, pose, 2).follow(hand_at(skeleton, found.dofs))
    assert_allclose(again.dofs, found.dofs, atol=1e-12)


def test_hand_that_circles_its_joint_adds_no_turns():
    skeleton, angles = arm(), 0.4 + np.arange(0.0, 2.5 * np.pi, 0.1)
    pose = rest_pose(skeleton)
    pose.dofs[:] = 0.0, 0.4
    reaching = Reaching(skeleton, pose, 2, 1)
    found = [reaching.follow(np.array([1 + np.cos(a), np.sin(a), 0])) for a in angles]
    elbow = np.array([each.dofs[1] for each in found])
    # The angle of the hand that is nearest to its angle at the start.
    assert_allclose(elbow, 0.4 + np.arctan2(np.sin(angles - 0.4), np.cos(angles - 0.4)), atol=1e-4)


@pytest.mark.parametrize("axes", ["xyz", "yzy"])
def test_arm_past_gimbal_lock_keeps_angles_within_half_a_turn_of_its_start(axes):
    # The hand circles in a plane through the second axis, so that the second DOF would pass 90
    # degrees: near there, the outer ones turn by half a turn. Of y, z, y, the two about y add up.
    joints = np.array([[0.0, 0, 0], [1, 0, 0]])
    skeleton = ball_skeleton(("shoulder", "hand"), np.array([-1, 0]), joints)
    kinds = [FIRST_ROTATION + "xyz".index(axis) for axis in f"{axes}xyz"]
    skeleton = replace(skeleton, dof_kinds=np.array(kinds, dtype=np.int32))
    pose = rest_pose(skeleton)
    reaching = Reaching(skeleton, pose, 1)
    for angle in np.arange(0.0, 4.3 * np.pi, 0.05):
        target = np.array([np.cos(angle), 0.02 * np.sin(angle), -np.sin(angle)])
        found = reaching.follow(target)
        assert np.abs(found.dofs).max() <= np.pi + 1e-9
        pose.dofs[:] = found.dofs
        assert_allclose(world_matrices(skeleton, pose)[1, :3, 3], target, atol=0.05)


def test_loops_of_the_target_do_not_twist_the_arm():
    skeleton = hinged_arm(np.concatenate([FREE_SHOULDER, HINGE]))
    start = np.array([0.0, -0.3, 0.2, 0.0, -1.2, 0.0])
    pose = rest_pose(skeleton)
    pose.dofs[:6] = start
    hand = world_matrices(skeleton, pose)[2, :3, 3]
    angle = np.arange(241)[:, None] * 2.0 * np.pi / 40
    circle = hand + 0.08 * (np.cos(angle) - 1.0) * [0, 1, 0] + 0.08 * np.sin(angle) * [0, 0, 1]
    dofs, distances = drag(skeleton, start, circle)
    assert distances.max() < 1e-4
    rounds = dofs[40::40]  # after each of six loops
    assert np.degrees(np.abs(rounds[-1] - rounds[-2])).max() < 0.5
    assert np.degrees(np.abs(dofs[-1, :6] - start)).max() < 10.0
