"""Anatomy of figures made of capsules, whose joints are known by construction."""

from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.autorig.anatomy import (
    Limb,
    LimbPair,
    anatomies_of,
    anatomy_of,
    body_points,
    feet_ahead,
    paired,
    plans_of,
)
from viewer.autorig.solid import solid_of
from viewer.errors import RigError

UP = np.array([0.0, 1.0, 0.0])
AHEAD = np.array([0.0, 0.0, 1.0])


def ball_chain(*balls):
    """Return overlapping closed spheres (N, 4) along the lines between given ones."""
    parts = []
    for start, end in pairwise(balls):
        a, b = np.array(start, dtype=float), np.array(end, dtype=float)
        count = int(np.linalg.norm(b[:3] - a[:3]) / (0.4 * min(a[3], b[3]))) + 2
        parts.append(np.linspace(a, b, count))
    return np.concatenate(parts)


def sphere(ball):
    """Return a closed sphere of 10 rings."""
    x, y, z, radius = ball
    polar, around = np.linspace(0, np.pi, 9), np.arange(10) * np.pi / 5
    rings = np.array([[np.sin(p) * np.cos(q), np.cos(p), np.sin(p) * np.sin(q)]
                      for p in polar for q in around])  # fmt: skip
    index = np.arange(90).reshape(9, 10)
    a, b = index[:-1], np.roll(index, -1, axis=1)[:-1]
    c, d = np.roll(index, -1, axis=1)[1:], index[1:]
    triangles = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)
    return rings * radius + [x, y, z], triangles


def mesh(*chains):
    parts = [sphere(ball) for chain in chains for ball in chain]
    starts = 90 * np.arange(len(parts))
    return (
        np.concatenate([positions for positions, _ in parts]),
        np.concatenate([start + each for start, (_, each) in zip(starts, parts, strict=True)]),
    )


def both(*balls):
    """Return a limb on the left, +x, and its mirror image."""
    return [ball_chain(*((sign * x, y, z, r) for x, y, z, r in balls)) for sign in (1.0, -1.0)]


def person(head=0.12, ears=False):
    """Return a person 1.4 high with feet towards +z: hips at 0.6, shoulders at 1.0 and x = 0.2."""
    parts = [
        ball_chain((0, 0.65, 0, 0.12), (0, 1.0, 0, 0.12)),
        ball_chain((0, 1.05, 0, 0.05), (0, 1.12 + head, 0, 0.05)),
        [(0, 1.12 + head, 0, head)],
        *both((0.1, 0.6, 0, 0.06), (0.1, 0.04, 0, 0.05), (0.1, 0.04, 0.14, 0.04)),
        *both((0.1, 1.0, 0, 0.05), (0.7, 1.0, 0, 0.05)),
    ]
    if ears:
        parts += both((0.5 * head, 1.12 + 1.7 * head, 0, 0.04), (0.3, 1.9 + head, 0, 0.04))
    return mesh(*parts)


def with_staff(low=0.6):
    """Return a person with a staff in the left hand, 1.15 long if it begins at ``low``."""
    positions, triangles = person()
    staff, more = mesh(ball_chain((0.7, low, 0.03, 0.03), (0.7, 1.75, 0.03, 0.03)))
    return np.concatenate([positions, staff]), np.concatenate([triangles, len(positions) + more])


def ear(side):
    """Return a limb 0.4 long, from the plane at a height of 1."""
    points = np.array([[0.4 * side, 1.2, 0.8], [0.0, 1.0, 0.8]])
    return Limb(points, np.full(2, 0.04), points[1], 0.4)


def hanging(touching=()):
    """Return a person whose hands are at y = 0.4, and touch the thighs on some sides (+1, -1)."""
    parts = [
        ball_chain((0, 0.65, 0, 0.12), (0, 1.0, 0, 0.12)),
        ball_chain((0, 1.05, 0, 0.05), (0, 1.24, 0, 0.05)),
        [(0, 1.24, 0, 0.12)],
        *both((0.1, 0.6, 0, 0.06), (0.1, 0.04, 0, 0.05), (0.1, 0.04, 0.14, 0.04)),
        *both((0.1, 1.0, 0, 0.05), (0.26, 1.0, 0, 0.05), (0.28, 0.4, 0, 0.05)),
        *([(0.2 * side, 0.45, 0, 0.06)] for side in touching),
    ]
    return mesh(*parts)


