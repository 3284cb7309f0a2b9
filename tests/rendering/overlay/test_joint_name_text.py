"""Joint names: the selected joint first, then the nearest, and the number of omitted names."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rendering.drawn_figures import skeleton

from viewer.rendering.camera import Camera
from viewer.rendering.overlay.annotation import letters_for, place_labels
from viewer.rendering.overlay.joint_marks import HIGHLIGHT, joint_marks_of, name_labels
from viewer.rendering.overlay.typeface import Lettering
from viewer.rendering.view import view_of
from viewer.rig.figure import Figure
from viewer.rig.scene import Actor

SIZE = (800, 720)
BOX = np.array([[-2.0, -2.0, -2.0], [2.0, 2.0, 2.0]])


@pytest.fixture(scope="module")
def lettering():
    return Lettering(letters_for(SIZE))


def placed(lettering, offsets, selected=(0, -1)):
    """Return the names drawn for joints at given positions, seen from +z."""
    joints = skeleton([-1] * len(offsets), offsets)
    marks = joint_marks_of([Actor(Figure("figure", skeleton=joints))])
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0, orthographic=True)
    view = view_of(camera, SIZE, BOX)
    return place_labels([name_labels(marks, selected)], view, SIZE, lettering)


def test_well_separated_joints_are_all_named(lettering):
    names = placed(lettering, [[-1, 0, 0], [1, 0, 0], [0, 1, 0]])
    assert sorted(names.texts) == ["j0", "j1", "j2"]
    assert (names.n_seen, names.n_left_out) == ((3,), (0,))
    # At 180 pixels per unit, joint 0 is at (220, 360); its name is to the right at the same height.
    left, top = names.corners[names.texts.index("j0")].tolist()
    assert 222 < left < 230 and 345 < top < 360


def test_nearest_joints_are_named_if_not_all_fit(lettering):
    names = placed(lettering, [[0, 0, z] for z in (0.0, 1.0, -1.0, 0.5, -0.5)])
    # The names are to the right and left of the position, and above and below it.
    assert names.texts == ("j1", "j3", "j0", "j4")
    assert (names.n_seen, names.n_left_out) == ((5,), (1,))


def test_selected_joint_is_named_first_in_its_own_colour(lettering):
    names = placed(lettering, [[0, 0, 0.0], [0, 0, 1.0], [0, 0, -1.0]], selected=(0, 2))
    assert names.texts == ("j2", "j1", "j0")
    assert_allclose(names.colors[0], HIGHLIGHT[:3])
    assert (names.colors[1] > 0.9).all()
    other = placed(lettering, [[0, 0, 0.0], [0, 0, 1.0], [0, 0, -1.0]], selected=(1, 2))
    assert other.texts == ("j1", "j0", "j2")


def test_joints_outside_the_image_are_not_counted(lettering):
    names = placed(lettering, [[0, 0, 0], [9, 0, 0], [0, -9, 0]])
    assert names.texts == ("j0",) and names.n_seen == (1,)


def test_empty_scene_has_no_names(lettering):
    camera = Camera()
    view = view_of(camera, SIZE, BOX)
    names = place_labels([name_labels([], (0, -1))], view, SIZE, lettering)
    assert names.texts == () and names.n_left_out == (0,)
