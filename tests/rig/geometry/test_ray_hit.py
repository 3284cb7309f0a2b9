"""Intersections of rays with triangles, which are hit from either side."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.rig.geometry.ray_hit import first_hit, surface_point

# A unit square at z = 0, and the same at z = 1 with the opposite winding.
POSITIONS = np.array(
    [[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))], float
)
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]])
DOWN = np.array([0.0, 0.0, -1.0])


def test_nearest_triangle_is_hit_from_either_side():
    hit = first_hit(POSITIONS, TRIANGLES, np.array([0.75, 0.25, 3.0]), DOWN)
    assert (hit.triangle, hit.distance) == (2, 2.0)
    again = first_hit(POSITIONS, TRIANGLES, np.array([0.25, 0.75, -5.0]), -DOWN)
    assert (again.triangle, again.distance) == (1, 5.0)


def test_point_follows_the_vertices():
    hit = first_hit(POSITIONS, TRIANGLES, np.array([0.75, 0.25, 0.5]), DOWN)
    assert hit.triangle == 0
    assert_allclose(hit.barycentric, [0.25, 0.5, 0.25], atol=1e-15)
    moved = POSITIONS * [2.0, 3.0, 1.0] + [0.0, 0.0, 7.0]
    assert_allclose(surface_point(moved, TRIANGLES, hit), [1.5, 0.75, 7.0], atol=1e-15)


def test_distance_is_in_units_of_the_direction_vector():
    slanted = np.array([0.2, 0.2, -0.4])
    hit = first_hit(POSITIONS, TRIANGLES, np.array([0.1, 0.1, 0.8]), slanted)
    assert hit.distance == pytest.approx(2.0)  # a descent of 0.8, at 0.4 per direction vector


@pytest.mark.parametrize(
    ("origin", "direction"),
    [
        ((2.0, 0.5, 3.0), (0.0, 0.0, -1.0)),  # next to the squares
        ((0.5, 0.5, 3.0), (0.0, 0.0, 1.0)),  # behind the eye
        ((-1.0, 0.5, 0.5), (1.0, 0.0, 0.0)),  # between both squares
        ((-1.0, 0.5, 0.0), (1.0, 0.0, 0.0)),  # in the plane of one square
    ],
)
def test_rays_next_to_behind_and_between_triangles_have_no_hit(origin, direction):
    assert first_hit(POSITIONS, TRIANGLES, np.array(origin), np.array(direction)) is None
    assert first_hit(POSITIONS, TRIANGLES[:0], np.array(origin), np.array(direction)) is None


def test_edges_have_no_gap():
    for x in np.linspace(0.01, 0.99, 23):  # the diagonal that both triangles share
        assert first_hit(POSITIONS, TRIANGLES[:2], np.array([x, x, 1.0]), DOWN) is not None


def test_many_triangles_are_processed_in_chunks(monkeypatch):
    monkeypatch.setattr("viewer.rig.geometry.ray_hit._AT_ONCE", 1)
    hit = first_hit(POSITIONS, TRIANGLES, np.array([0.25, 0.75, 3.0]), DOWN)
    assert (hit.triangle, hit.distance) == (3, 2.0)
