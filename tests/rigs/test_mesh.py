import numpy as np
import pytest
from numpy.testing import assert_allclose
from rigs.hand_made import mesh

from viewer.errors import RigError
from viewer.rigs.material import Texture
from viewer.rigs.mesh import (
    Mesh,
    bounding_box,
    box_size,
    split_seams,
    triangle_areas,
    vertex_normals,
    volume,
)
from viewer.rigs.skin import Skin, has_influence, influence_counts, skin_from_lists, weight_sums

SQUARE = [[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]]
UP = np.tile([0.0, 0, 1], (4, 1))


def test_mesh_counts_vertices_and_triangles():
    square = mesh(SQUARE, triangles=[[0, 1, 2], [0, 2, 3]])
    assert (square.n_vertices, square.n_triangles) == (4, 2)


def test_mesh_without_materials_has_no_material_for_every_triangle():
    assert mesh(SQUARE, triangles=[[0, 1, 2], [0, 2, 3]]).material_indices.tolist() == [-1, -1]


def test_mesh_may_be_empty():
    empty = Mesh(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3), np.int32))
    assert (empty.n_vertices, empty.n_triangles) == (0, 0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"normals": UP[:3]}, "normals: expected shape 4 x 3, found 3 x 3"),
        ({"uvs": np.zeros((4, 3))}, "uvs: expected shape 4 x 2, found 4 x 3"),
        ({"triangles": [[0, 1, 4]]}, "triangles: expected vertex indices 0 to 3, found 0 to 4"),
        ({"triangles": [[0, -1, 2]]}, "triangles: expected vertex indices 0 to 3, found -1 to 2"),
        ({"triangles": [[0, 1]]}, "triangles: expected shape any x 3, found 1 x 2"),
        ({"triangle_materials": [0]}, "triangle_materials: expected -1 to -1, found 0 to 0"),
        ({"triangle_materials": [-2]}, "triangle_materials: expected -1 to -1, found -2 to -2"),
        ({"triangle_materials": [0, 0]}, "triangle_materials: expected shape 1, found 2"),
    ],
)
def test_mesh_refuses_inconsistent_parts(changes, message):
    parts = {"positions": SQUARE, "normals": UP, "triangles": [[0, 1, 2]], **changes}
    with pytest.raises(RigError) as caught:
        Mesh(**parts)
    assert str(caught.value) == message


def test_material_texture_requires_four_channels():
    with pytest.raises(RigError) as caught:
        Texture("a.png", np.zeros((2, 2, 3), np.uint8))
    assert str(caught.value) == "image: expected shape any x any x 4, found 2 x 2 x 3"


def test_bounding_box_of_no_points_has_no_size():
    assert bounding_box(np.zeros((0, 3))).tolist() == [[0, 0, 0], [0, 0, 0]]


def test_bounding_box_spans_the_points():
    box = bounding_box(np.array([[1.0, -2, 3], [0, 5, -1]]))
    assert box.tolist() == [[0, -2, -1], [1, 5, 3]]
    assert box_size(box) == np.sqrt(1 + 49 + 16)


def test_triangle_areas_are_half_base_times_height():
    positions = np.array([[0.0, 0, 0], [4, 0, 0], [1, 3, 0], [9, 9, 9]])
    areas = triangle_areas(positions, np.array([[0, 1, 2], [2, 1, 0], [3, 3, 0]]))
    assert areas.tolist() == [6, 6, 0]


def test_vertex_normals_are_weighted_by_area():
    # One vertex is shared by a triangle of area 2 facing +z and one of area 1/2 facing +x.
    positions = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0], [0, 1, 0], [0, 0, 1]])
    normals = vertex_normals(positions, np.array([[0, 1, 2], [0, 3, 4]]))
    assert_allclose(normals[0], np.array([0.5, 0, 2]) / np.hypot(0.5, 2), atol=1e-15)
    assert normals[1].tolist() == [0, 0, 1]
    assert normals[4].tolist() == [1, 0, 0]


def test_vertex_normals_of_zero_area_point_up():
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [7, 7, 7]])
    normals = vertex_normals(positions, np.array([[0, 1, 2]]))
    assert normals.tolist() == [[0, 1, 0]] * 4


def test_vertex_normals_without_triangles_point_up():
    assert vertex_normals(np.zeros((2, 3)), np.zeros((0, 3), np.int32)).tolist() == [[0, 1, 0]] * 2


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


