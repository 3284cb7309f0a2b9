"""Projected points in front of and behind a camera on an axis, calculated by hand."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.rendering.camera import Camera
from viewer.rendering.projection import picture_scale, project, project_segments, unproject
from viewer.rendering.view import view_of

BOX = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
SIZE = (200, 100)


@pytest.fixture
def view():
    """Return a view of a camera at (0, 0, 4) that looks along -z with 90 degrees."""
    return view_of(Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=4.0), SIZE, BOX)


def test_pixels_are_those_of_a_pinhole(view):
    # Since tan(45 deg) = 1, a unit at a distance of 4 is 50 / 4 pixels from the centre (100, 50).
    points = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 0.0], [1.0, 1.0, 2.0], [-2.0, -1.0, -1.0]])
    found = project(view, SIZE, points)
    wanted = [[100, 50], [112.5, 25], [125, 25], [80, 60]]
    assert_allclose(found.pixels, wanted, atol=1e-9)
    assert found.seen.all()
    assert found.depths[2] < found.depths[0] == found.depths[1] < found.depths[3]


def test_points_behind_or_outside_the_view_are_not_visible(view):
    points = np.array([[0.0, 0.0, 5.0], [0.0, 0.0, 4.0], [9.0, 0.0, 0.0], [0.0, 4.5, 0.0]])
    assert not project(view, SIZE, points).seen.any()


def test_no_points_project_to_no_points(view):
    assert project(view, SIZE, np.zeros((0, 3))).pixels.shape == (0, 2)


@pytest.mark.parametrize("orthographic", [False, True])
def test_pixels_unproject_to_points_at_a_given_depth(orthographic):
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=4.0, orthographic=orthographic)
    view, points = view_of(camera, SIZE, BOX), np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 2.0]])
    found = unproject(view, SIZE, points, np.array([[112.5, 25.0], [100.0, 75.0]]))
    # A unit is 12.5 pixels at the target; at z = 2 half as much is visible, except with an
    # orthographic camera.
    assert_allclose(found, [[1, 2, 0], [0, -2 if orthographic else -1, 2]], atol=1e-12)


def test_segment_in_front_keeps_both_ends(view):
    ends, seen = project_segments(view, SIZE, np.zeros((1, 3)), np.array([[1.0, 2.0, 0.0]]))
    assert seen.all()
    assert_allclose(ends, [[[100, 50], [112.5, 25]]], atol=1e-9)


def test_segment_that_ends_behind_the_eye_keeps_its_direction(view):
    # In the plane x = y, the segment projects to a line to the right and upwards for any clipping.
    ends, seen = project_segments(
        view, SIZE, np.array([[1.0, 1.0, 0.0]]), np.array([[1.0, 1.0, 9.0]])
    )
    start, end = ends[0]
    assert seen.all()
    assert_allclose(start, [112.5, 37.5], atol=1e-9)
    way = end - start
    assert way[0] > 1.0 and math.isclose(way[0], -way[1], rel_tol=1e-9)


def test_segment_behind_the_eye_is_not_visible(view):
    behind = np.array([[0.0, 0.0, 5.0], [1.0, 0.0, 4.5]])
    assert not project_segments(view, SIZE, behind, behind[::-1])[1].any()


@pytest.mark.parametrize(
    ("size", "scale"),
    [
        ((1280, 720), 1.0),
        ((2560, 1440), 2.0),
        ((720, 1440), 0.8),
        ((99, 99), 0.8),
        ((9999, 9999), 4.0),
    ],
)
def test_marks_grow_with_the_image(size, scale):
    # 720 x 1440 counts as a height of 540 pixels, which is below the minimum for marks.
    assert picture_scale(size) == pytest.approx(scale)
