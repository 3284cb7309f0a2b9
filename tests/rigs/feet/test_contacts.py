"""Contacts of feet, soles, and curves of corrections."""

import numpy as np
import pytest
from linting.sound import legs, scene_of, standing
from numpy.testing import assert_allclose
from rigs.retargeting.rest_twins import Y, Z

import viewer
from viewer.loading import bundled_body
from viewer.rigs.feet import limits
from viewer.rigs.feet.contacts import FootPath, foot_contacts, moving_ground
from viewer.rigs.feet.curves import smooth_curves
from viewer.rigs.feet.soles import extent, soles_of
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix
from viewer.rigs.pose import rest_pose, set_joint_rotations
from viewer.rigs.skinning import deform, joint_matrices

RATE, COUNT = 30.0, 60


def contacts(steps, spans=((0, COUNT),), slips: float = 1.0) -> list[tuple[int, int]]:
    """Return the contacts of a single foot of a body of size 1, from its velocities (N, 3)."""
    path = np.cumsum(np.asarray(steps) / RATE, axis=0)
    (found,) = foot_contacts(
        [FootPath(path, path, path + 0.5 * Y)], spans, RATE, 1.0, Y, 0.0, slips
    )
    return [(one.start, one.stop) for one in found]


def moving(speed: float, axis=Z) -> np.ndarray:
    return np.tile(speed * axis, (COUNT, 1))


def test_contacts_begin_and_end_with_hysteresis_of_the_speed():
    assert contacts(moving(0.07)) == [(0, COUNT)]
    assert contacts(moving(0.1)) == []  # too fast to begin
    faster = np.where((np.arange(COUNT) >= 20)[:, None], moving(0.15), 0.0)
    assert contacts(faster) == [(0, COUNT)]  # slow enough to last
    rests = moving(0.0)
    rests[30:40] = 1.0 * Z
    assert len(contacts(rests)) == 2


@pytest.mark.parametrize("slips", [1.0, limits.SLIPS])
def test_feet_of_captures_may_slide_but_not_rise(slips):
    assert contacts(moving(0.15), slips=slips) == ([(0, COUNT)] if slips > 1.0 else [])
    assert contacts(moving(0.3), slips=slips) == []
    assert contacts(moving(0.1, Y), slips=slips) == []


@pytest.mark.parametrize(("swing", "is_found"), [(2.5, False), (7.5, True)])
def test_standing_feet_may_move_faster_the_faster_the_feet_swing(swing, is_found):
    # Feet stand for 0.2 s in turn, and roll meanwhile at 0.2: 2.5 times the limit of a walk.
    rate, count, half = 120.0, 240, 24
    stands = np.arange(count) // half % 2 == 0
    feet = []
    for is_down in (stands, ~stands):
        path = np.cumsum(np.where(is_down, 0.2, swing))[:, None] / rate * Z
        path = path + np.where(is_down, 0.0, 0.1)[:, None] * Y
        feet.append(FootPath(path, path, path + 0.5 * Y))
    left, right = foot_contacts(feet, [(0, count)], rate, 1.0, Y)
    assert (len(left), len(right)) == ((5, 5) if is_found else (0, 0))
    for number, one in enumerate(left):
        # The window of the speeds, a third of 0.1 s, blurs the ends of a step by half of itself.
        begin = 2 * half * number
        assert abs(one.start - begin) <= 2 and abs(one.stop - begin - half) <= 2


def test_contacts_end_at_gaps_and_last_at_least_a_tenth_of_a_second():
    assert contacts(moving(0.0), [(0, 10), (11, 13), (14, COUNT)]) == [(0, 10), (14, COUNT)]


def steps(speeds: np.ndarray, is_down: np.ndarray) -> FootPath:
    """Return a foot that moves along z by speeds (N,), on the ground or 0.1 above it."""
    path = np.cumsum(speeds)[:, None] / RATE * Z + np.where(is_down, 0.0, 0.1)[:, None] * Y
    return FootPath(path, path, np.tile(0.5 * Y, (len(path), 1)))


@pytest.mark.parametrize(("power", "error"), [(1.3, 0.1), (1.0, 0.25)])
def test_ground_of_a_cycle_is_found_although_feet_move_unevenly(power, error):
    # Two feet alternate; they begin a step at 1.4 and end it at 0.6 body sizes per second, and move
    # at 0.9 to 1.1 for a third or, with constant deceleration, a quarter of it.
    phase = np.arange(120) % 30 / 30.0
    x = 4.0 * phase - 1.0
    speeds = np.where(phase < 0.5, -1.0 + 0.4 * np.sign(x) * np.abs(x) ** power, 1.0)
    other = np.roll(speeds, 15)
    feet = [steps(speeds, phase < 0.5), steps(other, np.roll(phase < 0.5, 15))]
    found = moving_ground(feet, [(0, 120)], RATE, 1.0, Y)
    assert_allclose(found.velocity, -1.0 * Z, atol=error)
    assert 1.0 < found.slips <= 2.0


