"""glTF files of one pose, read back by a separate reader that checks the specification."""

import io
from dataclasses import replace

import faults
import numpy as np
import pytest
from builders import family_figure
from formats.synthetic_smpl import model
from gltf_files import EXACT, TO_Y, assert_drawn, assert_joints, corners, write
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image
from plain_gltf import Gltf
from plain_smpl import smpl_forward
from seamed import (
    OTHER_PICTURE,
    PICTURE,
    POSITIONS,
    TRIANGLES,
    UV_TRIANGLES,
    UVS,
    seamed_actor,
    seamed_mesh,
)
from small_rigs import write_twist

import viewer
from viewer.errors import OutputError, RigError
from viewer.exporters import export, files_written
from viewer.loading import bundled_body
from viewer.rigs.captures.points import PointLayout
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import Mesh
from viewer.rigs.morph_target import MorphTarget, with_morphs
from viewer.rigs.scene import Actor
from viewer.rigs.skeleton import ball_skeleton
from viewer.rigs.skin import skin_from_lists
from viewer.rigs.skinning import Skinning, deform


def test_roof_round_trips(tmp_path):
    gltf, notes = write(tmp_path, seamed_actor(unit="m"))
    assert_drawn(gltf, seamed_actor().figure, None)
    assert_array_equal(corners(gltf, gltf.vertices()[0]), POSITIONS[TRIANGLES])
    flipped = UVS * [1, -1] + [0, 1]
    assert_allclose(
        corners(gltf, gltf.attribute("TEXCOORD_0")), flipped[UV_TRIANGLES], rtol=0, atol=1e-7
    )
    # Vertices 1 and 2 have two coordinates each; vertex 4, in no triangle, is kept.
    size = (tmp_path / "out.glb").stat().st_size
    assert notes == [
        f"{tmp_path / 'out.glb'}: 7 vertices (5 before they were split along texture seams), "
        f"3 triangles, 2 joints, {size / 1000:.3g} kB"
    ]
    assert gltf.nodes[gltf.parents[gltf.named("tip")]]["name"] == "root"


def test_two_bent_joints_match_hand_calculation(tmp_path):
    actor = seamed_actor(unit="m", mesh=seamed_mesh(uvs=False))
    actor.pose.dofs[:] = 0, 0, 0, 0, 0, np.pi / 2  # the tip at (1, 0, 0), about z
    gltf, _ = write(tmp_path, actor)
    # Vertex 3 has equal weights: (1, 2, 1) stays for one joint and moves to (1, 0, 0) + (-2, 0, 1)
    # for the other.
    wanted = [[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 1, 1], [3, 3, 3]]
    assert_allclose(gltf.vertices()[0], wanted, rtol=0, atol=EXACT)
    tip = gltf.nodes[gltf.named("tip")]
    assert_allclose(tip["rotation"], [0, 0, np.sqrt(0.5), np.sqrt(0.5)], rtol=0, atol=1e-15)
    assert tip["translation"] == [1, 0, 0]


