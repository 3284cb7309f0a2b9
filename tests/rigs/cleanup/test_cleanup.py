"""Cleaned motions: smoothed, corrected, locked, filled, joined and resampled."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from viewer.errors import RigError
from viewer.loading.cleaning import joint_displacement, point_displacement
from viewer.rigs.captures.points import PointClip
from viewer.rigs.cleanup.frames import (
    Gaps,
    common_frames,
    inner_gaps,
    interpolate_gaps,
    joined_tracks,
    resampled,
    trimmed,
)
from viewer.rigs.cleanup.smoothing import OneEuro, SavitzkyGolay, run_lengths, smoothed
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.quaternion import multiply, rotation_vector_to_quaternion
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.skeleton import Skeleton

RATE = 30.0


def turning(angles, axis=(0.0, 0.0, 1.0), rows=None, places=None, rate=RATE) -> SampledClip:
    """Return a clip of one joint that rotates about an axis by some angles (N,), radians."""
    angles = np.asarray(angles, dtype=float)
    vectors = angles[:, None, None] * (np.array(axis) / np.linalg.norm(axis))
    rows = np.arange(len(angles)) if rows is None else np.asarray(rows)
    timing = Timing(rate, rows.astype(np.int32), first_frame=10, holds=False)
    return SampledClip(
        "turning", timing, rotation_vector_to_quaternion(vectors), figure_translations=places
    )


def angles_of(clip: SampledClip) -> np.ndarray:
    """Return the angles of a clip about z, frame by frame, without jumps; NaN in gaps."""
    rows = clip.timing.rows
    quaternions = clip.rotations[rows, 0]
    found = np.unwrap(2.0 * np.arctan2(quaternions[:, 2], quaternions[:, 3]))
    return np.where(rows >= 0, found, np.nan)


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


POLE = Figure(
    "pole",
    skeleton=Skeleton(
        names=("foot", "knee"),
        parents=np.array([-1, 0]),
        rest_translations=np.array([[0.0, 0, 0], [0, 2, 0]]),
        rest_rotations=np.tile([0.0, 0.0, 0.0, 1.0], (2, 1)),
        rest_scales=np.ones((2, 3)),
        dof_joints=np.zeros(0, dtype=np.int32),
        dof_kinds=np.zeros(0, dtype=np.int32),
        rest_dofs=np.zeros(0),
        dof_limits=np.zeros((0, 2)),
    ),
)
"""Two joints, the second at height 2 above the first."""


def _clip(angle: float, rows) -> SampledClip:
    vectors = np.zeros((3, 2, 3))
    vectors[1, 0, 2] = angle
    rows = np.asarray(rows, dtype=np.int32)
    return SampledClip(
        "c", Timing(30.0, rows, first_frame=5), rotation_vector_to_quaternion(vectors)
    )


def test_root_rotation_displaces_the_joint_above_by_the_chord():
    # The joint at height 2 moves along the chord 4 sin(angle / 2) in one of three frames.
    still, bent = _clip(0.0, [0, 1, 2]), _clip(0.6, [0, 1, 2])
    found = joint_displacement(POLE, still, bent)
    chord = 4.0 * np.sin(0.3)
    assert np.isclose(found.largest, chord) and (found.joint, found.frame) == (1, 6)
    assert np.isclose(found.mean, chord / 6.0) and found.n_frames == 3


def test_frames_missing_in_either_motion_are_ignored():
    still, bent = _clip(0.0, [0, 1, 2]), _clip(0.6, [0, -1, 2])
    found = joint_displacement(POLE, still, bent)
    assert found.largest == 0.0 and found.n_frames == 2


def test_points_are_compared_only_if_visible_in_both_motions():
    points = np.ones((3, 2, 4))
    moved = points.copy()
    moved[1, 0, 0] += 3.0
    moved[2, 1, :3] += 9.0
    moved[2, 1, 3] = 0.0
    timing = _clip(0.0, [0, 1, 2]).timing
    before = PointClip("p", timing, points)
    found = point_displacement(before, replace(before, points=moved))
    assert (found.largest, found.joint, found.frame) == (3.0, 0, 6)
    assert np.isclose(found.mean, 3.0 / 5.0)


def test_uniform_rotation_is_interpolated_exactly():
    rows = [-1, 0, 1, -1, -1, 2, -1, 3, -1]
    places = np.array([[1.0], [2], [5], [7]]) * [1.0, 0.0, -2.0]
    clip = turning(0.3 * np.array([1, 2, 5, 7]), rows=rows, places=places)
    found, gaps = interpolate_gaps(clip)
    assert gaps == Gaps(((3, 5), (6, 7)), ())
    expected = 0.3 * np.arange(9.0)
    expected[[0, 8]] = np.nan  # no frame is added before the first or after the last one
    assert_allclose(angles_of(found), expected, atol=1e-12)
    inner = found.timing.rows[1:8]
    assert_allclose(found.figure_translations[inner, 2], -2.0 * np.arange(1, 8), atol=1e-12)


def test_gaps_above_the_length_limit_are_not_interpolated():
    clip = turning(np.arange(3.0), rows=[0, -1, -1, -1, 1, -1, 2])
    found, gaps = interpolate_gaps(clip, longest=2)
    assert gaps == Gaps(((5, 6),), ((1, 4),))
    assert inner_gaps(found) == [(1, 4)]
    assert inner_gaps(interpolate_gaps(clip, longest=3)[0]) == []


def test_only_points_detected_on_both_sides_are_interpolated():
    points = np.zeros((2, 2, 4))
    points[0, :, 0], points[1, :, 0] = 1.0, 4.0
    points[:, 0, 3] = 0.8
    points[1, 1, 3] = 0.8
    clip = PointClip("points", turning(np.zeros(2), rows=[0, -1, -1, 1]).timing, points)
    found, _ = interpolate_gaps(clip)
    assert_allclose(found.points[found.timing.rows[1:3], 0], [[2, 0, 0, 0.8], [3, 0, 0, 0.8]])
    assert_allclose(found.points[found.timing.rows[1:3], 1, 3], 0.0)


def test_clip_without_gaps_is_returned_unchanged():
    clip = turning(np.zeros(4))
    assert interpolate_gaps(clip)[0] is clip


EARLY = turning(np.array([0.0, 0.1, 0.2]), rows=[0, 1, 2, -1, -1, -1])
LATE = turning(np.array([1.2, 1.3, 1.4]), rows=[-1, -1, 0, 1, 2, -1])


def test_both_tracks_are_joined_and_the_first_wins_in_overlaps():
    assert_array_equal(common_frames(EARLY, LATE), [2])
    assert_allclose(angles_of(joined_tracks(EARLY, LATE))[:5], [0, 0.1, 0.2, 1.3, 1.4])
    assert_allclose(angles_of(joined_tracks(LATE, EARLY))[:5], [0, 0.1, 1.2, 1.3, 1.4])


def test_different_shapes_are_stored_per_frame_and_equal_ones_as_one_row():
    shaped = [replace(clip, shape_weights=np.ones((1, 2))) for clip in (EARLY, LATE)]
    assert joined_tracks(*shaped).shape_weights.shape == (1, 2)
    other = replace(shaped[1], shape_weights=np.zeros((1, 2)))
    found = joined_tracks(shaped[0], other)
    rows = found.timing.rows[:5]
    assert_allclose(found.shape_weights[rows, 0], [1, 1, 1, 0, 0])


def test_points_are_joined():
    points = np.ones((3, 1, 4))
    clips = [PointClip("p", c.timing, k * points) for k, c in ((1, EARLY), (2, LATE))]
    found = joined_tracks(*clips)
    assert_allclose(found.points[found.timing.rows[:5], 0, 0], [1, 1, 1, 2, 2])


def test_tracks_with_different_timelines_are_refused():
    with pytest.raises(RigError):
        joined_tracks(EARLY, turning(np.zeros(3), rate=25.0))


def test_original_frames_are_exact_and_new_ones_are_on_the_arc():
    rng = np.random.default_rng(2)
    clip = turning(rng.uniform(-1, 1, 7), places=rng.normal(size=(7, 3)))
    found = resampled(clip, 90.0)
    assert found.timing.n_frames == 19 and found.timing.first_frame == 0
    assert_array_equal(found.rotations[::3], clip.rotations)
    assert_array_equal(found.figure_translations[::3], clip.figure_translations)
    before, after = angles_of(clip)[:-1], angles_of(clip)[1:]
    assert_allclose(angles_of(found)[1::3], (2 * before + after) / 3, atol=1e-12)


def test_uniform_rotation_is_exact_at_any_rate():
    found = resampled(turning(0.1 * np.arange(31)), 23.976)
    times = np.arange(found.timing.n_frames) / 23.976
    assert found.timing.n_frames == 24  # the last frame is at 23 / 23.976 s, before 1 s
    assert_allclose(angles_of(found), 3.0 * times, atol=1e-12)


def test_rate_that_results_in_millions_of_frames_is_refused():
    with pytest.raises(RigError, match="at most 1,000,000 frames, found 3,000,001"):
        resampled(turning(0.1 * np.arange(91)), 1e6)


def test_no_frames_are_interpolated_in_gaps():
    clip = turning(np.arange(4.0), rows=[0, 1, -1, 2, 3])
    found = resampled(clip, 60.0)
    assert_array_equal(found.timing.present, [1, 1, 1, 0, 0, 0, 1, 1, 1])


def test_points_are_interpolated_if_visible_on_both_sides():
    points = np.zeros((3, 1, 4))
    points[:, 0, 0], points[:, 0, 3] = [0, 2, 8], [1, 1, 0]
    clip = PointClip("points", turning(np.zeros(3)).timing, points)
    found = resampled(clip, 60.0)
    assert_allclose(found.points[:, 0, 0][:4], [0, 1, 2, 2])
    assert_allclose(found.points[:, 0, 3], [1, 1, 1, 1, 0])


def test_trimmed_frames_keep_numbers_times_and_gaps():
    clip = turning(np.arange(5.0), rows=[0, 1, -1, 2, 3, 4])
    found = trimmed(clip, 11, 15)
    assert found.timing.first_frame == 11
    assert found.start == pytest.approx(1 / 30.0, abs=1e-12)
    assert_array_equal(found.timing.present, [True, False, True, True])
    assert_allclose(angles_of(found)[[0, 2, 3]], [1, 2, 3], atol=1e-12)
    assert found.n_rows == 3
    assert_array_equal(trimmed(clip).timing.present, clip.timing.present)


@pytest.mark.parametrize("span", [(9, 12), (12, 12), (10, 16), (None, 16), (15, None)])
def test_trimming_outside_the_clip_is_refused(span):
    with pytest.raises(RigError):
        trimmed(turning(np.zeros(5)), *span)
