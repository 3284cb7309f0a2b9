"""Foot contacts, legs that reach a target, and feet held in place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lint.sound import FRAMES, RATE, legs, standing
from numpy.testing import assert_allclose

from viewer.rig.cleanup.foot_lock import lock_feet
from viewer.rig.feet.legs import Leg, bend, hinges, legs_of, lowering, reach
from viewer.rig.geometry.quaternion import rotation_vector_to_quaternion
from viewer.rig.geometry.rotation import quaternion_to_matrix
from viewer.rig.motion.evaluation import frames_of, world_frames

FIGURE = legs()  # hips at y = 0.9, knees at 0.5, ankles at 0.1
HIP, KNEE, ANKLE = np.array([[0.0, 0.9, 0.0]]), np.array([[0.0, 0.5, 0.05]]), np.zeros((1, 3))
SIDE = np.array([[1.0, 0.0, 0.0]])


def bent(target) -> tuple[np.ndarray, np.ndarray]:
    """Return the positions of knee and ankle for a target of the ankle."""
    thigh, shin = bend(HIP, KNEE, ANKLE, np.array([target]), SIDE)
    knee = HIP + (KNEE - HIP) @ quaternion_to_matrix(thigh)[0].T
    return knee[0], (knee + (ANKLE - KNEE) @ quaternion_to_matrix(shin)[0].T)[0]


def places(clip) -> np.ndarray:
    times = clip.timing.start + np.arange(FRAMES) / RATE
    return world_frames(FIGURE, frames_of(FIGURE, clip, times))[..., :3, 3]


@pytest.mark.parametrize(
    "target", [(0, 0, 0), (0.1, 0.05, 0.2), (-0.2, 0.3, -0.1), (0, 0.01, 0), (0, 1.6, 0)]
)
def test_ankle_reaches_its_target_and_bones_keep_their_lengths(target) -> None:
    knee, ankle = bent(target)
    assert_allclose(ankle, target, atol=1e-12)
    assert np.linalg.norm(knee - HIP) == pytest.approx(np.linalg.norm(KNEE - HIP), abs=1e-12)
    if target == (0, 0, 0):
        assert_allclose(knee, KNEE[0], atol=1e-12)
    if target[0] == 0:
        assert abs(knee[0]) < 1e-12  # the knee stays in the plane of the leg


def test_leg_points_at_a_target_out_of_reach() -> None:
    _, ankle = bent((0.0, -1.0, 0.0))
    away = ankle - HIP[0]
    assert_allclose(away / np.linalg.norm(away), [0.0, -1.0, 0.0], atol=1e-9)
    assert np.linalg.norm(away) == pytest.approx(reach(HIP, KNEE, ANKLE)[0], abs=1e-9)


def test_straight_leg_bends_its_knee_forwards() -> None:
    hip, knee, ankle = (np.array([[0.0, y, 0.0]]) for y in (0.9, 0.5, 0.1))
    # The axis from right to left is +x, forwards is +z.
    thigh, _ = bend(hip, knee, ankle, np.array([[0.0, 0.3, 0.0]]), SIDE)
    moved = hip + (knee - hip) @ quaternion_to_matrix(thigh)[0].T
    # The triangle has two sides of 0.4 and a base of 0.6.
    assert_allclose(moved, [[0.0, 0.6, np.sqrt(0.4**2 - 0.3**2)]], atol=1e-9)


@pytest.mark.parametrize("angle", [-0.05, -0.01, 0.0, 0.01, 0.05])
def test_knee_of_a_nearly_straight_leg_points_forwards(angle) -> None:
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


def test_axis_of_a_knee_is_found_from_strong_bends() -> None:
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


def test_legs_are_found_by_name() -> None:
    assert legs_of(FIGURE.skeleton) == [Leg(1, 2, 3, 3), Leg(4, 5, 6, 6)]


@pytest.mark.parametrize("up_down", [1.0, -1.0])
def test_sliding_body_keeps_its_feet_and_follows_them_on_straight_legs(up_down) -> None:
    moved = np.zeros((FRAMES, 7, 3))
    moved[:, 0, 2] = 0.2 * np.linspace(-0.5, 0.5, FRAMES)  # 0.1 m/s
    clip = standing(FIGURE, translations=moved)
    if up_down < 0.0:
        rotations = clip.rotations.copy()
        rotations[:, 0] = 1.0, 0.0, 0.0, 0.0
        clip = replace(clip, rotations=rotations)
    found, lock = lock_feet(FIGURE, clip, 1, up_down)
    before, after = places(clip), places(found)
    assert lock.n_contacts == 2 and lock.before == pytest.approx(0.4)
    for ankle in (3, 6):
        assert_allclose(after[:, ankle], np.tile(before[:, ankle].mean(axis=0), (60, 1)), atol=1e-9)
    assert lock.after < 1e-9
    # The legs are straight, so the body stays above the feet: it slid by 0.2.
    assert np.ptp(after[:, 0, 2]) < 0.02 and lock.lowered < 1e-3


@pytest.mark.parametrize("up_down", [1.0, -1.0])
def test_body_is_lowered_if_its_legs_are_too_short(up_down) -> None:
    shift = np.zeros((FRAMES, 3))
    shift[:, 2] = 0.2 * np.linspace(-0.5, 0.5, FRAMES)
    points = up_down * places(standing(FIGURE))
    lowered = lowering(points, [Leg(1, 2, 3, 3)], [shift], RATE, up_down * np.eye(3)[1])
    # At the first and last frame, the ankle is 0.1 beside the hip; the leg is 0.8 long.
    needed = 0.8 - np.sqrt((0.9999 * 0.8) ** 2 - 0.1**2)
    assert needed <= lowered.max() < needed + 1e-6
    height = np.sqrt((0.9999 * 0.8) ** 2 - shift[:, 2] ** 2)
    assert (0.8 - lowered <= height + 1e-9).all()


def test_feet_keep_their_orientation_and_root_its_rotation() -> None:
    moved = np.zeros((FRAMES, 7, 3))
    moved[:, 0, 2] = 0.002 * np.arange(FRAMES)
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (FRAMES, 7, 1))
    for hip, knee in ((1, 2), (4, 5)):
        rotations[:, hip] = rotation_vector_to_quaternion(np.array([-0.3, 0.0, 0.0]))
        rotations[:, knee] = rotation_vector_to_quaternion(np.array([0.6, 0.0, 0.0]))
    clip = standing(FIGURE, translations=moved, rotations=rotations)
    found, lock = lock_feet(FIGURE, clip, 1)
    times = np.arange(FRAMES) / RATE
    worlds = [world_frames(FIGURE, frames_of(FIGURE, each, times)) for each in (clip, found)]
    assert_allclose(worlds[1][:, [3, 6], :3, :3], worlds[0][:, [3, 6], :3, :3], atol=1e-9)
    assert_allclose(found.rotations[:, 0], clip.rotations[:, 0])
    assert lock.lowered == 0.0 and lock.after < 1e-9 < lock.before


def test_feet_in_the_air_are_unchanged() -> None:
    moved = np.zeros((FRAMES, 7, 3))
    moved[:, 0, 2] = 3.0 * np.arange(FRAMES) / RATE
    clip = standing(FIGURE, translations=moved)
    found, lock = lock_feet(FIGURE, clip, 1)
    assert lock.n_contacts == 0
    assert_allclose(places(found), places(clip), atol=1e-12)


def test_corrections_fade_after_the_contact() -> None:
    moved = np.zeros((FRAMES, 7, 3))
    lift = np.clip(np.arange(FRAMES) - 30, 0, None) * 0.01
    moved[:, 0, 1] = lift
    moved[:30, 0, 2] = 0.003 * np.arange(30)
    moved[30:, 0, 2] = 0.09
    clip = standing(FIGURE, translations=moved)
    found, _ = lock_feet(FIGURE, clip, 1)
    shift = places(found)[:, 3, 2] - places(clip)[:, 3, 2]
    assert abs(shift[30]) > 0.02  # the foot is held up to this frame
    # After 0.5 s, more than three times the 0.15 s of the smooth curve, 5 % remain at most.
    assert_allclose(shift[45:], 0.0, atol=0.05 * 0.045)
    assert np.abs(np.diff(shift[32:])).max() < 0.02  # no jump while the correction fades


@pytest.mark.parametrize("glides", [False, True])
def test_feet_are_not_held_where_they_glide_too_far(glides) -> None:
    # The legs are 0.8 long, so a foot may be corrected by 0.15 * 1.6 = 0.24. After the feet were
    # lifted, the body glides by 0.44 or 0.54, at 0.28 or 0.34 m/s; contacts begin below
    # 0.08 * 3 * 1.6 = 0.384 m/s.
    moved = np.zeros((FRAMES, 7, 3))
    moved[8:12, 0, 1] = 0.1
    moved[12:, 0, 2] = (0.27 if glides else 0.22) * np.linspace(-1.0, 1.0, FRAMES - 12)
    clip = standing(FIGURE, translations=moved)
    found, lock = lock_feet(FIGURE, clip, 1)
    assert (lock.n_contacts, lock.n_glides) == ((2, 2) if glides else (4, 0))
    last, kept = (places(each)[30:, [3, 6]] for each in (clip, found))
    if glides:
        # Straight legs that are held are shortened by 0.0001 of their length, 0.8.
        assert_allclose(kept, last, atol=1e-4)
        assert lock.lowered < 1e-4 and lock.before < 1e-9
    else:
        assert_allclose(kept, np.broadcast_to(kept[:1], kept.shape), atol=1e-9)
