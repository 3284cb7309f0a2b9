"""Interpolation of gaps: closed forms, length limits, and keypoints."""

import numpy as np
from numpy.testing import assert_allclose
from turning import angles_of, turning

from viewer.rig.captures.points import PointClip
from viewer.rig.cleanup.tracks import Gaps, inner_gaps, interpolate_gaps


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
