import numpy as np
import pytest
from scipy import sparse

from viewer.errors import RigError
from viewer.rig.geometry.closest_point import Surface, SurfacePoints, interpolate

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
