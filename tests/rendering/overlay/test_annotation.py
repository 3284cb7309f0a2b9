"""Labels next to points: size, and priority if not all fit."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.rendering.camera import Camera
from viewer.rendering.overlay.annotation import Labels, leader_lines, letters_for, place_labels
from viewer.rendering.overlay.typeface import Lettering
from viewer.rendering.view import view_of

SIZE = (800, 720)
BOX = np.array([[-2.0, -2.0, -2.0], [2.0, 2.0, 2.0]])


@pytest.fixture(scope="module")
def lettering():
    return Lettering(letters_for(SIZE))


def placed(lettering, points, ranks, words=None):
    """Return the labels drawn for texts at points, seen from +z with 180 pixels per unit."""
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0, orthographic=True)
    count = len(points)
    colors = np.arange(3.0 * count).reshape(count, 3) / 100
    words = words or tuple("abcdefgh"[:count])
    labels = Labels(words, np.array(points, dtype=float), np.array(ranks), colors)
    return place_labels([labels], view_of(camera, SIZE, BOX), SIZE, lettering)


def test_letters_grow_with_the_image():
    # The size is 17 pixels at a height of 720; a width of 800 counts as a height of 600, which
    # gives 14.2.
    assert letters_for((1280, 720)) == 17 and letters_for((2560, 1440)) == 34
    assert letters_for(SIZE) == 14


def test_labels_are_ordered_by_rank_then_distance(lettering):
    same_place = [[0, 0, 0.0], [0, 0, 1.0], [0, 0, -1.0], [0, 0, 0.5]]
    assert placed(lettering, same_place, [1, 1, 0, 1]).texts == ("c", "b", "d", "a")
    assert placed(lettering, same_place, [1, 1, 1, 1]).texts == ("b", "d", "a", "c")
    assert placed(lettering, same_place, [0, 1, 2, 3]).texts == ("a", "b", "c", "d")


def test_colours_match_their_labels(lettering):
    found = placed(lettering, [[0, 0, 0.0], [0, 0, 1.0], [9, 0, -1.0]], [2, 1, 0])
    assert found.texts == ("b", "a")
    assert_allclose(found.colors, [[0.03, 0.04, 0.05], [0.0, 0.01, 0.02]])
    assert (found.n_seen, found.n_left_out) == ((2,), (0,))


def test_no_labels_have_no_text(lettering):
    found = placed(lettering, np.zeros((0, 3)), np.zeros(0, int), ())
    assert found.texts == () and found.corners.shape == (0, 2) and found.n_left_out == (0,)


def test_labels_of_several_annotations_are_placed_together(lettering):
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0, orthographic=True)
    view, place, white = view_of(camera, SIZE, BOX), np.zeros((1, 3)), np.ones((1, 3))
    many = Labels(("a",) * 6, np.repeat(place, 6, axis=0), np.full(6, 7), np.ones((6, 3)))
    one = Labels(("b",), place, np.array([3]), white)
    found = place_labels([many, one], view, SIZE, lettering)
    assert found.texts[0] == "b" and found.owners.tolist() == [1] + [0] * (len(found.texts) - 1)
    assert found.n_seen == (6, 1) and found.n_left_out == (7 - len(found.texts), 0)
    sizes = lettering.sizes(found.texts)
    cover = np.zeros(SIZE[::-1], dtype=int)
    for (left, top), (width, height) in zip(found.corners, sizes, strict=True):
        cover[top : top + height, left : left + width] += 1
    assert cover.max() == 1


def test_lines_connect_the_point_and_its_label(lettering):
    found = placed(lettering, np.zeros((3, 3)), [0, 1, 2])
    assert found.has_line.tolist() == [False, False, True]
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0, orthographic=True)
    view = view_of(camera, SIZE, BOX)
    lines = leader_lines(found, view, SIZE)
    # A dark line is beneath one in the colour of the text, in the plane of the point at z = 0.
    assert len(lines.widths) == 2 and lines.widths[0] > lines.widths[1]
    assert_allclose(lines.colors[1], [0.06, 0.07, 0.08, 1.0])
    # The scale is 180 pixels per unit, the centre (400, 360). The text is three gaps of 7 * 600 /
    # 720 above.
    assert_allclose(lines.starts[1], [0.0, 5.0 * 600 / 720 / 180, 0.0], atol=1e-12)
    end = [0.0, (360.0 - found.ends[2, 1]) / 180.0, 0.0]
    assert_allclose(lines.ends[1], end, atol=1e-12)
    assert 360.0 - found.ends[2, 1] == pytest.approx(17.5, abs=0.51)
