"""Triangles: closest points, hits of rays, shells and topology."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import sparse

from viewer.errors import RigError
from viewer.rigs.geometry.closest_point import Surface, SurfacePoints, interpolate
from viewer.rigs.geometry.ray_hit import first_hit, surface_point
from viewer.rigs.geometry.topology import (
    _has_long_borders,
    components,
    edges_of,
    orientations,
    shell_of,
    welded,
)
from viewer.rigs.mesh import Mesh
from viewer.rigs.skin import skin_from_lists

# Distances are of order 1; this allows for rounding of a few operations and of squares near 0.
ROUNDING = 1e-12


def brute_force(points, positions, triangles):
    """Return the distance of each point to the nearest triangle, trying every pair.

    The closest point of a triangle is a corner, the foot on an edge, or the foot on the plane.
    """
    points = points[:, None]  # (P, 1, 3) against (T, 3)
    corners = [positions[triangles[:, k]] for k in range(3)]
    edges = [(corners[k], corners[k - 2] - corners[k]) for k in range(3)]
    best = np.min([np.linalg.norm(points - corner, axis=2) for corner in corners], axis=0)
    for start, edge in edges:
        squared = np.einsum("ta,ta->t", edge, edge)
        along = ((points - start) * edge).sum(axis=2) / np.where(squared > 0, squared, 1.0)
        gap = np.linalg.norm(points - start - along[..., None] * edge, axis=2)
        best = np.where((squared > 0) & (along > 0) & (along < 1), np.minimum(best, gap), best)
    normal = np.cross(edges[0][1], -edges[2][1])
    squared = np.einsum("ta,ta->t", normal, normal)
    is_flat = squared <= 1e-30
    height = ((points - corners[0]) * normal).sum(axis=2) / np.where(is_flat, 1.0, squared)
    foot = points - height[..., None] * normal
    sides = [(np.cross(edge, foot - start) * normal).sum(axis=2) for start, edge in edges]
    inside = (np.min(sides, axis=0) > 0) & ~is_flat
    gap = np.linalg.norm(foot - points, axis=2)
    return np.where(inside, np.minimum(best, gap), best).min(axis=1)


def soup(rng, count, size):
    centers = rng.uniform(-1, 1, (count, 1, 3))
    positions = (centers + rng.normal(size=(count, 3, 3)) * size).reshape(-1, 3)
    return positions, np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


def check(points, positions, triangles):
    found = Surface(positions, triangles).closest(points)
    expected = brute_force(points, positions, triangles)
    np.testing.assert_allclose(found.distances, expected, atol=ROUNDING)
    corners = positions[triangles[found.triangles]]
    np.testing.assert_allclose(
        np.einsum("nk,nka->na", found.barycentric, corners), found.positions, atol=ROUNDING
    )
    np.testing.assert_allclose(
        np.linalg.norm(found.positions - points, axis=1), expected, atol=ROUNDING
    )
    np.testing.assert_allclose(found.barycentric.sum(axis=1), 1.0, atol=ROUNDING)
    assert found.barycentric.min() >= 0.0


@pytest.mark.slow
@pytest.mark.parametrize("size", [0.01, 0.1, 1.0])
def test_closest_agrees_with_brute_force(size):
    rng = np.random.default_rng(1)
    positions, triangles = soup(rng, 150, size)
    check(rng.uniform(-1.5, 1.5, (60, 3)), positions, triangles)


@pytest.mark.slow
def test_closest_finds_long_triangles_among_small_ones():
    rng = np.random.default_rng(2)
    positions, triangles = soup(rng, 150, 0.02)
    # Two triangles a thousand times as long, and a needle.
    positions[:9] = [
        [-40, -0.5, -40], [40, -0.5, -40], [40, -0.5, 40],
        [-40, -0.5, -40], [40, -0.5, 40], [-40, -0.5, 40],
        [-30, 0.3, 0.1], [30, 0.3, 0.1], [30, 0.3, 0.101],
    ]  # fmt: skip
    points = np.concatenate([rng.uniform(-1, 1, (50, 3)), rng.uniform(-30, 30, (20, 3))])
    check(points, positions, triangles)


def test_closest_treats_zero_area_triangles_as_segments_and_points():
    rng = np.random.default_rng(3)
    positions, triangles = soup(rng, 40, 0.05)
    positions[0:3] = positions[0]  # a point
    positions[3:6] = [[0, 0, 0], [1, 1, 0], [0.25, 0.25, 0]]  # a segment
    positions[6:9] = [[0, 1, 0], [0, 1, 0], [0, 1, 1]]  # a segment with a repeated end point
    check(rng.uniform(-1, 1, (60, 3)), positions, triangles)


def test_closest_when_all_triangles_are_one_point():
    found = Surface(np.ones((3, 3)), np.array([[0, 1, 2], [0, 0, 0]])).closest(
        np.array([[1.0, 1.0, 3.0]])
    )
    assert found.distances.tolist() == [2.0]
    assert found.positions.tolist() == [[1.0, 1.0, 1.0]]


def test_closest_point_in_each_of_the_seven_regions_of_a_triangle():
    positions = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0]])
    points = np.array(
        [[1, 1, 2], [-1, -1, 0], [6, -1, 0], [-1, 6, 0], [2, -3, 0], [-3, 1, 0], [4, 4, 0]],
        dtype=float,
    )
    found = Surface(positions, np.array([[0, 1, 2]])).closest(points)
    expected = [[1, 1, 0], [0, 0, 0], [4, 0, 0], [0, 4, 0], [2, 0, 0], [0, 1, 0], [2, 2, 0]]
    np.testing.assert_allclose(found.positions, expected, atol=ROUNDING)
    np.testing.assert_allclose(found.barycentric[0], [0.5, 0.25, 0.25], atol=ROUNDING)


def test_closest_is_as_exact_far_from_the_origin():
    rng = np.random.default_rng(4)
    positions, triangles = soup(rng, 50, 0.1)
    points = rng.uniform(-1, 1, (20, 3))
    near = Surface(positions, triangles).closest(points)
    shift = 4096.0 * np.array([1.0, -2.0, 4.0])
    far = Surface(positions + shift, triangles).closest(points + shift)
    # One unit in the last place of the shifted coordinates is 2e-12.
    np.testing.assert_allclose(far.distances, near.distances, atol=1e-11)


@pytest.mark.slow
def test_closest_from_the_centre_of_a_sphere_checks_every_triangle():
    turns = np.linspace(0, 2 * np.pi, 41)[:-1]
    heights = np.linspace(0.05, np.pi - 0.05, 40)
    rings = np.stack(
        [
            np.outer(np.sin(heights), np.cos(turns)),
            np.outer(np.sin(heights), np.sin(turns)),
            np.outer(np.cos(heights), np.ones(40)),
        ],
        axis=-1,
    )
    index = np.arange(1600).reshape(40, 40)
    quads = [index[:-1], np.roll(index, -1, 1)[:-1], np.roll(index, -1, 1)[1:], index[1:]]
    a, b, c, d = (quad.ravel() for quad in quads)
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    check(np.array([[0.0, 0.0, 0.0], [0.01, 0.0, -0.02]]), rings.reshape(-1, 3), triangles)


def test_closest_without_points_is_empty():
    found = Surface(np.eye(3), np.array([[0, 1, 2]])).closest(np.zeros((0, 3)))
    assert found.triangles.shape == (0,)
    assert found.positions.shape == (0, 3)


@pytest.mark.parametrize(
    ("positions", "triangles", "message"),
    [
        (np.eye(3), np.zeros((0, 3), int), "expected a mesh with triangles, found none"),
        (np.eye(3), [[0, 1, 3]], "triangles: expected vertex indices 0 to 2, found 0 to 3"),
        (np.eye(3), [[-1, 1, 2]], "triangles: expected vertex indices 0 to 2, found -1 to 2"),
    ],
)
def test_surface_refuses_meshes_that_cannot_be_searched(positions, triangles, message):
    with pytest.raises(RigError) as caught:
        Surface(positions, np.asarray(triangles))
    assert str(caught.value) == message


def test_closest_refuses_points_that_are_not_finite():
    surface = Surface(np.eye(3), np.array([[0, 1, 2]]))
    with pytest.raises(RigError) as caught:
        surface.closest(np.array([[0.0, np.nan, 0.0]]))
    assert str(caught.value) == "points: expected finite numbers, found nan at index 0, 1"


TWO = SurfacePoints([1, 0], [[0.5, 0.25, 0.25], [0, 1, 0]], np.zeros((2, 3)), np.zeros(2))
TRIANGLES = np.array([[0, 1, 2], [2, 1, 3]])


def test_interpolate_blends_corner_values_by_barycentric_weights():
    values = np.array([[0.0, 1.0], [2.0, 0.0], [4.0, 0.0], [8.0, 4.0]])
    # 4/2 + 2/4 + 8/4 = 4.5 and 4/4 = 1; then only vertex 1.
    assert interpolate(TWO, TRIANGLES, values).tolist() == [[4.5, 1.0], [2.0, 0.0]]
    assert interpolate(TWO, TRIANGLES, values[:, 0]).tolist() == [4.5, 2.0]
    nested = values.reshape(4, 1, 2)
    assert interpolate(TWO, TRIANGLES, nested).tolist() == [[[4.5, 1.0]], [[2.0, 0.0]]]


def test_interpolate_keeps_sparse_values_sparse():
    values = sparse.csr_array(np.array([[0.0, 1.0], [2.0, 0.0], [4.0, 0.0], [8.0, 4.0]]))
    mixed = interpolate(TWO, TRIANGLES, values)
    assert sparse.issparse(mixed)
    assert mixed.toarray().tolist() == [[4.5, 1.0], [2.0, 0.0]]


# A unit square at z = 0, and the same at z = 1 with the opposite winding.
POSITIONS = np.array(
    [[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))], float
)
TWO_SQUARES = np.array([[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]])
DOWN = np.array([0.0, 0.0, -1.0])


def test_nearest_triangle_is_hit_from_either_side():
    hit = first_hit(POSITIONS, TWO_SQUARES, np.array([0.75, 0.25, 3.0]), DOWN)
    assert (hit.triangle, hit.distance) == (2, 2.0)
    again = first_hit(POSITIONS, TWO_SQUARES, np.array([0.25, 0.75, -5.0]), -DOWN)
    assert (again.triangle, again.distance) == (1, 5.0)


def test_point_follows_the_vertices():
    hit = first_hit(POSITIONS, TWO_SQUARES, np.array([0.75, 0.25, 0.5]), DOWN)
    assert hit.triangle == 0
    assert_allclose(hit.barycentric, [0.25, 0.5, 0.25], atol=1e-15)
    moved = POSITIONS * [2.0, 3.0, 1.0] + [0.0, 0.0, 7.0]
    assert_allclose(surface_point(moved, TWO_SQUARES, hit), [1.5, 0.75, 7.0], atol=1e-15)


def test_distance_is_in_units_of_the_direction_vector():
    slanted = np.array([0.2, 0.2, -0.4])
    hit = first_hit(POSITIONS, TWO_SQUARES, np.array([0.1, 0.1, 0.8]), slanted)
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
    assert first_hit(POSITIONS, TWO_SQUARES, np.array(origin), np.array(direction)) is None
    assert first_hit(POSITIONS, TWO_SQUARES[:0], np.array(origin), np.array(direction)) is None


def test_edges_have_no_gap():
    for x in np.linspace(0.01, 0.99, 23):  # the diagonal that both triangles share
        assert first_hit(POSITIONS, TWO_SQUARES[:2], np.array([x, x, 1.0]), DOWN) is not None


def test_many_triangles_are_processed_in_chunks(monkeypatch):
    monkeypatch.setattr("viewer.rigs.geometry.ray_hit._AT_ONCE", 1)
    hit = first_hit(POSITIONS, TWO_SQUARES, np.array([0.25, 0.75, 3.0]), DOWN)
    assert (hit.triangle, hit.distance) == (3, 2.0)


# A cube from 0 to 1; corner (x, y, z) has the index 4 x + 2 y + z.
CORNERS = np.array([[x, y, z] for x in (0.0, 1) for y in (0.0, 1) for z in (0.0, 1)])
SQUARES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
CUBE = np.array([t for a, b, c, d in SQUARES for t in ((a, b, c), (a, c, d))])


def cube(triangles=CUBE, positions=CORNERS) -> Mesh:
    return Mesh(positions, np.tile([0.0, 0.0, 1.0], (len(positions), 1)), triangles)


def fine_cube(n=8) -> Mesh:
    """Return a cube whose sides have n x n cells each, without shared vertices."""
    steps = np.linspace(0.0, 1.0, n + 1)
    u, v = (grid.ravel()[:, None] for grid in np.meshgrid(steps, steps, indexing="ij"))
    points, triangles = [], []
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    for number, (a, b, _, d) in enumerate(SQUARES):
        points.append(CORNERS[a] + u * (CORNERS[b] - CORNERS[a]) + v * (CORNERS[d] - CORNERS[a]))
        first = corner + number * (n + 1) ** 2
        right, up = first + n + 1, first + 1
        triangles += [np.stack([first, right, up], 1), np.stack([right, right + 1, up], 1)]
    return cube(np.concatenate(triangles), np.concatenate(points))


def test_a_cube_is_closed():
    shell = shell_of(cube(), None)
    assert shell is not None
    assert len(shell.borders) == len(shell.copies) == 0


@pytest.mark.parametrize(
    "triangles",
    [
        CUBE[:, ::-1],  # faces inwards
        np.concatenate([CUBE[:1, ::-1], CUBE[1:]]),  # one triangle is reversed
        np.concatenate([CUBE, [[0, 1, 6]]]),  # an edge of three triangles
        CUBE[2:],  # an opening too large to determine the sign of the volume
        CUBE[:0],
    ],
    ids=["inwards", "inconsistent", "three at an edge", "open", "empty"],
)
def test_meshes_with_other_errors_are_not_closed(triangles):
    assert shell_of(cube(triangles), None) is None


def test_mesh_with_an_inward_facing_part_is_not_closed():
    both = np.concatenate([CUBE, CUBE[:, ::-1] + 8])
    assert shell_of(cube(both, np.concatenate([CORNERS, CORNERS + 3.0])), None) is None
    both[12:] = CUBE + 8
    assert shell_of(cube(both, np.concatenate([CORNERS, CORNERS + 3.0])), None) is not None


def test_border_of_a_small_opening_consists_of_its_corners():
    mesh = fine_cube()
    opened = cube(mesh.triangles[1:], mesh.positions)
    shell = shell_of(opened, None)
    assert shell is not None
    missing = {tuple(point) for point in mesh.positions[mesh.triangles[0]].tolist()}
    assert {tuple(point) for point in mesh.positions[shell.borders].tolist()} == missing


def test_seams_are_closed_if_their_vertices_move_together():
    mesh = fine_cube(2)
    # 8 corners with 3 vertices each and 12 midpoints with 2 have 28 copies.
    shell = shell_of(mesh, None)
    assert shell is not None and len(shell.copies) == 28
    assert shell.is_closed(2.0 * mesh.positions)
    moved = mesh.positions.copy()
    moved[shell.copies[0]] += 0.1
    assert not shell.is_closed(moved)


def test_seams_with_different_weights_are_open():
    mesh = fine_cube(2)
    pairs = [[(0, 0.5), (1, 0.5)] for _ in mesh.positions]
    inverse_bind = np.tile(np.eye(4), (2, 1, 1))
    assert shell_of(mesh, skin_from_lists(pairs, inverse_bind)) is not None
    pairs[0] = [(0, 1.0)]
    assert shell_of(mesh, skin_from_lists(pairs, inverse_bind)) is None


def grid(n: int) -> Mesh:
    """Return a flat grid of n x n cells: its border has 4 n vertices and edges."""
    x, y = (part.ravel() for part in np.mgrid[: n + 1, : n + 1])
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    right, up = corner + n + 1, corner + 1
    triangles = [np.stack([corner, right, up], 1), np.stack([right, right + 1, up], 1)]
    return cube(np.concatenate(triangles), np.stack([x, y, 0.0 * x], axis=1))


def test_long_borders_are_found_without_comparing_edges():
    # At most 256 vertices may lie on openings: grids of 64 and 65 cells have 256 and 260.
    assert not _has_long_borders(grid(64).triangles.astype(np.int64), 65**2)
    assert _has_long_borders(grid(65).triangles.astype(np.int64), 66**2)
    closed = fine_cube()
    corners = welded(closed.positions, np.arange(closed.n_vertices))[closed.triangles]
    assert not _has_long_borders(corners, closed.n_vertices)
    assert shell_of(grid(65), None) is None


def walked(count: int, pairs: np.ndarray) -> list[int]:
    """Return the smallest member of each node's component by graph traversal."""
    beside: list[list[int]] = [[] for _ in range(count)]
    for a, b in pairs.tolist():
        beside[a].append(b)
        beside[b].append(a)
    labels = [-1] * count
    for start in range(count):
        stack = [start] if labels[start] < 0 else []
        while stack:
            node = stack.pop()
            if labels[node] < 0:
                labels[node] = start
                stack += beside[node]
    return labels