def test_fox_positions_match_skinning(tmp_path):
    actor = viewer.load().actors[0]
    actor.pose.dofs[:] = np.linspace(-0.5, 0.5, len(actor.pose.dofs))
    gltf, notes = write(tmp_path, actor)
    assert_drawn(gltf, actor.figure, actor.pose)
    assert_joints(gltf, actor.figure, actor.pose)
    counts = np.diff(actor.figure.skin.starts)
    assert len(gltf.influence_sets()) == -(-counts.max() // 4)
    with Image.open(io.BytesIO(gltf.picture(0))) as picture:
        assert_array_equal(picture.convert("RGBA"), actor.figure.mesh.materials[0].image)
    (material,) = gltf.root["materials"]
    assert material["doubleSided"] and material["pbrMetallicRoughness"]["metallicFactor"] == 0
    four = Skinning(max_influences=4)
    apart = deform(actor.figure, actor.pose, four)[0] - deform(actor.figure, actor.pose)[0]
    size = np.linalg.norm(np.ptp(actor.figure.mesh.positions, axis=0))
    percent = 100 * np.linalg.norm(apart, axis=1).max() / size
    assert notes[1:] == [
        "lengths are unchanged: the unit of fox is unknown, and programs interpret glTF lengths as "
        "metres",
        f"up to {counts.max()} influences per vertex, all of them written, strongest first; "
        f"programs that read only the first four are wrong by up to {percent:.3g} % of the size",
        "not stored in glTF: joint limits",
    ]


@pytest.mark.slow
def test_body_is_baked_in_shape_and_pose(tmp_path):
    actor = viewer.load(bundled_body()).actors[0]
    pose = actor.pose
    pose.dofs[:] = np.linspace(-0.6, 0.4, len(pose.dofs))
    pose.shape_weights[:3] = 2, -1, 0.5
    pose.figure_translation[:], pose.figure_scale = [0.5, -1, 2], 1.25
    gltf, notes = write(tmp_path, actor)
    assert_drawn(gltf, actor.figure, pose)
    assert_joints(gltf, actor.figure, pose)
    apart = (
        deform(actor.figure, pose)[0] - deform(actor.figure, pose, Skinning(correctives=False))[0]
    )
    off = np.linalg.norm(apart, axis=1)
    assert notes[1:] == [
        "the shape is baked into mesh and joints",
        f"{tmp_path}/out.glb: vertices differ from the pose by up to {1000 * off.max():.3g} mm "
        f"(vertex {off.argmax()}): pose correctives are not supported",
        "not stored in glTF: 10 blend shapes (baked into the mesh), pose correctives, "
        "the symmetry map, the joint regressor",
    ]
    # The placement is a node above the skeleton and has no other effect.
    node = gltf.nodes[gltf.named(actor.figure.name)]
    assert node["translation"] == [0.5, -1, 2] and node["scale"] == [1.25] * 3


def test_shaped_body_matches_the_plain_formula(tmp_path):
    arrays = model("smpl", 48)
    figure = family_figure("smpl", tmp_path, 48)
    actor = Actor(figure)
    vectors = np.zeros((24, 3))
    vectors[1], vectors[16] = [0, 0, 0.5], [0.3, 0, 0]
    actor.pose.shape_weights[:2] = 1.5, -2
    actor.pose.dofs[:] = vectors.ravel()  # with one axis each, angles are rotation vectors
    gltf, _ = write(tmp_path, actor)
    wanted, joints = smpl_forward(arrays, [1.5, -2], vectors, correct=False)
    assert_allclose(gltf.vertices()[0], wanted, rtol=0, atol=5e-6)
    found = gltf.world()[gltf.root["skins"][0]["joints"], :3, 3]
    assert_allclose(found, joints, rtol=0, atol=1e-12)


def test_skel_and_skin_rig_is_exported(tmp_path):
    actor = viewer.load(*write_twist(tmp_path)).actors[0]
    knee = actor.figure.skeleton.names.index("high")
    turn = np.flatnonzero(
        (actor.figure.skeleton.dof_joints == knee) & (actor.figure.skeleton.dof_kinds == 4)
    )
    actor.pose.dofs[turn] = np.pi / 2  # about y, (1, y, 0) moves to (0, y, -1)
    gltf, _ = write(tmp_path, actor)
    assert_allclose(gltf.vertices()[0], [[1, 0, 0], [0.5, 1, -0.5], [0, 2, -1]], rtol=0, atol=EXACT)


def test_z_up_is_rotated_by_a_node(tmp_path):
    actor = seamed_actor(unit="m", up="z")
    actor.pose.dofs[:] = 0.1, 0.2, 0.3, 0.4, 0.5, 0.6
    actor.pose.figure_translation[:] = 1, 2, 3
    gltf, notes = write(tmp_path, actor)
    assert_drawn(gltf, actor.figure, actor.pose, TO_Y)
    assert_joints(gltf, actor.figure, actor.pose, TO_Y)
    assert notes[1:] == ["z is up: a node above the figure rotates it by -90 degrees about x"]


def test_materials_are_written_as_primitives_with_textures(tmp_path):
    pictures = (PICTURE, None, OTHER_PICTURE, PICTURE)
    mesh = seamed_mesh(pictures=pictures, of_triangle=np.array([2, -1, 0]))
    actor = seamed_actor(mesh=mesh, unit="m")
    actor.color = (0.1, 0.2, 0.3)
    gltf, _ = write(tmp_path, actor)
    assert_drawn(gltf, actor.figure, actor.pose)
    materials = [gltf.root["materials"][p["material"]] for p in gltf.primitives]
    assert [m["name"] for m in materials] == ["plain", "cloth 0", "cloth 2"]
    assert materials[0]["pbrMetallicRoughness"]["baseColorFactor"] == [0.1, 0.2, 0.3, 1]
    for material, wanted in ((materials[1], PICTURE), (materials[2], OTHER_PICTURE)):
        texture = material["pbrMetallicRoughness"]["baseColorTexture"]["index"]
        source = gltf.root["textures"][texture]["source"]
        with Image.open(io.BytesIO(gltf.picture(source))) as picture:
            assert_array_equal(picture.convert("RGBA"), wanted)
    assert gltf.root["samplers"][0]["wrapS"] == 33071  # clamped at the edges as in the viewer


def test_shared_texture_is_written_once(tmp_path):
    mesh = seamed_mesh(pictures=(PICTURE,), of_triangle=np.zeros(3, int))
    mesh = replace(mesh, materials=mesh.materials * 2, triangle_materials=np.array([0, 1, 1]))
    gltf, _ = write(tmp_path, seamed_actor(mesh=mesh))
    assert len(gltf.root["images"]) == 1 and len(gltf.root["materials"]) == 2


def test_texture_without_coordinates_is_omitted(tmp_path):
    mesh = seamed_mesh(uvs=False, pictures=(PICTURE,), of_triangle=np.zeros(3, int))
    gltf, _ = write(tmp_path, seamed_actor(mesh=mesh))
    assert "textures" not in gltf.root and "TEXCOORD_0" not in gltf.primitives[0]["attributes"]


def test_morphs_are_written_as_morph_targets(tmp_path):
    figure = seamed_actor(mesh=seamed_mesh(uvs=False), unit="m").figure
    targets = [
        MorphTarget("lift", [1, 3], [[1, 0, 2], [1, 2, 5]], [[0, 0, 1], [1, 0, 0]]),
        MorphTarget("idle", [0], [[9, 9, 9]]),
        MorphTarget("wide", [1], [[5, 0, 0]]),
    ]
    actor = Actor(with_morphs(figure, targets))
    actor.pose.shape_weights[:] = 0.5, 0, -1
    actor.pose.dofs[5] = 0.3
    gltf, notes = write(tmp_path, actor)
    assert_drawn(gltf, actor.figure, actor.pose)
    mesh = gltf.root["meshes"][0]
    assert mesh["weights"] == [0.5, -1] and mesh["extras"]["targetNames"] == ["lift", "wide"]
    target = mesh["primitives"][0]["targets"][0]
    assert gltf.accessor(target["POSITION"]).tolist()[1] == [0, 0, 2]
    # The normal (0, 3, 4) is normalised, so it and its morph offset are divided by 5.
    assert_allclose(gltf.accessor(target["NORMAL"])[1], [0, -0.6, -0.6], rtol=0, atol=EXACT)
    assert notes[1:] == ["2 blend shapes are morph targets", "not stored in glTF: 1 blend shape"]


def test_too_many_morphs_are_baked_into_the_mesh(tmp_path):
    figure = seamed_actor(unit="m").figure
    targets = [MorphTarget(f"t{k}", [0], [[0, 0, k]]) for k in range(1, 66)]
    actor = Actor(with_morphs(figure, targets))
    actor.pose.shape_weights[:] = 0.01
    gltf, notes = write(tmp_path, actor)
    assert_drawn(gltf, actor.figure, actor.pose)
    assert "targets" not in gltf.primitives[0]
    assert notes[1] == "the shape is baked into mesh and joints"
    assert notes[2] == "not stored in glTF: 65 blend shapes (baked into the mesh)"


def test_skeleton_without_mesh_is_written(tmp_path):
    skeleton = ball_skeleton(("a", "a", ""), np.array([-1, 0, -1]), np.eye(3))
    gltf, notes = write(tmp_path, Actor(Figure("bare", skeleton=skeleton, unit="m")))
    assert "meshes" not in gltf.root and "buffers" not in gltf.root
    names = [node.get("name", "") for node in gltf.nodes]
    assert names == ["bare", "a", "a", ""]
    assert_allclose(gltf.world()[1:, :3, 3], np.eye(3), rtol=0, atol=0)
    size = (tmp_path / "out.glb").stat().st_size
    assert notes == [f"{tmp_path / 'out.glb'}: 3 joints, {size} bytes"]


def test_mesh_without_skeleton_and_unbound_mesh_are_written(tmp_path):
    gltf, notes = write(tmp_path, Actor(Figure("stone", seamed_mesh(), up="z", unit="m")))
    assert_allclose(corners(gltf, gltf.vertices()[0]), POSITIONS[TRIANGLES] @ TO_Y.T, atol=EXACT)
    assert "skins" not in gltf.root and "3 triangles, " in notes[0]
    actor = Actor(replace(seamed_actor(unit="m").figure, skin=None))
    actor.pose.figure_translation[:] = 0, 7, 0
    gltf, _ = write(tmp_path, actor)
    assert_allclose(corners(gltf, gltf.vertices()[0])[..., 1], POSITIONS[TRIANGLES][..., 1] + 7)


def test_points_without_triangles_and_empty_figures_are_written(tmp_path):
    actor = seamed_actor(mesh=Mesh(POSITIONS, np.zeros((5, 3)), np.zeros((0, 3))), unit="m")
    gltf, _ = write(tmp_path, actor)
    assert_allclose(gltf.vertices()[0], POSITIONS, rtol=0, atol=0)
    assert gltf.vertices()[1].tolist() == [[0, 1, 0]] * 5  # no vertex has a normal here
    mesh = Mesh(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)))
    skeleton = ball_skeleton(("a",), np.array([-1]), np.zeros((1, 3)))
    skin = skin_from_lists([], np.eye(4)[None])
    gltf, notes = write(tmp_path, Actor(Figure("none", mesh, skeleton, skin, unit="m")))
    assert "meshes" not in gltf.root and "skins" not in gltf.root
    assert notes[1] == "the mesh has no vertices and is omitted"