def test_ground_rests_if_only_one_foot_moves():
    # As in a blow: the front foot is pushed ahead on the ground, the other one stands on its toes.
    blow = np.where(np.arange(COUNT) < 45, 0.3, -0.9)
    feet = [steps(blow, np.ones(COUNT, bool)), steps(np.zeros(COUNT), np.zeros(COUNT, bool))]
    assert moving_ground(feet, [(0, COUNT)], RATE, 1.0, Y) is None


@pytest.mark.parametrize("spans", [[], [(3, 5)]])
def test_ground_rests_if_a_motion_has_too_few_frames(spans):
    foot = steps(np.ones(COUNT), np.ones(COUNT, bool))
    assert moving_ground([foot, foot], spans, RATE, 1.0, Y) is None


HEIGHT = np.array([0.0, 1.0, 0.0, 0.0])


@pytest.mark.parametrize("turn", [-1.0, -0.5, -0.2, 0.0, 0.3, 0.7])
def test_lowest_point_of_rotated_feet_is_that_of_the_mesh(turn):
    figure = viewer.load(bundled_body()).actors[0].figure
    pose = rest_pose(figure.skeleton)
    ankles = np.array([figure.skeleton.names.index(f"{s}_ankle") for s in ("left", "right")])
    turns = rotation_vector_to_matrix(np.array([[turn, 0.0, 0.0], [turn, 0.0, 0.2]]))
    set_joint_rotations(figure.skeleton, pose, ankles.astype(np.int32), turns)
    positions = deform(figure, pose)[0]
    found = soles_of(figure, True).heights(joint_matrices(figure, pose)[None], HEIGHT, 1.0)[0]
    for height, side in zip(found, (1.0, -1.0), strict=True):
        # The points chosen for sampled tilts are the lowest for all tilts, to within 2 mm.
        assert height == pytest.approx(positions[side * positions[:, 0] > 0.0, 1].min(), abs=2e-3)


def test_ankles_replace_soles_without_a_mesh():
    figure = legs()
    scene = scene_of(figure, standing(figure))
    soles = soles_of(figure, True)
    world = joint_matrices(figure, scene.actors[0].pose)[None]
    # Both ankles are 0.1 high at rest, which is the lowest height.
    assert soles.heights(world, HEIGHT, 1.0) == pytest.approx(np.full((1, 2), 0.1))
    assert soles.joints.tolist() == [3, 6]
    assert extent(figure) == pytest.approx((0.1, 0.9))


def test_figures_without_ankles_have_no_soles():
    assert soles_of(viewer.load().actors[0].figure, True) is None


SPAN = 4.0


@pytest.mark.parametrize("count", [1, 2, 3, 31, 32, 33, 34, 65, 100])
def test_curves_solve_the_normal_equations(count):
    rng = np.random.default_rng(count)
    targets, weights = rng.normal(size=(3, count, 2)), 10.0 ** rng.uniform(-1.0, 6.0, (3, count))
    second = np.diff(np.eye(count), 2, axis=0) if count > 2 else np.zeros((0, count))
    found = smooth_curves(targets, weights, SPAN)
    for target, weight, curve in zip(targets, weights, found, strict=True):
        matrix = np.diag(weight) + SPAN**4 * second.T @ second
        assert_allclose(curve, np.linalg.solve(matrix, weight[:, None] * target), atol=1e-9)


def test_straight_lines_are_unchanged():
    line = np.stack([np.arange(50.0), 3.0 - 0.5 * np.arange(50.0)], axis=1)[None]
    weights = np.random.default_rng(0).uniform(0.1, 10.0, (1, 50))
    assert_allclose(smooth_curves(line, weights, 10.0), line, atol=1e-9)


def test_effect_of_a_fixed_row_decays_smoothly_over_the_span():
    targets, weights = np.zeros((1, 401, 1)), np.ones((1, 401))
    targets[0, 200], weights[0, 200] = 1.0, 1e9
    curve = smooth_curves(targets, weights, 20.0)[0, :, 0]
    # The solution of c + s^4 c'''' = 0 is e^-u (cos u + sin u) with u = x / (s sqrt 2).
    u = np.abs(np.arange(401) - 200) / (20.0 * np.sqrt(2.0))
    assert_allclose(curve, np.exp(-u) * (np.cos(u) + np.sin(u)), atol=2e-3)
    assert np.abs(np.diff(curve, 2)).max() < 1.0 / 20.0**2
