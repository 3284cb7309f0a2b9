"""Feet of captures that are held in place."""

from dataclasses import replace

import numpy as np
import pytest
from linting.sound import FRAMES, RATE, legs, standing
from numpy.testing import assert_allclose

from viewer.rigs.feet.planting import lock_feet
from viewer.rigs.geometry.quaternion import rotation_vector_to_quaternion
from viewer.rigs.motion.evaluation import frames_of, world_frames

FIGURE = legs()  # hips at y = 0.9, knees at 0.5, ankles at 0.1


def places(clip) -> np.ndarray:
    times = clip.timing.start + np.arange(FRAMES) / RATE
    return world_frames(FIGURE, frames_of(FIGURE, clip, times))[..., :3, 3]


@pytest.mark.parametrize("up_down", [1.0, -1.0])
def test_sliding_body_keeps_its_feet_and_follows_them_on_straight_legs(up_down):
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


def test_feet_keep_their_orientation_and_root_its_rotation():
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


def test_feet_in_the_air_are_unchanged():
    moved = np.zeros((FRAMES, 7, 3))
    moved[:, 0, 2] = 3.0 * np.arange(FRAMES) / RATE
    clip = standing(FIGURE, translations=moved)
    found, lock = lock_feet(FIGURE, clip, 1)
    assert lock.n_contacts == 0
    assert_allclose(places(found), places(clip), atol=1e-12)


def test_corrections_fade_after_the_contact():
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
def test_feet_are_not_held_where_they_glide_too_far(glides):
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


def test_motion_of_a_body_that_stands_still_is_unchanged():
    clip = standing(FIGURE)
    found, lock = lock_feet(FIGURE, clip, 1)
    assert_allclose(found.rotations, clip.rotations, atol=0.0)
    assert (lock.n_contacts, lock.before, lock.after, lock.lowered) == (2, 0.0, 0.0, 0.0)
