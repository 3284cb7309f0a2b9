"""Wavefront ``.obj`` files, read back by a separate parser."""

from dataclasses import replace

import faults
import numpy as np
import pytest
from exporters.plain_readers import read_mtl, read_obj
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image
from seamed import (
    NORMALS,
    OTHER_PICTURE,
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
from viewer.rigs.material import Material
from viewer.rigs.mesh import Mesh
from viewer.rigs.scene import Actor
from viewer.rigs.skeleton import ball_skeleton
from viewer.rigs.skinning import Skinning


def write(tmp_path, actor, name="out.obj", **skinning):
    notes = faults.lines(export(actor, tmp_path / name, Skinning(**skinning)))
    return read_obj(tmp_path / name), notes


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def corners(obj):
    """Return the faces as three arrays of indices counted from 0."""
    table = np.array([face for _, face in obj.faces], dtype=float)  # None is stored as nan
    return table[..., 0] - 1, table[..., 1] - 1, table[..., 2] - 1


def test_mesh_at_rest_round_trips(tmp_path):
    obj, notes = write(tmp_path, seamed_actor())
    assert_array_equal(obj.v, POSITIONS)
    assert_array_equal(obj.vt, UVS)
    assert_array_equal(corners(obj), [TRIANGLES, UV_TRIANGLES, TRIANGLES])
    assert notes == [
        f"{tmp_path / 'out.obj'}: 5 vertices, 3 triangles",
        "not stored in .obj and .mtl: the skeleton, the skin",
    ]
    assert names(tmp_path) == ["out.obj"]


def test_colours_follow_positions_in_srgb(tmp_path):
    """0.21404 in linear light is sRGB 0.5; opacity is written if present."""
    colors = np.tile([1.0, 0.21404, 0.0, 1.0], (5, 1))
    for opacity in ((), (0.25,)):
        colors[0, 3:] = opacity or 1.0
        actor = seamed_actor(mesh=replace(seamed_mesh(), colors=colors))
        export(actor, tmp_path / f"{len(opacity)}.obj")
        lines = (tmp_path / f"{len(opacity)}.obj").read_text().splitlines()
        found = np.array([line.split()[1:] for line in lines if line.startswith("v ")], float)
        assert_array_equal(found[:, :3], POSITIONS)
        assert_allclose(found[0, 3:], [1.0, 0.5, 0.0, *opacity], atol=1e-5)


def test_indices_are_counted_from_1(tmp_path):
    write(tmp_path, seamed_actor())
    lines = (tmp_path / "out.obj").read_text().splitlines()
    # Vertex 0 has coordinate 0; vertex 1 has 1 in the first and 3 in the second triangle.
    assert lines[-3:] == ["f 1/1/1 2/2/2 3/3/3", "f 2/4/2 4/5/4 3/6/3", "f 1/1/1 4/5/4 2/4/2"]


def test_vertex_on_a_seam_has_several_texture_coordinates(tmp_path):
    obj, _ = write(tmp_path, seamed_actor())
    vertices, coordinates, _ = corners(obj)
    assert sorted(set(coordinates[vertices == 1])) == [1, 3]
    assert sorted(set(coordinates[vertices == 2])) == [2, 5]
    assert len(obj.v) == 5  # no vertex is duplicated


def test_mesh_with_one_coordinate_per_vertex_repeats_its_index(tmp_path):
    mesh = Mesh(POSITIONS, NORMALS, TRIANGLES, UVS[:5])
    obj, _ = write(tmp_path, seamed_actor(mesh=mesh))
    assert_array_equal(corners(obj), [TRIANGLES] * 3)
    assert_array_equal(obj.vt, UVS[:5])


def test_mesh_without_coordinates_has_vertex_normal_faces(tmp_path):
    obj, _ = write(tmp_path, seamed_actor(mesh=seamed_mesh(uvs=False)))
    assert len(obj.vt) == 0
    lines = (tmp_path / "out.obj").read_text().splitlines()
    assert next(line for line in lines if line[0] == "f") == "f 1//1 2//2 3//3"
    assert_array_equal(corners(obj)[0], TRIANGLES)


def test_normals_have_length_1_for_any_stored_length(tmp_path):
    obj, _ = write(tmp_path, seamed_actor())
    expected = [[0, 0, 1], [0, 0.6, 0.8], [1, 0, 0], [0, 0, -1], [0, 1, 0]]
    assert_allclose(obj.vn, expected, rtol=0, atol=1e-9)  # nine digits are written


def test_posed_vertices_and_normals_are_written(tmp_path):
    actor = seamed_actor()
    actor.pose.dofs[5] = np.pi / 2  # tip about z, the sixth DOF
    obj, _ = write(tmp_path, actor)
    # Vertex 3 follows the root, at (1, 2, 1), and the tip with equal weights; relative to the tip,
    # (0, 2) rotates to (-2, 0).
    expected = POSITIONS.copy()
    expected[3] = [(1 + 1 - 2) / 2, (2 + 0) / 2, (1 + 1) / 2]
    assert_allclose(obj.v, expected, rtol=0, atol=1e-9)
    assert_allclose(obj.vn[1], [-0.6, 0, 0.8], rtol=0, atol=1e-9)  # the tip has the whole weight


def test_placed_figure_is_scaled_then_moved(tmp_path):
    actor = seamed_actor()
    actor.pose.figure_scale, actor.pose.figure_translation[:] = 2.0, [10, 0, -1]
    actor.placement = np.diag([7.0, 7, 7, 1])  # the placement in the scene is not exported
    obj, _ = write(tmp_path, actor)
    assert_allclose(obj.v, 2 * POSITIONS + [10, 0, -1], rtol=0, atol=1e-9)


def test_numbers_have_nine_digits(tmp_path):
    values = np.array([1 / 3, -2e6 / 7, 1.23456789012e-5, 123456789.123, -0.0, 1e-300])
    positions = np.concatenate([POSITIONS[:3], values.reshape(2, 3)])
    mesh = Mesh(positions, np.tile([0.0, 0, 1], (5, 1)), TRIANGLES)
    figure = Figure("numbers", mesh)
    obj, _ = write(tmp_path, Actor(figure))
    assert_allclose(obj.v[3:].ravel(), values, rtol=5e-9, atol=0)
    text = (tmp_path / "out.obj").read_text()
    assert "v 0.333333333 -285714.286 0.0000123456789\n" in text
    assert "v 123456789 0 1e-300\n" in text  # no -0


def test_object_name_describes_the_figure(tmp_path):
    obj, _ = write(tmp_path, seamed_actor("a fat\tcat\n", up="z", unit="m"))
    assert len(obj.objects) == 1 and " " not in obj.objects[0]
    assert obj.comments == [f"{obj.objects[0]}: z up, metres"]
    obj, _ = write(tmp_path, seamed_actor("roof"), "other.obj")
    assert (obj.objects, obj.comments) == (["roof"], ["roof: y up"])
    obj, _ = write(tmp_path, seamed_actor(" "), "third.obj")
    assert obj.objects == ["figure"]


@pytest.mark.parametrize("name", ["v 1 2 3\nv 4 5 6", "a\rb", "\u2028", "é\udcff", "x" * 5000])
def test_line_breaks_in_names_add_no_line(tmp_path, name):
    obj, _ = write(tmp_path, seamed_actor(name))
    assert len(obj.v) == 5 and len(obj.objects) == 1
    data = (tmp_path / "out.obj").read_bytes()
    assert b"\r" not in data and len(data) < 2000


# Materials


def textured(*pictures, of_triangle=(0, 0, 0)):
    return seamed_actor(mesh=seamed_mesh(pictures=pictures, of_triangle=np.array(of_triangle)))


def pixels(path):
    with Image.open(path) as picture:
        return np.array(picture.convert("RGBA"))


def test_texture_is_written_next_to_the_mesh(tmp_path):
    obj, notes = write(tmp_path, textured(PICTURE))
    assert names(tmp_path) == ["out.mtl", "out.obj", "out_0.png"]
    assert obj.libraries == ["out.mtl"]
    assert [material for material, _ in obj.faces] == ["cloth 0"] * 3
    material = read_mtl(tmp_path / "out.mtl")["cloth 0"]
    assert material == {"Kd": "1 1 1", "map_Kd": "out_0.png"}
    assert_array_equal(pixels(tmp_path / "out_0.png"), PICTURE)
    assert f"{tmp_path / 'out_0.png'}: its texture" in notes


def test_each_run_of_triangles_states_its_material(tmp_path):
    actor = textured(PICTURE, OTHER_PICTURE, None, of_triangle=(1, 0, 1))
    obj, _ = write(tmp_path, actor)
    assert [material for material, _ in obj.faces] == ["cloth 1", "cloth 0", "cloth 1"]
    materials = read_mtl(tmp_path / "out.mtl")
    assert list(materials) == ["plain", "cloth 0", "cloth 1", "cloth 2"]
    assert "map_Kd" not in materials["cloth 2"]
    assert_array_equal(pixels(tmp_path / materials["cloth 1"]["map_Kd"]), OTHER_PICTURE)


def test_triangles_without_material_do_not_inherit_one(tmp_path):
    obj, _ = write(tmp_path, textured(PICTURE, of_triangle=(0, -1, 0)))
    assert [material for material, _ in obj.faces] == ["cloth 0", "plain", "cloth 0"]
    assert read_mtl(tmp_path / "out.mtl")["plain"] == {"Kd": "1 1 1"}


@pytest.mark.parametrize("pictures", [(), (None,)])
def test_file_without_a_texture_has_no_material(tmp_path, pictures):
    of_triangle = [len(pictures) - 1] * 3
    obj, _ = write(tmp_path, textured(*pictures, of_triangle=of_triangle))
    assert names(tmp_path) == ["out.obj"] and obj.libraries == []
    name = "cloth 0" if pictures else None  # kept, although no library describes it
    assert [material for material, _ in obj.faces] == [name] * 3


def test_existing_files_are_not_replaced(tmp_path):
    for name in ("out.mtl", "out_0.png"):
        (tmp_path / name).write_bytes(b"precious")
    obj, _ = write(tmp_path, textured(PICTURE))
    assert (tmp_path / "out.mtl").read_bytes() == b"precious"
    assert (tmp_path / "out_0.png").read_bytes() == b"precious"
    (library,) = obj.libraries
    picture = read_mtl(tmp_path / library)["cloth 0"]["map_Kd"]
    assert_array_equal(pixels(tmp_path / picture), PICTURE)


def test_existing_equal_files_are_used_again(tmp_path):
    for _ in range(3):
        write(tmp_path, textured(PICTURE))
    assert names(tmp_path) == ["out.mtl", "out.obj", "out_0.png"]
    write(tmp_path, textured(OTHER_PICTURE))
    write(tmp_path, textured(OTHER_PICTURE))
    assert names(tmp_path) == ["out-2.mtl", "out.mtl", "out.obj", "out_0-2.png", "out_0.png"]


def test_long_names_of_two_textures_are_distinct(tmp_path):
    obj, _ = write(tmp_path, textured(PICTURE, OTHER_PICTURE), f"{'x' * 200}.obj")
    materials = read_mtl(tmp_path / obj.libraries[0])
    for index, picture in enumerate((PICTURE, OTHER_PICTURE)):
        found = pixels(tmp_path / materials[f"cloth {index}"]["map_Kd"])
        assert_array_equal(found, picture)


@pytest.mark.parametrize("stem", ["a fat cat", "two\nlines", "ünï", "semi;colon", ".hidden", "#"])
def test_companion_files_have_names_without_spaces(tmp_path, stem):
    obj, _ = write(tmp_path, textured(PICTURE), f"{stem}.obj")
    (library,) = obj.libraries  # a name without spaces
    picture = read_mtl(tmp_path / library)["cloth 0"]["map_Kd"]
    assert len(picture.split()) == 1
    assert names(tmp_path) == sorted([f"{stem}.obj", library, picture])


# Figures with missing parts


def test_mesh_without_joints_is_written_unchanged(tmp_path):
    obj, _ = write(tmp_path, Actor(Figure("roof", seamed_mesh())))
    assert_array_equal(obj.v, POSITIONS)


def test_points_without_triangles_are_written(tmp_path):
    mesh = Mesh(POSITIONS, NORMALS, np.zeros((0, 3), np.int32))
    obj, notes = write(tmp_path, Actor(Figure("points", mesh)))
    assert_array_equal(obj.v, POSITIONS)
    assert obj.faces == [] and "5 vertices, 0 triangles" in notes[0]


def test_figure_without_mesh_is_refused(tmp_path):
    joints = ball_skeleton(("root",), np.array([-1]), np.zeros((1, 3)))
    with pytest.raises(RigError, match=r"^figure bones has no mesh to write as \.obj$"):
        write(tmp_path, Actor(Figure("bones", skeleton=joints)))
    assert names(tmp_path) == []


def test_suffix_may_have_capitals(tmp_path):
    assert len(write(tmp_path, seamed_actor(), "OUT.OBJ")[0].v) == 5


# Names and precision


def test_names_of_objects_and_materials_are_kept(tmp_path):
    mesh = replace(
        textured(PICTURE, None, of_triangle=(0, 0, 1)).figure.mesh,
        parts=("left glove", "hat"),
        triangle_parts=np.array([1, 0, 0]),
    )
    _, notes = write(tmp_path, Actor(Figure("roof", mesh)))
    lines = (tmp_path / "out.obj").read_text().splitlines()
    kept = [line for line in lines if line.startswith(("o ", "usemtl ", "f "))]
    assert [line.split(" ", 1)[1] if line[0] != "f" else "f" for line in kept] == [
        *("roof", "hat", "cloth 0", "f", "left glove", "f", "cloth 1", "f")
    ]
    assert len(notes) == 2  # the mesh and its texture: nothing is lost
    again = viewer.load(tmp_path / "out.obj").actors[0].figure.mesh
    assert [again.parts[part] for part in again.part_indices] == ["hat", *["left glove"] * 2]
    names = [again.materials[index].name for index in again.material_indices]
    assert names == ["cloth 0", "cloth 0", "cloth 1"]


def test_equal_names_of_materials_are_replaced_and_said(tmp_path):
    mesh = replace(seamed_mesh(), materials=(Material("skin"), Material("skin"), Material("nail")))
    _, notes = write(tmp_path, Actor(Figure("roof", replace(mesh, triangle_materials=[0, 1, 2]))))
    lines = (tmp_path / "out.obj").read_text().splitlines()
    used = [line for line in lines if line.startswith("usemtl")]
    assert used == ["usemtl material0", "usemtl material1", "usemtl nail"]
    assert notes[1] == (
        "2 materials have another name in the file, because names must be unique: skin, skin"
    )


def test_polygons_and_the_name_of_a_single_object_of_another_file(tmp_path):
    text = "o Roof tile\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n"
    (tmp_path / "quad.obj").write_text(text)
    _, notes = write(tmp_path, viewer.load(tmp_path / "quad.obj").actors[0])
    assert "\no Roof tile\n" in (tmp_path / "out.obj").read_text()
    assert notes[1] == (
        "polygons of the original file are written as triangles (1 quad: 2 triangles in all)"
    )


def test_meshes_far_from_the_origin_are_written_with_all_digits(tmp_path):
    """At 1e9 metres, nine digits would round to metres; halves need one digit more."""
    far = replace(seamed_mesh(), positions=POSITIONS / 2 + np.array([1e9, 0, 0]))
    obj, notes = write(tmp_path, Actor(Figure("roof", far)))
    assert_array_equal(obj.v, far.positions)
    assert len(notes) == 1


def test_reduced_weights_are_reported(tmp_path):
    """The tip turns vertex 3 from (1, 2, 1) to (1, -2, 1): all influences put it at (1, 1, 1)."""
    actor = seamed_actor(weights=((1, 0), (0, 1), (1, 0), (0.75, 0.25), (1, 0)), unit="m")
    actor.pose.dofs[5] = np.pi
    obj, notes = write(tmp_path, actor, max_influences=1)
    assert_allclose(obj.v[3], [1, 2, 1], rtol=0, atol=1e-8)
    assert notes[1] == (
        f"{tmp_path}/out.obj: vertices differ from the pose by up to 1 m (vertex 3): only the "
        "strongest influence of each vertex is written, as requested"
    )
