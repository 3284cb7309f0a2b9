"""Legs that reach a target, and their hips."""

import numpy as np
import pytest
from linting.sound import FRAMES, RATE, legs, standing
from numpy.testing import assert_allclose
from rigs.retargeting.trotting import PAWS, animal, other_animal, stands, trot
from rigs.retargeting.two_people import BODY, HIK, figure_of, places

from viewer.loading import load
from viewer.rigs.feet.legs import Leg, animal_legs, bend, hinges, legs_of, lowering, reach
from viewer.rigs.geometry.rotation import quaternion_to_matrix
from viewer.rigs.motion.evaluation import frames_of, world_frames
from viewer.rigs.retargeting.driven_feet import plant_feet
from viewer.rigs.retargeting.retarget import retarget
from viewer.rigs.shape import rest_joints

FIGURE = legs()  # hips at y = 0.9, knees at 0.5, ankles at 0.1
HIP, KNEE, ANKLE = np.array([[0.0, 0.9, 0.0]]), np.array([[0.0, 0.5, 0.05]]), np.zeros((1, 3))
SIDE = np.array([[1.0, 0.0, 0.0]])


def bent(target) -> tuple[np.ndarray, np.ndarray]:
    """Return the positions of knee and ankle for a target of the ankle."""
    thigh, shin = bend(HIP, KNEE, ANKLE, np.array([target]), SIDE)
    knee = HIP + (KNEE - HIP) @ quaternion_to_matrix(thigh)[0].T
    return knee[0], (knee + (ANKLE - KNEE) @ quaternion_to_matrix(shin)[0].T)[0]


@pytest.mark.parametrize(
    "target", [(0, 0, 0), (0.1, 0.05, 0.2), (-0.2, 0.3, -0.1), (0, 0.01, 0), (0, 1.6, 0)]
)
def test_ankle_reaches_its_target_and_bones_keep_their_lengths(target):
    knee, ankle = bent(target)
    assert_allclose(ankle, target, atol=1e-12)
    assert np.linalg.norm(knee - HIP) == pytest.approx(np.linalg.norm(KNEE - HIP), abs=1e-12)
    if target == (0, 0, 0):
        assert_allclose(knee, KNEE[0], atol=1e-12)
    if target[0] == 0:
        assert abs(knee[0]) < 1e-12  # the knee stays in the plane of the leg


def test_leg_points_at_a_target_out_of_reach():
    _, ankle = bent((0.0, -1.0, 0.0))
    away = ankle - HIP[0]
    assert_allclose(away / np.linalg.norm(away), [0.0, -1.0, 0.0], atol=1e-9)
    assert np.linalg.norm(away) == pytest.approx(reach(HIP, KNEE, ANKLE)[0], abs=1e-9)


def test_straight_leg_bends_its_knee_forwards():
    hip, knee, ankle = (np.array([[0.0, y, 0.0]]) for y in (0.9, 0.5, 0.1))
    # The axis from right to left is +x, forwards is +z.
    thigh, _ = bend(hip, knee, ankle, np.array([[0.0, 0.3, 0.0]]), SIDE)
    moved = hip + (knee - hip) @ quaternion_to_matrix(thigh)[0].T
    # The triangle has two sides of 0.4 and a base of 0.6.
    assert_allclose(moved, [[0.0, 0.6, np.sqrt(0.4**2 - 0.3**2)]], atol=1e-9)


@pytest.mark.parametrize("angle", [-0.05, -0.01, 0.0, 0.01, 0.05])
def test_knee_of_a_nearly_straight_leg_points_forwards(angle):
    # The knee is bent sideways by up to 3 degrees, as in noisy recordings, once to each side.
    hip, knee = np.array([[0.0, 0.8, 0.0]]), np.array([[0.0, 0.4, 0.0]])
    ankle = knee + 0.4 * np.array([[np.sin(angle), -np.cos(angle), 0.0]])
    thigh, _ = bend(hip, knee, ankle, np.array([[0.0, 0.2, 0.0]]), SIDE)
    moved = hip + (knee - hip) @ quaternion_to_matrix(thigh)[0].T
    # The triangle has two sides of 0.4 and a base of 0.6. The knee is 0.4 sin(angle / 2) aside of
    # the straight line, and its direction is moved forwards by a tenth of the leg's length, 0.08,
    # times the sine of the angle between the leg and the knee's axis.
    offset = np.array([-0.4 * np.sin(angle / 2.0), 0.0, 0.08 * np.cos(angle / 2.0)])
    height = np.sqrt(0.4**2 - 0.3**2)
    expected = [0.0, 0.5, 0.0] + height * offset / np.linalg.norm(offset)
    assert_allclose(moved[0], expected, atol=1e-9)


def test_axis_of_a_knee_is_found_from_strong_bends():
    # The knee bends by 1 rad about +x in half of the frames and by 0.06 rad about -z in the others;
    # the direction across is z. The weights are the fourth powers of sines: 0.5014 and 1.3e-5 in
    # 4 frames each, and 0.004487, that of 15 degrees, in all 8.
    knees = np.tile([0.0, -0.4, 0.0], (8, 1))
    ankles = knees + 0.4 * np.array([[0.0, -np.cos(1.0), -np.sin(1.0)]])
    ankles[4:] = knees[4:] + 0.4 * np.array([-np.sin(0.06), -np.cos(0.06), 0.0])
    thighs = np.broadcast_to(np.eye(3), (8, 3, 3))
    found = hinges(thighs, (np.zeros((8, 3)), knees, ankles), np.tile([0.0, 0.0, 3.0], (8, 1)))
    ratio = (8 * 0.004487 - 4 * 1.3e-5) / (4 * 0.5014)
    wanted = np.array([1.0, 0.0, ratio]) / np.hypot(1.0, ratio)
    assert_allclose(found, np.tile(wanted, (8, 1)), atol=1e-5)


