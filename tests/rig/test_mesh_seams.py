"""Seams, at which a vertex has several texture coordinates, and the volume enclosed by a mesh."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.errors import RigError
from viewer.rig.mesh import Mesh, split_seams, volume

CORNERS = np.array([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)], dtype=float)
# The six sides counter-clockwise from outside; corner i has bits x y z.
SIDES = [[0, 2, 6, 4], [1, 5, 7, 3], [0, 4, 5, 1], [2, 3, 7, 6], [0, 1, 3, 2], [4, 6, 7, 5]]
CUBE = np.array([[a, b, c] for s in SIDES for a, b, c in ((s[0], s[1], s[2]), (s[0], s[2], s[3]))])


def atlas():
    """Return a cube with a separate area of the texture for each side."""
    uvs, corners = [], []
    for side in range(6):
        uvs += [[side, 0], [side + 1, 0], [side + 1, 1], [side, 1]]
        first = 4 * side
        corners += [[first, first + 1, first + 2], [first, first + 2, first + 3]]
    return np.array(uvs, dtype=float) / 6, np.array(corners)


def build(positions=CORNERS, triangles=CUBE, **changes) -> Mesh:
    return Mesh(positions, np.ones_like(positions), triangles, **changes)


def check_split(mesh: Mesh) -> None:
    """Check that a split preserves the corners and their texture coordinates."""
    sources, uv_indices, triangles = split_seams(mesh)
    assert np.array_equal(sources[triangles], mesh.triangles)
    corners = mesh.triangles if mesh.uv_triangles is None else mesh.uv_triangles
    assert np.array_equal(uv_indices[triangles], corners)
    assert sorted(set(sources.tolist())) == list(range(mesh.n_vertices))
    assert len(set(zip(sources.tolist(), uv_indices.tolist(), strict=True))) == len(sources)


def test_cube_is_split_once_per_face_corner():
    uvs, corners = atlas()
    cube = build(uvs=uvs, uv_triangles=corners)
    sources, _, _ = split_seams(cube)
    assert np.bincount(sources).tolist() == [3] * 8
    check_split(cube)


def test_coordinates_that_follow_the_vertices_split_no_vertex():
    cube = build(uvs=np.zeros((8, 2)), uv_triangles=CUBE)
    assert len(split_seams(cube)[0]) == 8
    check_split(cube)


def test_mesh_with_one_coordinate_per_vertex_is_unchanged():
    for cube in (build(uvs=np.zeros((8, 2))), build()):
        sources, uv_indices, triangles = split_seams(cube)
        assert sources.tolist() == uv_indices.tolist() == list(range(8))
        assert triangles is cube.triangles


def test_vertices_without_triangles_are_kept():
    positions = np.vstack([[[9.0, 9, 9]], CORNERS, [[8.0, 8, 8]]])
    uvs, corners = atlas()
    cube = build(positions, CUBE + 1, uvs=uvs, uv_triangles=corners)
    sources, uv_indices, _ = split_seams(cube)
    assert len(sources) == 26
    assert set(sources[-2:].tolist()) == {0, 9}
    assert uv_indices.max() < len(uvs)
    check_split(cube)


def test_one_seam_doubles_the_vertices_along_it():
    # A strip of two squares is bent into a ring; vertices 0 and 1 are at both ends of the texture.
    ring = np.array([[0, 2, 1], [1, 2, 3], [2, 4, 3], [3, 4, 5], [4, 0, 5], [5, 0, 1]])
    in_picture = np.array([[0, 2, 1], [1, 2, 3], [2, 4, 3], [3, 4, 5], [4, 6, 5], [5, 6, 7]])
    mesh = Mesh(
        CORNERS[:6],
        np.ones((6, 3)),
        ring,
        uvs=np.random.default_rng(0).random((8, 2)),
        uv_triangles=in_picture,
    )
    assert np.bincount(split_seams(mesh)[0]).tolist() == [2, 2, 1, 1, 1, 1]
    check_split(mesh)


@pytest.mark.parametrize("seed", range(5))
def test_random_seams_keep_every_corner(seed):
    rng = np.random.default_rng(seed)
    mesh = Mesh(
        rng.normal(size=(30, 3)),
        np.ones((30, 3)),
        rng.integers(0, 30, (50, 3)),
        uvs=rng.random((40, 2)),
        uv_triangles=rng.integers(0, 40, (50, 3)),
    )
    sources, uv_indices, triangles = split_seams(mesh)
    assert np.array_equal(sources[triangles], mesh.triangles)
    assert np.array_equal(uv_indices[triangles], mesh.uv_triangles)


def test_mesh_without_triangles_is_not_split():
    none = np.zeros((0, 3), np.int32)
    mesh = Mesh(CORNERS, CORNERS, none, uvs=np.zeros((2, 2)), uv_triangles=none)
    sources, uv_indices, triangles = split_seams(mesh)
    assert sources.tolist() == list(range(8))
    assert uv_indices.tolist() == [0] * 8
    assert triangles.shape == (0, 3)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"uv_triangles": CUBE}, "uv_triangles: expected vertex indices 0 to -1, found 0 to 7"),
        (
            {"uvs": np.zeros((7, 2)), "uv_triangles": CUBE},
            "uv_triangles: expected vertex indices 0 to 6, found 0 to 7",
        ),
        (
            {"uvs": np.zeros((8, 2)), "uv_triangles": CUBE[1:]},
            "uv_triangles: expected shape 12 x 3, found 11 x 3",
        ),
        ({"uvs": np.zeros((9, 2))}, "uvs: expected shape 8 x 2, found 9 x 2"),
    ],
)
def test_mesh_refuses_inconsistent_texture_coordinates(changes, message):
    with pytest.raises(RigError) as caught:
        build(**changes)
    assert str(caught.value) == message


def test_volume_of_a_box_is_the_product_of_its_sides():
    assert volume(CORNERS, CUBE) == pytest.approx(1.0, abs=1e-15)
    assert volume(CORNERS * [2.0, 3.0, 0.5] + 7.0, CUBE) == pytest.approx(3.0, abs=1e-14)


def test_volume_of_clockwise_triangles_is_negative():
    assert volume(CORNERS, CUBE[:, ::-1]) == pytest.approx(-1.0, abs=1e-15)


def test_volume_far_from_the_origin_is_accurate():
    box = CORNERS * [2.0, 3.0, 0.7] + [1e6 / 3, -3e6 / 7, 1e6]
    # Positions 1e6 away are rounded to 1e-10; without a shift, their cubes would be rounded to 100.
    assert volume(box, CUBE) == pytest.approx(4.2, abs=1e-8)


@pytest.mark.parametrize("seed", range(20))
def test_split_vertices_are_the_distinct_pairs_in_ascending_order(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n_vertices, n_uvs, n_triangles = rng.integers(3, 20, 3)
    triangles = rng.integers(0, n_vertices, (n_triangles, 3))
    uv_triangles = rng.integers(0, n_uvs, (n_triangles, 3))
    positions, uvs = rng.normal(size=(n_vertices, 3)), rng.random((n_uvs, 2))
    mesh = build(positions, triangles, uvs=uvs, uv_triangles=uv_triangles)
    check_split(mesh)
    sources, uv_indices, _ = split_seams(mesh)
    pairs = sorted({*zip(triangles.ravel().tolist(), uv_triangles.ravel().tolist(), strict=True)})
    unused = sorted({*range(n_vertices)} - {*triangles.ravel().tolist()})
    assert sources.tolist() == [vertex for vertex, _ in pairs] + unused
    assert uv_indices.tolist()[: len(pairs)] == [uv for _, uv in pairs]


def test_hole_far_from_the_origin_adds_no_volume():
    # Without the top, a sixth of the cube is missing: the pyramid from its middle.
    open_cube = np.array([t for t in CUBE.tolist() if not set(t) <= {1, 5, 7, 3}])
    for shift in (0.0, 1e4):
        found = volume(CORNERS + shift, open_cube)
        assert found == pytest.approx(5 / 6, abs=1e-9)


def test_volume_of_a_tetrahedron_is_a_sixth_of_its_determinant():
    corners = np.random.default_rng(1).normal(size=(4, 3))
    sides = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    expected = np.linalg.det(corners[1:] - corners[0]) / 6.0
    assert_allclose(volume(corners, sides), expected, atol=1e-15)
