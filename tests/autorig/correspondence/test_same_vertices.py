"""Vertices shared by two meshes, as opposed to vertices that are only close to each other."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.autorig.correspondence import at_vertices, same_vertices
from viewer.autorig.surface.welding import weld
from viewer.rig.geometry.closest_point import Surface

COUNT = 9


def grid(step=1.0, start=0.0):
    """Return a grid in the plane z = 0 with two triangles per cell."""
    line = start + step * np.arange(COUNT)
    x, y = np.meshgrid(line, line, indexing="ij")
    positions = np.stack([x.ravel(), y.ravel(), np.zeros(COUNT * COUNT)], axis=1)
    number = np.arange(COUNT * COUNT).reshape(COUNT, COUNT)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    triangles = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    return positions, triangles.reshape(-1, 3).astype(np.int32)


def found(template, target):
    distances = Surface(*template).closest(target[0]).distances
    one, other = weld(*template), weld(*target)
    return same_vertices(one, other, distances)


def test_moved_vertices_are_recognised_in_any_order():
    rng = np.random.default_rng(4)
    positions, triangles = grid()
    order = rng.permutation(len(positions))
    rank = np.argsort(order)
    moved = positions[order] + rng.uniform(-0.2, 0.2, positions.shape)
    assert (found((positions, triangles), (moved, rank[triangles].astype(np.int32))) == order).all()


def test_offset_shell_has_the_same_vertices():
    positions, triangles = grid()
    lifted = positions + np.array([0.0, 0.0, 3.0])
    assert (found((positions, triangles), (lifted, triangles)) == np.arange(81)).all()


@pytest.mark.parametrize(("step", "start"), [(0.5, 0.0), (1.0, 0.5), (2.0, 0.0)])
def test_different_tessellation_has_different_vertices(step, start):
    same = found(grid(), grid(step, start))
    assert (same >= 0).mean() < 0.05


def test_rotated_tessellation_has_different_vertices():
    positions, triangles = grid()
    cosine, sine = np.cos(0.5), np.sin(0.5)
    rotated = (positions - 4.0) @ np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]]) + 4.0
    same = found((positions, triangles), (rotated, triangles))
    assert (same >= 0).mean() < 0.2  # vertices near the centre of rotation remain


def test_points_snap_to_near_vertices_only():
    positions, triangles = grid()
    asked = np.array([[0.2, 0.1, 1.0], [3.4, 3.3, 0.0]])
    points = Surface(positions, triangles).closest(asked)
    moved = at_vertices(points, asked, triangles, positions, np.array([0, -1]))
    assert_allclose(moved.positions, [[0, 0, 0], [3.4, 3.3, 0]], atol=1e-12)
    assert_allclose(moved.distances, [np.sqrt(1.05), 0.0], atol=1e-12)
    corner = triangles[moved.triangles[0]][moved.barycentric[0].argmax()]
    assert corner == 0 and sorted(moved.barycentric[0]) == [0, 0, 1]
    assert moved.triangles[1] == points.triangles[1]


def test_vertex_without_triangles_is_not_on_the_surface():
    positions, triangles = grid()
    places = np.concatenate([positions, [[0.1, 0.1, 0.0]]])
    asked = np.array([[0.1, 0.1, 0.0]])
    points = Surface(positions, triangles).closest(asked)
    same = at_vertices(points, asked, triangles, places, np.array([81]))
    assert_allclose(same.positions, asked, atol=1e-12)
