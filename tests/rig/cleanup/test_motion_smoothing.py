"""Filters compared with closed forms: constants, uniform rotation, sines, and gaps."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from turning import RATE, angles_of, turning

from viewer.rig.captures.points import PointClip
from viewer.rig.cleanup.smoothing import OneEuro, SavitzkyGolay, run_lengths, smoothed
from viewer.rig.geometry.quaternion import multiply, rotation_vector_to_quaternion

FILTERS = [OneEuro(), SavitzkyGolay(), SavitzkyGolay(window=5, order=3)]
EXACT = 1e-12  # rounding of quaternions


@pytest.mark.parametrize("chosen", FILTERS, ids=str)
def test_constant_motion_is_unchanged(chosen):
    clip = turning(np.full(20, 0.7), axis=(1, 2, 3), places=np.tile([1.0, 2.0, 3.0], (20, 1)))
    found = smoothed(clip, chosen)
    assert_allclose(found.rotations, clip.rotations, atol=EXACT)
    assert_allclose(found.figure_translations, clip.figure_translations, atol=EXACT)


@pytest.mark.parametrize("chosen", FILTERS[1:], ids=str)
def test_savgol_keeps_uniform_rotation_about_any_axis_through_many_revolutions(chosen):
    # 0.9 radians per frame give 3 revolutions, in which the quaternions change their sign.
    clip = turning(0.9 * np.arange(21), axis=(1, -2, 0.5))
    found = smoothed(clip, chosen)
    same = np.abs(np.einsum("nja,nja->nj", found.rotations, clip.rotations))
    assert_allclose(same, 1.0, atol=EXACT)


def test_savgol_keeps_a_parabola_of_positions_also_at_the_ends():
    t = np.arange(25.0)
    places = np.stack([t**2, 3.0 - t, 0.1 * t**2 - t], axis=1)
    found = smoothed(turning(0.0 * t, places=places), SavitzkyGolay(window=7, order=2))
    assert_allclose(found.figure_translations, places, atol=1e-9)  # rounding of 24^2


def test_savgol_attenuates_a_sine_by_the_factor_of_its_weights():
    # Savitzky and Golay's table for 5 points and degree 2: (-3, 12, 17, 12, -3) / 35.
    w = 1.1
    factor = (17.0 + 24.0 * np.cos(w) - 6.0 * np.cos(2.0 * w)) / 35.0
    n = np.arange(40)
    found = angles_of(smoothed(turning(0.2 * np.sin(w * n)), SavitzkyGolay(window=5, order=2)))
    assert_allclose(found[2:-2], factor * 0.2 * np.sin(w * n[2:-2]), atol=1e-12)


def test_one_euro_without_beta_attenuates_a_sine_by_its_transfer_function_without_delay():
    cutoff, w = 2.0, 0.8
    a = 1.0 / (1.0 + RATE / (2.0 * np.pi * cutoff))
    factor = a * a / (1.0 - 2.0 * (1.0 - a) * np.cos(w) + (1.0 - a) ** 2)
    n = np.arange(200)
    wave = 0.3 * np.sin(w * n)
    places = np.stack([wave, 0.0 * wave, -wave], axis=1)
    found = smoothed(turning(wave, places=places), OneEuro(cutoff=cutoff, beta=0.0))
    middle = slice(60, 140)  # 60 frames from the ends, the filter has settled to (1 - a)^60 = 1e-9
    assert_allclose(angles_of(found)[middle], factor * wave[middle], atol=1e-8)
    assert_allclose(found.figure_translations[middle], factor * places[middle], atol=1e-8)


@pytest.mark.parametrize("chosen", [OneEuro(beta=0.0), OneEuro()], ids=["fixed", "adaptive"])
@pytest.mark.parametrize("count", [2, 9, 60])
def test_one_euro_keeps_uniform_motion_up_to_its_ends(chosen, count):
    # Without the continuation, the ends lag by (1 - a) / a = 1.6 frames at 3 Hz.
    n = np.arange(float(count))
    clip = turning(0.2 * n, axis=(1, 2, -1), places=np.outer(n, [0.1, -0.2, 0.3]))
    found = smoothed(clip, chosen)
    lag = 1e-3  # in frames; a pass settles to 1e-4
    assert_allclose(found.figure_translations, clip.figure_translations, atol=0.3 * lag)
    same = np.abs(np.einsum("nja,nja->nj", found.rotations, clip.rotations))
    assert (2.0 * np.arccos(np.minimum(same, 1.0)) < 0.2 * lag).all()


def test_one_euro_follows_fast_motion_more_closely():
    # Half way through a fast step, a filter with a higher beta is nearer to the step.
    step = np.where(np.arange(40) < 20, 0.0, 2.0)
    errors = [
        np.abs(angles_of(smoothed(turning(step), OneEuro(cutoff=1.0, beta=beta))) - step).mean()
        for beta in (0.0, 1.0, 10.0)
    ]
    assert errors[0] > errors[1] > errors[2]


def test_speed_of_positions_is_measured_in_metres():
    t = np.arange(30.0)
    places = np.stack([np.where(t < 15, 0.0, 1.0), t, 0 * t], axis=1)
    metres = smoothed(turning(0 * t, places=places), OneEuro())
    millimetres = smoothed(turning(0 * t, places=1e3 * places), OneEuro(), metres=1e-3)
    assert_allclose(millimetres.figure_translations, 1e3 * metres.figure_translations, atol=1e-9)


@pytest.mark.parametrize("chosen", FILTERS, ids=str)
def test_filters_do_not_depend_on_signs_of_quaternions(chosen):
    clip = turning(np.linspace(0.0, 3.0, 20) ** 2)
    signs = np.where(np.arange(20) % 3, 1.0, -1.0)[:, None, None]
    flipped = replace(clip, rotations=signs * clip.rotations)
    dots = np.einsum(
        "nja,nja->nj", smoothed(clip, chosen).rotations, smoothed(flipped, chosen).rotations
    )
    assert_allclose(np.abs(dots), 1.0, atol=EXACT)


@pytest.mark.parametrize("chosen", FILTERS, ids=str)
def test_rotating_the_world_rotates_the_result(chosen):
    rng = np.random.default_rng(1)
    clip = turning(0.3 * rng.normal(size=20), axis=(1, 1, 0))
    turn = rotation_vector_to_quaternion(np.array([0.4, -0.2, 1.0]))
    turned = smoothed(replace(clip, rotations=multiply(turn, clip.rotations)), chosen)
    expected = multiply(turn, smoothed(clip, chosen).rotations)
    assert_allclose(np.abs(np.einsum("nja,nja->nj", turned.rotations, expected)), 1.0, atol=EXACT)


@pytest.mark.parametrize("chosen", FILTERS, ids=str)
def test_runs_between_gaps_are_filtered_separately(chosen):
    # The rows are stored in reverse order, and the motion jumps by 2 radians in the gap.
    angles = np.concatenate([np.full(8, 2.0), np.full(8, 0.5)])
    rows = np.concatenate([np.arange(15, 7, -1), [-1, -1, -1], np.arange(7, -1, -1)])
    found = smoothed(turning(angles, rows=rows), chosen)
    expected = np.concatenate([np.full(8, 0.5), [np.nan] * 3, np.full(8, 2.0)])
    assert_allclose(angles_of(found), expected, atol=EXACT)


def test_lengths_of_runs_are_those_of_the_frames_or_of_each_point():
    clip = turning(np.zeros(5), rows=[0, 1, -1, 2, 3, 4])
    assert run_lengths(clip) == [2, 3]
    points = np.ones((5, 2, 4))
    points[3, 1, 3] = 0.0
    assert run_lengths(PointClip("points", clip.timing, points)) == [2, 3, 2, 1, 1]


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_short_runs_are_unchanged_if_no_polynomial_can_be_fitted(count):
    clip = turning(np.arange(float(count)) ** 2)
    found = smoothed(clip, SavitzkyGolay(window=9, order=2))
    expected = clip.rotations if count < 4 else None  # 3 frames determine a parabola
    if expected is not None:
        assert_allclose(found.rotations, expected, atol=EXACT)
    assert found.n_rows == count


def test_point_is_filtered_only_while_it_is_visible():
    points = np.zeros((12, 1, 4))
    points[:, 0, 0] = [0] * 6 + [5] * 6
    points[:, 0, 3] = [1] * 5 + [0] * 2 + [1] * 5
    clip = PointClip("points", turning(np.zeros(12)).timing, points)
    found = smoothed(clip, OneEuro())
    assert_allclose(found.points, points, atol=EXACT)


def test_points_with_different_visibility_are_filtered_independently():
    rng = np.random.default_rng(6)
    points = np.ones((20, 3, 4))
    points[..., :3] = rng.normal(size=(20, 3, 3))
    points[8:10, 1, 3] = 0.0
    timing = turning(np.zeros(20)).timing
    together = smoothed(PointClip("points", timing, points), SavitzkyGolay(window=5)).points
    for point in range(3):
        alone = PointClip("points", timing, points[:, [point]])
        found = smoothed(alone, SavitzkyGolay(window=5)).points[:, 0]
        assert_allclose(together[:, point], found, atol=EXACT)
