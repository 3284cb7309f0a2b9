"""Binary ``.ply`` files, of which a separate parser reads the header and every byte after it."""

from dataclasses import replace

import faults
import numpy as np
import pytest
from exporters.plain_readers import columns, read_ply
from numpy.testing import assert_allclose, assert_array_equal
from seamed import (
    NORMALS,
    PICTURE,
    POSITIONS,
    TRIANGLES,
    UV_TRIANGLES,
    UVS,
    seamed_actor,
    seamed_mesh,
)

import viewer
from viewer.errors import RigError
from viewer.exporters import export
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import Mesh
from viewer.rigs.scene import Actor
from viewer.rigs.skeleton import ball_skeleton
from viewer.rigs.skinning import Skinning

FLOAT32 = 2.0**-24  # half a unit in the last place, relative


def write(tmp_path, actor):
    notes = faults.lines(export(actor, tmp_path / "out.ply"))
    return read_ply(tmp_path / "out.ply"), notes


def test_header_follows_the_format(tmp_path):
    write(tmp_path, seamed_actor(up="z"))
    head = (tmp_path / "out.ply").read_bytes().partition(b"end_header\n")[0]
    assert head.decode("ascii").split("\n") == [
        "ply",
        "format binary_little_endian 1.0",
        "comment roof, z up",
        "element vertex 5",
        *[f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")],
        "element face 3",
        "property list uchar int vertex_indices",
        "property list uchar float texcoord",
        "",
    ]


def test_mesh_round_trips(tmp_path):
    ply, notes = write(tmp_path, seamed_actor())
    vertices, faces = ply.elements["vertex"], ply.elements["face"]
    assert_array_equal(columns(vertices, "x", "y", "z"), POSITIONS)
    normals = [[0, 0, 1], [0, 0.6, 0.8], [1, 0, 0], [0, 0, -1], [0, 1, 0]]
    assert_allclose(columns(vertices, "nx", "ny", "nz"), normals, rtol=0, atol=FLOAT32)
    assert_array_equal([face["vertex_indices"] for face in faces], TRIANGLES)
    assert notes == [
        f"{tmp_path / 'out.ply'}: 5 vertices, 3 triangles",
        "not stored in .ply: the skeleton, the skin",
    ]


def test_corners_have_texture_coordinates_also_along_seams(tmp_path):
    ply, _ = write(tmp_path, seamed_actor())
    found = np.array([face["texcoord"] for face in ply.elements["face"]])
    assert found.shape == (3, 6)
    assert_array_equal(found.reshape(3, 3, 2), UVS[UV_TRIANGLES])  # exact in float32


def test_per_vertex_coordinates_are_written_per_corner(tmp_path):
    mesh = Mesh(POSITIONS, NORMALS, TRIANGLES, UVS[:5])
    ply, _ = write(tmp_path, seamed_actor(mesh=mesh))
    found = np.array([face["texcoord"] for face in ply.elements["face"]])
    assert_array_equal(found.reshape(3, 3, 2), UVS[TRIANGLES])


def test_mesh_without_coordinates_has_no_texcoord_property(tmp_path):
    ply, _ = write(tmp_path, seamed_actor(mesh=seamed_mesh(uvs=False)))
    assert [list(face) for face in ply.elements["face"]] == [["vertex_indices"]] * 3
    assert_array_equal([face["vertex_indices"] for face in ply.elements["face"]], TRIANGLES)
    assert b"texcoord" not in (tmp_path / "out.ply").read_bytes()


def test_posed_vertices_are_written(tmp_path):
    actor = seamed_actor()
    actor.pose.dofs[2] = np.pi / 2  # root about z: (x, y) becomes (-y, x)
    actor.pose.figure_translation[:] = 0, 0, 8
    ply, _ = write(tmp_path, actor)
    x, y, z = POSITIONS.T
    expected = np.stack([-y, x, z + 8], axis=1)
    assert_allclose(columns(ply.elements["vertex"], "x", "y", "z"), expected, rtol=0, atol=1e-6)


def test_textures_are_left_out(tmp_path):
    mesh = seamed_mesh(pictures=(PICTURE,), of_triangle=np.zeros(3, np.int32))
    notes = export(seamed_actor(mesh=mesh), tmp_path / "out.ply")
    assert [path.name for path in tmp_path.iterdir()] == ["out.ply"]
    values = {"format": ".ply", "parts": ["the skeleton", "the skin", "materials and textures"]}
    assert [(note.key, note.values) for note in notes[1:]] == [("X003.parts", values)]


def test_colours_of_vertices_are_written_as_srgb(tmp_path):
    """0.214 and 0.5 in linear light are sRGB 127.5 and 187.5; opacity is linear."""
    colors = np.zeros((5, 4))
    colors[:2] = [[1.0, 0.21404, 0.5, 1.0], [0.0, 2.0, 0.0031308, 0.2]]
    notes = export(seamed_actor(mesh=replace(seamed_mesh(), colors=colors)), tmp_path / "out.ply")
    vertices = read_ply(tmp_path / "out.ply").elements["vertex"]
    found = columns(vertices, "red", "green", "blue", "alpha")
    assert_allclose(found[:2], [[255, 127.5, 187.5, 255], [0, 255, 10.3, 51]], atol=0.6)
    assert faults.lines(notes[1:]) == ["not stored in .ply: the skeleton, the skin"]


@pytest.mark.parametrize("name", ["two\nlines", "end_header\n", "é\udcff 文", "", "x" * 5000, "\r"])
def test_names_with_line_breaks_do_not_break_the_header(tmp_path, name):
    ply, _ = write(tmp_path, seamed_actor(name))
    assert len(ply.elements["vertex"]) == 5 and len(ply.comments) == 1


def test_points_without_triangles_are_written(tmp_path):
    mesh = Mesh(POSITIONS, NORMALS, np.zeros((0, 3), np.int32))
    ply, _ = write(tmp_path, Actor(Figure("points", mesh)))
    assert_array_equal(columns(ply.elements["vertex"], "x", "y", "z"), POSITIONS)
    assert ply.elements["face"] == []


def test_figure_without_mesh_is_refused(tmp_path):
    joints = ball_skeleton(("root",), np.array([-1]), np.zeros((1, 3)))
    with pytest.raises(RigError, match=r"^figure bones has no mesh to write as \.ply$"):
        write(tmp_path, Actor(Figure("bones", skeleton=joints)))
    assert list(tmp_path.iterdir()) == []


def test_hidden_parts_are_written_and_reported(tmp_path):
    actor = seamed_actor()
    mesh = actor.figure.mesh
    parts = np.arange(mesh.n_triangles) % 2
    mesh = replace(mesh, parts=("even", "odd"), triangle_parts=parts)
    actor.figure = replace(actor.figure, mesh=mesh)
    actor.hidden_parts = frozenset({1})
    notes = export(actor, tmp_path / "parts.ply")
    assert [note.values for note in notes if note.key == "X005.hidden-parts"] == [{"n": 1}]
    assert len(read_ply(tmp_path / "parts.ply").elements["face"]) == mesh.n_triangles


def test_meshes_far_from_the_origin_are_written_in_double_precision(tmp_path):
    """Single precision keeps multiples of 64 at 1e9: all corners of the roof would be one point."""
    far = replace(seamed_mesh(), positions=POSITIONS + np.array([1e9, 0, 0]))
    ply, notes = write(tmp_path, Actor(Figure("roof", far, up="z", unit="cm")))
    assert_array_equal(columns(ply.elements["vertex"], "x", "y", "z"), far.positions)
    assert notes[1].endswith(
        "positions are written in double precision: single precision would move vertices by more "
        "than a millionth of the size"
    )
    assert len(notes) == 2
    again = viewer.load(tmp_path / "out.ply").actors[0].figure
    assert (again.up, again.unit) == ("z", "cm")


def test_reduced_weights_are_reported(tmp_path):
    """The tip turns vertex 3 from (1, 2, 1) to (1, -2, 1): all influences put it at (1, 1, 1)."""
    actor = seamed_actor(weights=((1, 0), (0, 1), (1, 0), (0.75, 0.25), (1, 0)), unit="m")
    actor.pose.dofs[5] = np.pi
    notes = faults.lines(export(actor, tmp_path / "out.ply", Skinning(max_influences=1)))
    assert notes[1] == (
        f"{tmp_path}/out.ply: vertices differ from the pose by up to 1 m (vertex 3): only the "
        "strongest influence of each vertex is written, as requested"
    )