@pytest.fixture(scope="module")
def standing():
    """Return the anatomy of a person whose sides are known."""
    return anatomy_of(*person(), UP, np.array([1.0, 0, 0]))


@pytest.mark.parametrize("head", [0.12, 0.35])
def test_limbs_and_head_of_a_person_are_found_whatever_the_size_of_the_head(head):
    anatomy = anatomy_of(*person(head), UP)
    assert abs(anatomy.lateral[0]) == pytest.approx(1.0)  # not a diagonal
    plans = plans_of(anatomy, is_quadruped=False)
    assert len(plans) == 2  # both facings of one pair of arms
    plan = next(plan for plan in plans if plan.left[0] > 0.0)
    size = 1.4
    left_hand, right_hand = (limb.points[0] for limb in plan.upper.limbs)
    assert abs(abs(left_hand[0]) - 0.75) < 0.02 * size and left_hand[0] * right_hand[0] < 0.0
    assert max(limb.points[0][1] for limb in plan.lower.limbs) < 0.1
    points = body_points(anatomy, plan, is_quadruped=False)
    # The head is the widest place above the chest: its centre and its radius.
    row = int(np.nanargmax(np.where(points.positions[:, 1] > 1.05, points.radii, np.nan)))
    np.testing.assert_allclose(points.positions[row], [0, 1.12 + head, 0], atol=0.03 * size)
    # A voxel is 0.016 to 0.02 wide, and the sphere's inscribed polyhedron 5 % smaller.
    assert 0.95 * head - 0.04 < points.radii[row] < head


@pytest.mark.parametrize("touching", [(), (1,), (-1,)])
def test_hand_that_touches_a_thigh_is_the_end_of_its_arm(touching):
    # The way from the plane to this hand is shorter through the thigh than through the arm, so
    # that the elbow is farther away.
    anatomy = anatomy_of(*hanging(touching), UP, np.array([1.0, 0, 0]))
    arms = max(anatomy.pairs, key=lambda pair: abs(pair.limbs[0].points[0][0]))
    heights = [limb.points[0][1] for limb in arms.limbs]
    np.testing.assert_allclose(heights, 0.35, atol=0.05)
    np.testing.assert_allclose([limb.points[-1][1] for limb in arms.limbs], 1.0, atol=0.1)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_forearm_of_a_hand_at_the_hip_belongs_to_its_arm(side):
    arms = (
        ball_chain((side * 0.1, 1.0, 0, 0.05), (side * 0.45, 0.82, 0, 0.05)),
        ball_chain((side * 0.45, 0.82, 0, 0.05), (side * 0.14, 0.55, 0, 0.05)),
        ball_chain((-side * 0.1, 1.0, 0, 0.05), (-side * 0.75, 1.0, 0, 0.05)),
    )
    parts = [
        ball_chain((0, 0.65, 0, 0.12), (0, 1.0, 0, 0.12)),
        ball_chain((0, 1.05, 0, 0.05), (0, 1.24, 0, 0.05)),
        [(0, 1.24, 0, 0.12)],
        *both((0.1, 0.6, 0, 0.06), (0.1, 0.04, 0, 0.05), (0.1, 0.04, 0.14, 0.04)),
    ]
    anatomy = anatomy_of(*mesh(*parts, *arms), UP, np.array([1.0, 0, 0]))
    (plan,) = plans_of(anatomy, False, AHEAD)
    points = body_points(anatomy, plan, is_quadruped=False).positions
    # The straight arm is 0.8 long from the plane to its tip. The elbow is at 0.1 + 0.39 of that, so
    # the first point, 5 % from the tip, is 0.27 along the forearm, which leads (-0.75, -0.66).
    bent, straight = (16, 24) if side > 0.0 else (24, 16)
    np.testing.assert_allclose(points[bent], [side * 0.25, 0.64, 0.0], atol=0.06)
    np.testing.assert_allclose(points[straight], [-side * 0.76, 1.0, 0.0], atol=0.06)


