"""Resampling and trimming: times, frame numbers, exact frames, and gaps."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from turning import angles_of, turning

from viewer.errors import RigError
from viewer.rig.captures.points import PointClip
from viewer.rig.cleanup.frames import resampled, trimmed


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