def test_gltf_and_bin_files_are_written_together(tmp_path):
    actor = seamed_actor(name="ro\udc80of")
    notes = faults.lines(export(actor, tmp_path / "a roof%1.gltf"))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a roof%1.bin", "a roof%1.gltf"]
    gltf = Gltf(tmp_path / "a roof%1.gltf")
    assert_drawn(gltf, actor.figure, actor.pose)
    assert gltf.nodes[0]["name"] == "ro?of"
    size = (tmp_path / "a roof%1.bin").stat().st_size
    assert notes[1] == f"{tmp_path / 'a roof%1.bin'}: array data, {size} bytes"
    assert files_written("x.gltf")[1].name == "x.bin" and len(files_written("x.glb")) == 1


def test_either_both_files_are_written_or_none(tmp_path):
    (tmp_path / "roof.gltf").write_text("before")
    (tmp_path / "roof.bin").mkdir()
    with pytest.raises(OutputError, match=r"roof\.bin: is a folder"):
        export(seamed_actor(), tmp_path / "roof.gltf")
    assert (tmp_path / "roof.gltf").read_text() == "before"


def test_unsupported_data_is_refused(tmp_path):
    mesh = replace(seamed_mesh(), positions=POSITIONS * 1e300)
    message = "huge: expected numbers that fit glTF's single precision, found 1e+300"
    with pytest.raises(RigError, match=f"^{message.replace('+', '.')}$"):
        export(Actor(Figure("huge", mesh)), tmp_path / "x.glb")
    layout = PointLayout("one", ("nose",), np.zeros((0, 2)), np.zeros(1))
    with pytest.raises(RigError, match=r"^figure dots has neither mesh nor skeleton to write"):
        export(Actor(Figure("dots", points=layout)), tmp_path / "x.glb")
    actor = seamed_actor()
    actor.pose.translations[0, 0] = np.nan
    with pytest.raises(RigError, match=r"^expected finite numbers in the pose, which glTF needs$"):
        export(actor, tmp_path / "x.glb")
    assert list(tmp_path.iterdir()) == []
