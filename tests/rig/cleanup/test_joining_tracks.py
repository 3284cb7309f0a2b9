"""Joining of tracks: order, overlap, shapes, and points."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from turning import angles_of, turning

from viewer.errors import RigError
from viewer.rig.captures.points import PointClip
from viewer.rig.cleanup.tracks import common_frames, joined_tracks

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
