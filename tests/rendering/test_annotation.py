"""Words beside points: which are drawn where there is no room for all, and how large."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.rendering.annotation import Labels, letters_for, place_labels
from viewer.rendering.camera import Camera
from viewer.rendering.lettering import Lettering
from viewer.rendering.view import view_of

SIZE = (800, 720)
BOX = np.array([[-2.0, -2.0, -2.0], [2.0, 2.0, 2.0]])


@pytest.fixture(scope="module")
def lettering():
    return Lettering(letters_for(SIZE))


def placed(lettering, points, ranks, words=None):
    """Return what is drawn of words at points, seen from +z, 180 pixels a unit."""
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0, orthographic=True)
    count = len(points)
    colors = np.arange(3.0 * count).reshape(count, 3) / 100
    words = words or tuple("abcdefgh"[:count])
    labels = Labels(words, np.array(points, dtype=float), np.array(ranks), colors)
    return place_labels(labels, view_of(camera, SIZE, BOX), SIZE, lettering)


def test_letters_grow_with_the_picture():
    # 13 pixels at 720; 800 wide counts as 600 high.
    assert letters_for((1280, 720)) == 13 and letters_for((2560, 1440)) == 26
    assert letters_for(SIZE) == 11


def test_low_ranks_come_first_and_then_the_nearer(lettering):
    same_place = [[0, 0, 0.0], [0, 0, 1.0], [0, 0, -1.0], [0, 0, 0.5]]
    # There is room to the right and to the left of the place.
    assert placed(lettering, same_place, [1, 1, 0, 1]).words == ("c", "b")
    assert placed(lettering, same_place, [1, 1, 1, 1]).words == ("b", "d")
    assert placed(lettering, same_place, [0, 1, 2, 3]).words == ("a", "b")


def test_colours_go_with_their_words(lettering):
    found = placed(lettering, [[0, 0, 0.0], [0, 0, 1.0], [0, 0, -1.0]], [2, 1, 0])
    assert found.words == ("c", "b")
    assert_allclose(found.colors, [[0.06, 0.07, 0.08], [0.03, 0.04, 0.05]])
    assert (found.n_seen, found.n_left_out) == (3, 1)


def test_no_words_are_none(lettering):
    found = placed(lettering, np.zeros((0, 3)), np.zeros(0, int), ())
    assert found.words == () and found.corners.shape == (0, 2) and found.n_left_out == 0