@pytest.mark.parametrize("seed", range(5))
def test_components_match_a_graph_traversal(seed):
    rng = np.random.default_rng(seed)
    pairs = rng.integers(0, 200, (rng.integers(1, 250), 2))
    assert components(200, pairs).tolist() == walked(200, pairs)


def test_long_chain_is_one_component():
    order = np.random.default_rng(0).permutation(50_000)
    pairs = np.stack([order[:-1], order[1:]], axis=1)
    assert (components(50_000, pairs) == 0).all()


def test_nodes_without_pairs_are_separate_components():
    assert components(3, np.zeros((0, 2), np.int64)).tolist() == [0, 1, 2]


def test_welding_maps_equal_positions_to_the_first_one():
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 0], [1, 0, 1e-12], [1, 0, 0]])
    corners = welded(positions, np.array([[2, 4, 3], [0, 1, 2]], dtype=np.int32))
    assert corners.tolist() == [[0, 1, 3], [0, 1, 0]]


@pytest.mark.parametrize("seed", range(3))
def test_flipped_triangles_of_a_grid_are_found(seed):
    grid = np.arange(20 * 20).reshape(20, 20)
    a, b, c, d = (
        part.ravel() for part in (grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:])
    )
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    flipped = np.random.default_rng(seed).random(len(triangles)) < 0.3
    triangles[flipped] = triangles[flipped][:, ::-1]
    component, found, one_sided = orientations(len(triangles), edges_of(triangles))
    assert (component == 0).all() and not one_sided.any()
    assert np.array_equal(found, flipped)


def test_ties_are_resolved_in_favour_of_the_first_triangle():
    triangles = np.array([[0, 1, 2], [0, 1, 3]])  # both run from 0 to 1
    assert orientations(2, edges_of(triangles))[1].tolist() == [False, True]


def test_triangles_of_each_edge_are_counted():
    two = edges_of(np.array([[0, 1, 2], [1, 0, 3]]))
    assert two.counts.tolist() == [2, 1, 1, 2, 1, 1] and two.pairs.tolist() == [[0, 1]]
    three = edges_of(np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]]))
    assert three.counts.tolist() == [3, 1, 1, 3, 1, 1, 3, 1, 1] and len(three.pairs) == 0