def test_legs_are_found_by_name():
    assert legs_of(FIGURE.skeleton) == [Leg(1, 2, 3, 3), Leg(4, 5, 6, 6)]


# A leg that was straight reaches 0.99 of its length, one that may be straight all of it.
@pytest.mark.parametrize(("extended", "reached"), [(1.0, 1.0), (0.97, 0.99)])
@pytest.mark.parametrize("up_down", [1.0, -1.0])
def test_body_is_lowered_if_its_legs_are_too_short(up_down, extended, reached):
    shift = np.zeros((FRAMES, 3))
    shift[:, 2] = 0.2 * np.linspace(-0.5, 0.5, FRAMES)
    times = np.arange(FRAMES) / RATE
    posed = frames_of(FIGURE, standing(FIGURE), times)
    points = up_down * world_frames(FIGURE, posed)[..., :3, 3]
    up = up_down * np.eye(3)[1]
    lowered = lowering(points, [Leg(1, 2, 3, 3)], [shift], RATE, up, extended)
    # At the first and last frame, the ankle is 0.1 beside the hip; the leg is 0.8 long.
    needed = 0.8 - np.sqrt((reached * 0.9999 * 0.8) ** 2 - 0.1**2)
    assert needed - 1e-12 <= lowered.max() < needed + 1e-6
    height = np.sqrt((reached * 0.9999 * 0.8) ** 2 - shift[:, 2] ** 2)
    # A leg that is hardly stretched stays straighter.
    is_long = np.hypot(0.8, shift[:, 2]) > 0.8 + (1.0 - reached) * 0.2
    assert (0.8 - lowered <= height + 1e-9)[is_long].all() and is_long.sum() > 20


UP = np.array([0.0, 1.0, 0.0])
EDGE = 6  # frames at either end of a stance in which the paw lands or lifts off


def names_of_legs(figure, up=UP):
    skeleton = figure.require_skeleton()
    found = animal_legs(skeleton.parents, rest_joints(figure), up)
    names = skeleton.names
    return [tuple(names[j] for j in (leg.hip, leg.knee, leg.ankle, leg.toe)) for leg in found]


def test_legs_of_the_fox_begin_below_the_scapula():
    found = names_of_legs(load().actors[0].figure)
    wanted = {
        tuple(f"{end}_{part}_{side}" for part in ("upper", "lower", "paw", "toes"))
        for end in ("hind", "fore")
        for side in "lr"
    }
    assert len(found) == 4 and set(found) == wanted
    assert all(name.endswith("_l") for leg in found[:2] for name in leg)


@pytest.mark.parametrize("table", [BODY, HIK])
def test_people_have_no_animal_legs(table):
    assert names_of_legs(figure_of(table, "person")) == []


def test_toes_belong_to_one_leg_and_a_tail_on_the_ground_is_not_a_leg():
    table = animal()
    for paw in PAWS:
        place = np.array(table[f"{paw}_toe"][1])
        for n in (-1, 0, 1):
            table[f"{paw}_toe{n}"] = f"{paw}_toe", np.add(place, (0.01 * n, -0.015, 0.03))
    table["tail"] = "hips", (0.0, 0.2, -0.2)
    assert len(names_of_legs(figure_of(table, "toes"))) == 4
    for n, place in enumerate([(0.0, 0.1, -0.3), (0.0, 0.05, -0.35), (0.0, 0.0, -0.4)]):
        table[f"tail{n}"] = f"tail{n - 1}" if n else "tail", place
    found = names_of_legs(figure_of(table, "no mirror image"))
    assert len(found) == 4 and not any("tail" in name for leg in found for name in leg)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    lying = figure_of(animal(), "z", turn, up="z")
    assert len(names_of_legs(lying, np.array([0.0, 0.0, 1.0]))) == 4


def test_three_legs_or_two_points_are_not_an_animal():
    table = {name: row for name, row in animal().items() if not name.startswith("fore_r")}
    assert names_of_legs(figure_of(table, "three")) == []
    assert animal_legs(np.array([-1, 0], dtype=np.int32), np.zeros((2, 3)), UP) == []


def test_paws_are_planted_in_the_stances_of_the_source_animal():
    figure = other_animal()
    found = retarget(trot(), figure)
    clip, changes = plant_feet(found, figure)
    assert changes.is_better and changes.after < changes.source
    old, new = places(figure, found.clip), places(figure, clip)
    slid = []
    for paw in PAWS:
        flags = stands(paw)
        first = int(np.flatnonzero(flags[1:] & ~flags[:-1])[0]) + 1
        rows = slice(first + EDGE, first + 45 - EDGE)
        slid.append(np.ptp(old[f"{paw}_toe"][rows, 2]))
        assert_allclose(np.ptp(new[f"{paw}_toe"][rows], axis=0), 0.0, atol=1e-9)
        assert_allclose(new[f"{paw}_toe"][rows, 1], 0.0, atol=1e-9)  # the toes serve as soles
    assert max(slid) > 0.009
    source = places(found.source.figure, found.source.clip)
    assert np.ptp(source["hind_l_toe"][EDGE : 45 - EDGE], axis=0).max() < 1e-12