def test_ears_as_long_as_arms_are_another_pair():
    anatomy = anatomy_of(*person(0.3, ears=True), UP)
    plans = plans_of(anatomy, is_quadruped=False)
    arms = [plan for plan in plans if abs(plan.upper.attachment[1] - 1.0) < 0.1]
    # The lowest pair above the legs comes first.
    assert len(arms) == 2 and plans[0] in arms


def test_staff_in_one_hand_is_not_part_of_the_arm():
    anatomy = anatomy_of(*with_staff(), UP, np.array([1.0, 0, 0]))
    (plan,) = plans_of(anatomy, False, AHEAD)
    points = body_points(anatomy, plan, is_quadruped=False).positions
    # Rows 16 to 23 and 24 to 31 are the arms, from the tips: at x = 0.75 without the staff.
    for row, side in ((16, 1.0), (24, -1.0)):
        np.testing.assert_allclose(points[row], [side * 0.72, 1.0, 0.0], atol=0.08)


def test_feet_stand_although_a_staff_reaches_deeper():
    anatomy = anatomy_of(*with_staff(-0.4), UP, np.array([1.0, 0, 0]))
    # The soles, at 0.04 less the radius of the feet; a voxel is 0.022 wide.
    assert anatomy.ground == pytest.approx(-0.01, abs=0.025)
    (plan,) = plans_of(anatomy, False, AHEAD)
    assert anatomy.stands(plan.lower) and plan.lower.attachment[1] == pytest.approx(0.6, abs=0.1)


def test_plane_between_front_and_back_is_not_the_only_one():
    # The staff has a mirror image in front of the person, but none on the other side.
    front, sides = anatomies_of(*with_staff(), UP)
    assert front.symmetry > sides.symmetry
    assert abs(front.lateral[2]) > 0.9 and abs(sides.lateral[0]) > 0.9
    assert plans_of(front, False, AHEAD) == []
    (plan,) = plans_of(sides, False, AHEAD)
    assert plan.upper.attachment[1] == pytest.approx(1.0, abs=0.06)
    # Symmetric figures have one.
    assert len(anatomies_of(*person(), UP)) == 1


def test_pair_of_a_lowered_and_a_raised_arm():
    # Both are 0.7 long and attached at a height of 1; their tips are 1.4 apart when mirrored.
    side = np.array([0.1, 1.0, 0.0])
    limbs = [
        Limb(np.array([side + 0.7 * UP, side, UP]), np.full(3, 0.05), UP, 0.8),
        Limb(np.array([side - 0.7 * UP, side, UP]) * [-1, 1, 1], np.full(3, 0.05), UP, 0.8),
    ]
    given = limbs, np.array([True, False]), np.array([1.0, 0, 0]), 0.0, 1.0
    # A quarter of 1.4 is 0.35 of the size.
    assert paired(*given) == () and len(paired(*given, 0.36)) == 1


def test_sides_of_a_head_are_no_arms(standing):
    (plan,) = plans_of(standing, False, AHEAD)
    # The half of a sphere of radius 0.5 is as long as it is thick.
    points = np.array([[0.5, 1.5, 0], [0.0, 1.5, 0]])
    bump = LimbPair(
        tuple(Limb(points * [s, 1, 1], np.array([0.0, 0.5]), points[1], 0.5) for s in (1, -1))
    )
    assert bump.is_bump and not plan.upper.is_bump and not plan.lower.is_bump
    (found,) = plans_of(replace(standing, pairs=(plan.lower, plan.upper, bump)), False, AHEAD)
    assert found.upper is plan.upper
    assert plans_of(replace(standing, pairs=(plan.lower, bump)), False, AHEAD) == []


