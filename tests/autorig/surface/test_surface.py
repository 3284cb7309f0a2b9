"""Surfaces: Laplacian, welded vertices and winding."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.autorig.surface.laplacian import (
    cotangent_laplacian,
    graph_laplacian,
    laplacian,
    voronoi_areas,
)
from viewer.autorig.surface.welding import edges, islands, weld
from viewer.autorig.transfer.joint_transfer import winding_numbers
from viewer.rigs.mesh import triangle_areas

ROUNDING = 1e-12


def grid(count, rng=None):
    """Return a flat grid of count x count vertices with jittered inner vertices."""
    x, y = np.meshgrid(np.arange(count, dtype=float), np.arange(count, dtype=float))
    positions = np.stack([x.ravel(), y.ravel(), np.zeros(count * count)], axis=1)
    index = np.arange(count * count).reshape(count, count)
    a, b, c, d = (
        part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1])
    )
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    inner = index[1:-1, 1:-1].ravel()
    if rng is not None:
        positions[inner, :2] += rng.uniform(-0.2, 0.2, (len(inner), 2))
    return positions, triangles.astype(np.int32), inner


def test_cotangent_laplacian_of_a_right_triangle_matches_hand_calculation():
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    # The cotangents are 0 at the right angle and 1 at the other angles; each edge gets half of the
    # opposite one.
    expected = [[1.0, -0.5, -0.5], [-0.5, 0.5, 0.0], [-0.5, 0.0, 0.5]]
    found = cotangent_laplacian(positions, np.array([[0, 1, 2]])).toarray()
    np.testing.assert_allclose(found, expected, atol=ROUNDING)


def test_cotangent_laplacian_of_a_linear_function_is_zero_inside_a_flat_mesh():
    positions, triangles, inner = grid(6, np.random.default_rng(1))
    values = 2.0 * positions[:, 0] - 3.0 * positions[:, 1]
    found = cotangent_laplacian(positions, triangles) @ values
    np.testing.assert_allclose(found[inner], 0.0, atol=1e-11)


def test_cotangent_laplacian_of_a_quadratic_matches_the_continuous_one():
    positions, triangles, inner = grid(7)
    operator = cotangent_laplacian(positions, triangles)
    values = positions[:, 0] ** 2 + positions[:, 1] ** 2  # Laplacian 4
    areas = voronoi_areas(positions, triangles)
    np.testing.assert_allclose((operator @ values / areas)[inner], -4.0, atol=1e-11)


def test_cotangent_laplacian_stays_positive_with_slivers():
    rng = np.random.default_rng(2)
    positions, triangles, _ = grid(5, rng)
    positions[:, 1] *= rng.choice([1e-6, 1.0], len(positions))  # needles and caps
    positions[7] = 0.5 * (positions[6] + positions[8])  # zero area
    operator = cotangent_laplacian(positions, triangles).toarray()
    assert np.isfinite(operator).all()
    np.testing.assert_allclose(operator, operator.T, atol=ROUNDING)
    # The tolerance is rounding of the largest eigenvalue, which is of order 100.
    np.testing.assert_allclose(operator.sum(axis=1), 0.0, atol=1e-10)
    assert np.linalg.eigvalsh(operator).min() > -1e-10


def test_cotangent_laplacian_treats_zero_area_triangles_as_equilateral():
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    found = cotangent_laplacian(positions, np.array([[0, 1, 2]])).toarray()
    half = 0.5 / np.sqrt(3.0)
    expected = half * np.array([[2.0, -1, -1], [-1, 2, -1], [-1, -1, 2]])
    np.testing.assert_allclose(found, expected, atol=ROUNDING)


def test_graph_laplacian_counts_neighbours():
    found = graph_laplacian(4, np.array([[0, 1, 2], [2, 1, 3]])).toarray()
    expected = [[2, -1, -1, 0], [-1, 3, -1, -1], [-1, -1, 3, -1], [0, -1, -1, 2]]
    assert found.tolist() == expected


def test_voronoi_areas_of_an_equilateral_triangle_are_thirds():
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, np.sqrt(0.75), 0]])
    found = voronoi_areas(positions, np.array([[0, 1, 2]]))
    np.testing.assert_allclose(found, np.sqrt(0.75) / 6.0, atol=ROUNDING)


def test_voronoi_areas_of_an_obtuse_triangle_are_half_and_quarters():
    positions = np.array([[0.0, 1, 0], [-3, 0, 0], [3, 0, 0]])  # area 3, obtuse at the first corner
    found = voronoi_areas(positions, np.array([[0, 1, 2]]))
    np.testing.assert_allclose(found, [1.5, 0.75, 0.75], atol=ROUNDING)


def test_voronoi_areas_sum_to_the_area():
    rng = np.random.default_rng(3)
    positions = rng.normal(size=(30, 3))
    triangles = rng.permuted(np.tile(np.arange(30), (50, 1)), axis=1)[:, :3]
    found = voronoi_areas(positions, triangles)
    assert found.min() > 0.0
    assert found.sum() == pytest.approx(triangle_areas(positions, triangles).sum(), rel=1e-12)


def test_non_manifold_island_gets_the_graph_laplacian():
    fan = np.array([[0.0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 0.5, 0], [-1, -0.5, 0]])
    other = np.array([[9.0, 0, 0], [10, 0, 0], [9, 1, 0]])
    mesh = weld(
        np.concatenate([fan, other]), np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4], [5, 6, 7]])
    )
    operator, areas = laplacian(mesh)
    dense = operator.toarray()
    assert dense[:5, :5].diagonal().tolist() == [4.0, 4.0, 2.0, 2.0, 2.0]
    assert dense[0, 1] == -1.0
    np.testing.assert_allclose(dense[5:, 5:].diagonal(), [1.0, 0.5, 0.5], atol=ROUNDING)
    assert (dense[:5, 5:] == 0.0).all()
    assert np.ptp(areas[:5]) == 0.0
    np.testing.assert_allclose(areas[5:], [0.25, 0.125, 0.125], atol=ROUNDING)


def test_every_vertex_of_the_laplacian_has_a_positive_area():
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5]])
    _, areas = laplacian(weld(positions, np.array([[0, 1, 2]])))
    # The minimum is 1e-9 of the mean of 1/4, 1/8 and 1/8.
    assert areas[3] == pytest.approx(1e-9 / 6.0, rel=1e-9)
    _, areas = laplacian(weld(positions, np.zeros((0, 3), dtype=np.int32)))
    assert areas.tolist() == [1.0, 1.0, 1.0, 1.0]


SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])


def test_weld_joins_the_corners_of_a_seam():
    # The two triangles of a square have three separate vertices each.
    positions = SQUARE[[0, 1, 2, 0, 2, 3]]
    welded = weld(positions, np.array([[0, 1, 2], [3, 4, 5]]))
    assert welded.vertices.tolist() == [0, 1, 2, 0, 2, 3]
    assert welded.positions.tolist() == SQUARE.tolist()
    assert welded.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert welded.islands.tolist() == [0, 0, 0, 0]


def test_weld_treats_minus_zero_as_zero():
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [-0.0, 0, -0.0]])
    assert weld(positions, np.array([[0, 1, 2]])).vertices.tolist() == [0, 1, 2, 0]


def test_weld_joins_vertices_that_differ_by_rounding():
    # The median edge is 1, so vertices within 1e-4 are joined.
    positions = SQUARE[[0, 1, 2, 0, 2, 3]].copy()
    positions[3, 2] = 0.5e-4
    positions[4, 2] = 2e-4
    welded = weld(positions, np.array([[0, 1, 2], [3, 4, 5]]))
    assert welded.vertices.tolist() == [0, 1, 2, 0, 3, 4]


def test_weld_joins_a_whole_cluster():
    rng = np.random.default_rng(5)
    cluster = rng.uniform(-1e-5, 1e-5, (40, 3))
    positions = np.concatenate([SQUARE, cluster])
    welded = weld(positions, np.array([[0, 1, 2], [0, 2, 3]]))
    assert welded.vertices.tolist() == [0, 1, 2, 3] + [0] * 40


def test_weld_drops_collapsed_triangles_and_keeps_zero_area_ones():
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [0, 0, 0]])
    welded = weld(positions, np.array([[0, 1, 3], [0, 4, 1], [0, 1, 2]]))
    assert welded.triangles.tolist() == [[0, 1, 3], [0, 1, 2]]


def test_weld_counts_an_unused_vertex_as_an_island():
    positions = np.concatenate([SQUARE + 5.0, SQUARE])
    welded = weld(positions, np.array([[4, 5, 6], [0, 1, 2]]))
    assert welded.islands.tolist() == [0, 0, 0, 1, 2, 2, 2, 3]
    assert welded.n_islands == 4


def test_weld_of_an_empty_mesh_is_empty():
    welded = weld(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32))
    assert welded.n_islands == 0
    assert len(welded.positions) == 0


def test_weld_of_coincident_points_is_one_vertex():
    welded = weld(np.ones((3, 3)), np.array([[0, 1, 2]]))
    assert welded.vertices.tolist() == [0, 0, 0]
    assert welded.triangles.shape == (0, 3)


def test_islands_are_numbered_by_their_first_vertex():
    triangles = np.array([[6, 5, 4], [1, 2, 3]])
    assert islands(7, triangles).tolist() == [0, 1, 1, 1, 2, 2, 2]


def test_edges_are_listed_once():
    assert edges(np.array([[0, 1, 2], [2, 1, 3]])).tolist() == [
        [0, 1],
        [0, 2],
        [1, 2],
        [1, 3],
        [2, 3],
    ]


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
