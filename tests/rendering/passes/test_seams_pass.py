"""Seams on the GPU, with a row for every split vertex and identically posed copies."""

import numpy as np
import pytest
from builders import family_figure
from rendering.drawn_figures import random_pose, skeleton

import viewer
from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.posed_mesh import PosedMesh
from viewer.rendering.gpu.program import Programs
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.mesh import Mesh
from viewer.rigs.skin import skin_from_lists
from viewer.rigs.skinning import Skinning


@pytest.fixture
def posed(ctx):
    owned = []

    def make(figure) -> PosedMesh:
        owned.append(PosedMesh(ctx, Programs(ctx), MeshBuffers(ctx, figure, [])))
        return owned[-1]

    yield make
    for mesh in owned:
        mesh.release()
        mesh.mesh.release()
        mesh.programs.release()


def ribbon() -> Figure:
    """Return two squares that share an edge but not their texture area, and a lone vertex. Vertices
    1 and 2 are on the seam and count twice: 4 + 4 split vertices and the lone vertex.
    """
    points = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0], [5, 5, 5]]
    triangles = [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]]
    uv_triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]
    uvs = np.arange(16).reshape(8, 2) / 16
    mesh = Mesh(points, np.tile([0, 0, 1.0], (7, 1)), triangles, uvs, uv_triangles=uv_triangles)
    bones = skeleton([-1, 0], [[0, 0, 0], [1, 0, 0]])
    bind = np.tile(np.eye(4), (2, 1, 1))
    bind[1, 0, 3] = -1.0
    ties = [[(0, 1.0)], [(0, 0.5), (1, 0.5)], [(0, 0.5), (1, 0.5)], [(0, 1.0)]]
    return Figure("ribbon", mesh, bones, skin_from_lists([*ties, *[[(1, 1.0)]] * 3], bind))


def rows_of(buffer, columns):
    return np.frombuffer(buffer.read(), dtype="f4").reshape(-1, columns)


def test_every_split_vertex_has_a_row_with_its_texture_coordinate(posed):
    figure = ribbon()
    mesh = posed(figure)
    assert mesh.mesh.n_vertices == 9
    assert mesh.posed.size == 24 * 9
    assert rows_of(mesh.mesh.uvs, 2).shape == (9, 2)
    listed = mesh.mesh.index_set(False, (), as_listed=True)
    indices = np.frombuffer(listed.indices.read(), dtype="u4")
    corners = figure.mesh.uv_triangles.ravel()
    assert np.array_equal(rows_of(mesh.mesh.uvs, 2)[indices], figure.mesh.uvs[corners])
    assert np.array_equal(mesh.mesh.sources[indices], figure.mesh.triangles.ravel())


@pytest.mark.parametrize("method", ["lbs", "dqs"])
def test_read_maps_split_vertices_back(posed, method):
    figure = ribbon()
    mesh = posed(figure)
    pose = random_pose(figure.skeleton, np.random.default_rng(0))
    mesh.update(pose, method)
    positions, normals = mesh.read()
    assert positions.shape == normals.shape == (7, 3)
    wanted = viewer.deform(figure, pose, method)
    np.testing.assert_allclose(positions, wanted[0], rtol=0, atol=5e-6)
    np.testing.assert_allclose(normals, wanted[1], rtol=0, atol=1e-5)


def test_copies_of_one_vertex_are_posed_identically(posed, tmp_path):
    figure = family_figure("smplx", tmp_path)
    mesh = posed(figure)
    pose = random_pose(figure.skeleton, np.random.default_rng(1), 1.0)
    pose.shape_weights = np.random.default_rng(2).normal(size=figure.n_shapes)
    for how in (Skinning(), Skinning("dqs"), Skinning("mix", max_influences=2)):
        mesh.update(pose, how)
        rows = rows_of(mesh.posed, 6)
        assert len(rows) == mesh.mesh.n_vertices > figure.mesh.n_vertices
        # The values are bit-identical, so that no crack opens along a seam.
        assert np.array_equal(rows, rows[mesh.mesh.copies][mesh.mesh.sources])


def test_figures_without_seams_keep_their_numbering(posed, tmp_path):
    figure = family_figure("smpl", tmp_path)
    buffers = posed(figure).mesh
    assert buffers.sources.tolist() == buffers.copies.tolist() == list(range(96))
    assert buffers.uvs is None


def test_mesh_without_triangles_and_texture_coordinates_is_posed(posed):
    none = np.zeros((0, 3), dtype=np.int32)
    figure = ribbon()
    parts = (figure.mesh.positions, figure.mesh.normals, none, np.zeros((0, 2)))
    bare = Mesh(*parts, uv_triangles=none)
    bare = Figure("points", bare, figure.skeleton, figure.skin)
    mesh = posed(bare)
    mesh.update(figure_pose(bare))
    np.testing.assert_allclose(mesh.read()[0], figure.mesh.positions, rtol=0, atol=1e-6)