def test_corners_of_a_cape_are_no_legs(standing):
    (plan,) = plans_of(standing, False, AHEAD)
    points = np.array([[0.25, 0.1, -0.3], [0.0, 0.1, -0.3]])
    corners = LimbPair(
        tuple(Limb(points * [s, 1, 1], np.full(2, 0.01), points[1], 0.25) for s in (1, -1))
    )
    assert standing.stands(corners) and corners.attachment[1] < plan.lower.attachment[1]
    (found,) = plans_of(replace(standing, pairs=(*standing.pairs, corners)), False, AHEAD)
    assert found.lower is plan.lower


@pytest.mark.parametrize("low", [0.25, 0.06])
def test_thick_legs_that_touch_begin_at_the_crotch(low):
    positions, triangles = person()
    # Below them, there is a gap of 0.1 between the legs; the lower ones reach the ground.
    thick, more = mesh(*both((0.1, low, 0, 0.11), (0.1, 0.6, 0, 0.11)))
    triangles = np.concatenate([triangles, len(positions) + more])
    anatomy = anatomy_of(np.concatenate([positions, thick]), triangles, UP, np.array([1.0, 0, 0]))
    assert all(not 0.3 < pair.attachment[1] < 0.8 for pair in anatomy.pairs)
    (plan,) = plans_of(anatomy, False, AHEAD)
    # The trunk, a ball of 0.12 at y = 0.65, is 0.75 times as deep as the legs at a height of
    # 0.65 - sqrt(0.12^2 - (0.75 * 0.11)^2) = 0.56.
    np.testing.assert_allclose(plan.lower.attachment, [0, 0.56, 0], atol=0.03)
    for limb in plan.lower.limbs:
        thighs = limb.points[(limb.points[:, 1] > 0.3) & (limb.points[:, 1] < 0.5)]
        np.testing.assert_allclose(np.abs(thighs[:, 0]), 0.1, atol=0.03)


def test_legs_may_be_less_than_half_as_long_as_arms_that_reach_the_ground(standing):
    (plan,) = plans_of(standing, False, AHEAD)
    points = np.array([[1.2, 0.05, 0], [0.2, 1.0, 0], [0.0, 1.0, 0]])
    arms = LimbPair(
        tuple(Limb(points * [s, 1, 1], np.full(3, 0.05), points[2], 1.6) for s in (1, -1))
    )
    assert standing.stands(arms) and arms.length > 2.0 * plan.lower.length
    (found,) = plans_of(replace(standing, pairs=(arms, plan.lower)), False, AHEAD)
    assert found.lower is plan.lower and found.upper is arms


def test_longer_path_of_an_arm_that_touches_the_body_is_not_cut(standing):
    (plan,) = plans_of(standing, False, AHEAD)
    one, other = plan.upper.limbs
    # The path enters the plane elsewhere; the tip is as far from the plane as before.
    way = one.attachment - np.linspace(0.02, 0.3, 15)[:, None] * UP
    points, radii = np.concatenate([one.points, way]), np.append(one.radii, np.full(15, 0.1))
    touching = LimbPair((replace(one, points=points, radii=radii), other))
    points = body_points(standing, replace(plan, upper=touching), is_quadruped=False).positions
    # The first points are at 5 % of the path, 0.75 to 1.05 long, from the tip at x = 0.75.
    assert sorted(points[[16, 24], 0]) == pytest.approx([-0.71, 0.71], abs=0.03)


def test_feet_point_to_the_front(standing):
    for plan in plans_of(standing, is_quadruped=False):
        ahead = float(np.cross(plan.left, UP) @ AHEAD)
        # Soles reach from z = -0.05 to 0.18, shins are at 0: 0.13 of a height of 1.36.
        assert feet_ahead(standing, plan, False) == pytest.approx(ahead * 0.13 / 1.36, abs=0.03)


def test_known_front_leaves_one_facing(standing):
    (plan,) = plans_of(standing, False, AHEAD)
    np.testing.assert_allclose(plan.left, [1.0, 0, 0])


def test_oblique_figure_has_an_oblique_plane():
    positions, triangles = person()
    angle = np.radians(35.0)
    turned = positions @ np.array([[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0],
                                   [np.sin(angle), 0, np.cos(angle)]])  # fmt: skip
    anatomy = anatomy_of(turned, triangles, UP)
    left = np.array([np.cos(angle), 0.0, -np.sin(angle)])
    assert abs(float(anatomy.lateral @ left)) > np.cos(np.radians(3.0))
    assert len(plans_of(anatomy, False)) == 2


