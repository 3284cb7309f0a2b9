"""Parts with inverted winding: closed parts and most of a mesh are flipped, linings are not."""

from dataclasses import replace

import numpy as np
import pytest
from autorig.rigged_shapes import mesh_of, tube

from viewer.autorig.correspondence import with_reversed_winding, wound_backwards
from viewer.autorig.surface.welding import weld
from viewer.rig.mesh import volume

CUBE = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
OUTWARD = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
     [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)  # fmt: skip


def two(first, second):
    """Return two unit cubes side by side with the given triangles of each."""
    positions = np.concatenate([CUBE, CUBE + np.array([3.0, 0.0, 0.0])])
    return positions, np.concatenate([first, np.asarray(second) + 8]).astype(np.int32)


def found(positions, triangles, islands):
    return wound_backwards(weld(positions, triangles), np.array(islands)).tolist()


def test_cube_of_the_tests_is_wound_outward():
    assert volume(CUBE, OUTWARD) == pytest.approx(1.0)


def test_closed_inside_out_part_is_detected():
    positions, triangles = two(OUTWARD, OUTWARD[:, ::-1])
    assert found(positions, triangles, [1]) == [False] * 8 + [True] * 8


def test_correctly_wound_part_facing_away_is_kept():
    positions, triangles = two(OUTWARD, OUTWARD)
    assert not any(found(positions, triangles, [0, 1]))


def test_unrequested_part_is_kept():
    positions, triangles = two(OUTWARD, OUTWARD[:, ::-1])
    assert not any(found(positions, triangles, []))


def test_open_lining_is_kept_and_open_mesh_is_flipped():
    inner = OUTWARD[2:, ::-1]  # a face of two triangles is missing
    lining = two(OUTWARD, inner)
    assert not any(found(*lining, [1]))
    assert all(found(CUBE, inner.astype(np.int32), [0]))


def test_vertices_without_triangles_belong_to_no_part():
    positions = np.concatenate([CUBE, [[9.0, 9.0, 9.0]]])
    assert found(positions, OUTWARD[:, ::-1].astype(np.int32), [0, 1]) == [True] * 8 + [False]


def test_flipping_keeps_materials_and_texture_at_their_corners():
    positions, triangles = tube()
    mesh = mesh_of(positions, triangles[:, ::-1])
    again = with_reversed_winding(mesh, np.ones(len(positions), dtype=bool))
    assert (again.triangles == triangles).all()
    assert np.allclose(again.normals, mesh_of(positions, triangles).normals)
    assert with_reversed_winding(mesh, np.zeros(len(positions), dtype=bool)) is mesh


def test_texture_corners_flip_with_the_triangles():
    corners = np.arange(36, dtype=np.int32).reshape(-1, 3)
    mesh = replace(mesh_of(CUBE, OUTWARD), uvs=np.zeros((36, 2)), uv_triangles=corners)
    again = with_reversed_winding(mesh, np.ones(8, dtype=bool))
    assert (again.uv_triangles == corners[:, ::-1]).all()