def cube_mesh(positions=CORNERS, triangles=CUBE, **changes) -> Mesh:
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
    cube = cube_mesh(uvs=uvs, uv_triangles=corners)
    sources, _, _ = split_seams(cube)
    assert np.bincount(sources).tolist() == [3] * 8
    check_split(cube)


def test_coordinates_that_follow_the_vertices_split_no_vertex():
    cube = cube_mesh(uvs=np.zeros((8, 2)), uv_triangles=CUBE)
    assert len(split_seams(cube)[0]) == 8
    check_split(cube)


def test_mesh_with_one_coordinate_per_vertex_is_unchanged():
    for cube in (cube_mesh(uvs=np.zeros((8, 2))), cube_mesh()):
        sources, uv_indices, triangles = split_seams(cube)
        assert sources.tolist() == uv_indices.tolist() == list(range(8))
        assert triangles is cube.triangles


def test_vertices_without_triangles_are_kept():
    positions = np.vstack([[[9.0, 9, 9]], CORNERS, [[8.0, 8, 8]]])
    uvs, corners = atlas()
    cube = cube_mesh(positions, CUBE + 1, uvs=uvs, uv_triangles=corners)
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
        cube_mesh(**changes)
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
def test_split_vertices_are_the_distinct_pairs_in_ascending_order(seed):
    rng = np.random.default_rng(seed)
    n_vertices, n_uvs, n_triangles = rng.integers(3, 20, 3)
    triangles = rng.integers(0, n_vertices, (n_triangles, 3))
    uv_triangles = rng.integers(0, n_uvs, (n_triangles, 3))
    positions, uvs = rng.normal(size=(n_vertices, 3)), rng.random((n_uvs, 2))
    mesh = cube_mesh(positions, triangles, uvs=uvs, uv_triangles=uv_triangles)
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


TWO = np.tile(np.eye(4), (2, 1, 1))
MIXED = skin_from_lists([[(0, 0.5), (1, 0.25)], [], [(1, 0.0)], [(1, 1.0), (1, -1.0)]], TWO)


def build_skin(starts=(0, 1), joints=(0,), weights=(1.0,), inverse_bind=TWO) -> Skin:
    return Skin(np.array(starts), np.array(joints), np.array(weights), inverse_bind)


def test_skin_from_lists_keeps_order_and_counts():
    assert MIXED.starts.tolist() == [0, 2, 2, 3, 5]
    assert MIXED.joints.tolist() == [0, 1, 1, 1, 1]
    assert MIXED.weights.tolist() == [0.5, 0.25, 0.0, 1.0, -1.0]
    assert (MIXED.n_vertices, MIXED.n_joints) == (4, 2)


def test_influence_counts_include_zero_weights():
    assert influence_counts(MIXED).tolist() == [2, 0, 1, 2]


def test_weight_sums_are_as_stored():
    assert weight_sums(MIXED).tolist() == [0.75, 0.0, 0.0, 0.0]


def test_has_influence_needs_a_nonzero_weight():
    assert has_influence(MIXED).tolist() == [True, False, False, True]


def test_skin_of_no_vertices_is_empty():
    empty = skin_from_lists([], TWO)
    assert empty.n_vertices == 0
    assert weight_sums(empty).tolist() == []
    assert has_influence(empty).tolist() == []


def test_skin_of_vertices_without_influence_may_have_no_joints():
    assert skin_from_lists([[], []], np.zeros((0, 4, 4))).n_joints == 0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"weights": [1.0, 2.0]}, "weights: expected shape 1, found 2"),
        ({"weights": [np.nan]}, "weights: expected finite numbers, found nan at index 0"),
        ({"inverse_bind": np.eye(4)}, "inverse_bind: expected shape any x 4 x 4, found 4 x 4"),
        ({"starts": []}, "starts: expected indices that begin at 0 and never decrease"),
        ({"starts": [1, 1]}, "starts: expected indices that begin at 0 and never decrease"),
        ({"starts": [0, 1, 0]}, "starts: expected indices that begin at 0 and never decrease"),
        ({"starts": [0, 2]}, "starts: expected to end at 1, found 2"),
        ({"joints": [2]}, "joints: expected indices 0 to 1, found 2 to 2"),
        ({"joints": [-1]}, "joints: expected indices 0 to 1, found -1 to -1"),
    ],
)
def test_skin_refuses_inconsistent_parts(changes, message):
    with pytest.raises(RigError) as caught:
        build_skin(**changes)
    assert str(caught.value) == message


def test_skin_arrays_cannot_be_changed():
    for name in ("starts", "joints", "weights", "inverse_bind"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(MIXED, name)[0] = 0