def test_quadruped_has_two_standing_pairs_in_both_orders():
    animal = mesh(
        ball_chain((0, 0.6, -0.6, 0.13), (0, 0.6, 0.6, 0.13)),
        ball_chain((0, 0.65, 0.6, 0.08), (0, 1.0, 0.9, 0.1)),
        *both((0.1, 0.55, -0.55, 0.06), (0.1, 0.04, -0.55, 0.04)),
        *both((0.1, 0.55, 0.55, 0.06), (0.1, 0.04, 0.55, 0.04)),
    )
    anatomy = anatomy_of(*animal, UP)
    front, back = sorted(plans_of(anatomy, is_quadruped=True), key=lambda plan: -plan.left[0])
    for plan, z in ((front, 0.55), (back, -0.55)):
        assert plan.upper.attachment[2] == pytest.approx(z, abs=0.06)
        assert plan.lower.attachment[2] == pytest.approx(-z, abs=0.06)
    # A person would have a trunk that rises from the legs.
    assert plans_of(anatomy, is_quadruped=False) == []
    # Ears above the forelegs are no arms, as a person would not stand on the hind legs, too.
    lower = front.upper
    limbs = tuple(replace(limb, attachment=limb.attachment - 0.1 * UP) for limb in lower.limbs)
    ears = LimbPair((ear(1.0), ear(-1.0)))
    pairs = (front.lower, LimbPair(limbs), ears)
    assert plans_of(replace(anatomy, pairs=pairs), is_quadruped=False) == []
    assert len(plans_of(replace(anatomy, pairs=pairs[1:]), is_quadruped=False)) == 2


@pytest.mark.parametrize("widens", [False, True])
def test_trunk_of_an_elephant_is_no_neck(widens):
    # The same chain with a head at its end is the neck of a grazing animal.
    end = [[(0, 0.15, 1.1, 0.09)]] if widens else []
    animal = mesh(
        ball_chain((0, 0.8, -0.5, 0.2), (0, 0.8, 0.5, 0.2)),
        ball_chain((0, 0.9, 0.6, 0.16), (0, 1.0, 0.8, 0.14)),
        ball_chain((0, 1.0, 0.85, 0.06), (0, 0.8, 1.05, 0.05), (0, 0.15, 1.1, 0.04)),
        *end,
        *both((0.15, 0.6, -0.45, 0.08), (0.15, 0.06, -0.45, 0.06)),
        *both((0.15, 0.6, 0.45, 0.08), (0.15, 0.06, 0.45, 0.06)),
    )
    anatomy = anatomy_of(*animal, UP, np.array([1.0, 0, 0]))
    plan = plans_of(anatomy, is_quadruped=True, front=AHEAD)[0]
    head = body_points(anatomy, plan, is_quadruped=True).positions[-8:-4]
    assert np.isfinite(head).all()
    if widens:
        assert head[-1, 1] < 0.2
    else:
        # Its head is a ball of 0.14 at z = 0.8.
        assert_allclose(head[-1], [0, 1.0, 0.87], atol=0.08)


def test_ball_has_no_plan(monkeypatch):
    monkeypatch.setattr("viewer.autorig.anatomy.solid_within", partial(solid_of, resolution=32))
    anatomy = anatomy_of(*mesh([(0, 0, 0, 1.0)]), UP)
    assert plans_of(anatomy, False) == [] and plans_of(anatomy, True) == []


def test_mesh_without_area_is_refused():
    with pytest.raises(RigError, match="expected a mesh with an area, found none"):
        anatomy_of(np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 0]]), np.array([[0, 1, 2]]), UP)


def test_thin_triangle_beside_every_plane_has_no_plan():
    """Nothing is in the best plane, from which limbs are measured."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    anatomy = anatomy_of(corners, np.array([[0, 1, 2]]), UP)
    assert plans_of(anatomy, False) == []
