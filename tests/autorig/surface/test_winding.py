"""Winding numbers of a cube that is closed or has one face missing."""

import numpy as np
from numpy.testing import assert_allclose

from viewer.autorig.transfer.joint_transfer import winding_numbers

CORNERS = np.array([[x, y, z] for x in (0.0, 1) for y in (0.0, 1) for z in (0.0, 1)])
# Corner k has x = k // 4, y = k // 2 % 2, z = k % 2; counter-clockwise from outside.
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
CUBE = np.array([t for a, b, c, d in SIDES for t in ((a, b, c), (a, c, d))])
MIDDLE, OUTSIDE = np.array([0.5, 0.5, 0.5]), np.array([3.0, 0.2, 0.1])


def test_winding_number_inside_a_cube_is_one():
    found = winding_numbers(CORNERS, CUBE, np.array([MIDDLE, OUTSIDE, [0.01, 0.01, 0.99]]))
    assert_allclose(found, [1.0, 0.0, 1.0], atol=1e-12)


def test_winding_number_of_an_inside_out_cube_is_minus_one():
    assert_allclose(winding_numbers(CORNERS, CUBE[:, ::-1], MIDDLE[None]), [-1.0], atol=1e-12)


def test_missing_face_subtracts_its_solid_angle():
    # Seen from the centre, each of the six faces covers a sixth of the sphere.
    assert_allclose(winding_numbers(CORNERS, CUBE[2:], MIDDLE[None]), [5 / 6], atol=1e-12)


def test_no_points_have_no_winding_numbers():
    assert winding_numbers(CORNERS, CUBE, np.zeros((0, 3))).shape == (0,)
