import numpy as np
import pytest
from numpy.testing import assert_allclose
from rig.hand_made import mesh

from viewer.errors import RigError
from viewer.rig.material import Texture
from viewer.rig.mesh import (
    Mesh,
    bounding_box,
    box_size,
    triangle_areas,
    vertex_normals,
)

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
