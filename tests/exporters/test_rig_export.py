"""Export of any figure as ``.skel`` and ``.skin``, which round-trips or reports its error."""

import re
from dataclasses import replace

import faults
import numpy as np
import pytest
from formats.pig_text import write as write_pig
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose, assert_array_equal
from plain_smpl import smpl_forward
from rigs.hand_made import skeleton
from seamed import OTHER_PICTURE, PICTURE, POSITIONS, TRIANGLES, UVS, seamed_actor, seamed_mesh

import viewer
from viewer.errors import OutputError, RigError, UnsupportedFormatError
from viewer.exporters import export
from viewer.rigs.figure import Figure
from viewer.rigs.material import Texture
from viewer.rigs.posing.pose_record import PoseRecord, apply_record
from viewer.rigs.scene import Actor
from viewer.rigs.skeleton import ball_skeleton
from viewer.rigs.skinning import Skinning, deform, joint_matrices

EXACT = 1e-12  # metres; sums of a few dozen values below 2


def there_and_back(actor, folder, **skinning):
    """Return the actor read from the two files, and the messages of the exporter."""
    notes = export(actor, folder / "rig.skel", Skinning(**skinning))
    scene = viewer.load(*sorted(folder.glob("rig.sk*")))
    known = re.compile("drawn untextured$|do not sum to 1 ")
    assert all(known.search(warning) for warning in scene.warnings), scene.warnings
    return scene.actors[0], notes


def told_error(notes):
    """Return the largest reported vertex error, value and unit; 0 if there is none."""
    measured = [note for note in notes if note.code == "X002"]
    if not measured:
        return 0.0, ""
    (note,) = measured
    assert note.path.name == "rig.skin" and note.values["original"] == "the pose"
    number, unit = note.values["vertex"].values["length"].split(" ", 1)
    return float(number), unit


def parts_not_held(notes):
    """Return the parts of the figure that the files cannot store."""
    return [part for note in notes if note.key == "X003.parts" for part in note.values["parts"]]


def vertices(actor):
    return deform(actor.figure, actor.pose)[0]


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.fixture
def body(tmp_path):
    """A shaped and posed model with the layout of SMPL, and its arrays."""
    folder = tmp_path / "model"
    folder.mkdir()
    arrays = model("smpl", 48)
    np.savez(folder / "body.npz", **arrays)
    actor = viewer.load(folder / "body.npz").actors[0]
    actor.pose.shape_weights[:3] = 1.5, -1.0, 0.5
    numbers = 0.3 * np.sin(np.arange(72.0))
    assert apply_record(PoseRecord(vector=numbers), actor.figure, actor.pose) == []
    return actor, arrays, numbers


SHAPE = [1.5, -1.0, 0.5]


def test_posed_body_round_trips_without_correctives(tmp_path, body):
    actor, arrays, numbers = body
    again, notes = there_and_back(actor, tmp_path, correctives=False)
    expected, joints = smpl_forward(arrays, SHAPE, numbers, correct=False)
    assert_allclose(vertices(again), expected, rtol=0, atol=EXACT)
    found = joint_matrices(again.figure, again.pose)[:, :3, 3]
    place = [again.figure.skeleton.names.index(name) for name in actor.figure.skeleton.names]
    assert_allclose(found[place], joints, rtol=0, atol=EXACT)
    # The figure as opened has the correctives.
    corrected, _ = smpl_forward(arrays, SHAPE, numbers)
    omitted = 1000 * np.linalg.norm(corrected - expected, axis=1).max()
    assert told_error(notes) == (pytest.approx(omitted, rel=5e-3), "mm")


def test_reported_error_is_that_of_the_omitted_correctives(tmp_path, body):
    actor, arrays, numbers = body
    again, notes = there_and_back(actor, tmp_path)
    whole = smpl_forward(arrays, SHAPE, numbers)[0]
    plain = smpl_forward(arrays, SHAPE, numbers, correct=False)[0]
    worst = 1000 * np.linalg.norm(whole - plain, axis=1).max()
    assert worst > 1
    assert told_error(notes) == (pytest.approx(worst, rel=5e-3), "mm")  # messages have three digits
    assert_allclose(vertices(again), plain, rtol=0, atol=EXACT)


def test_shape_is_baked_into_the_rest_mesh(tmp_path, body):
    actor, arrays, _ = body
    again, notes = there_and_back(actor, tmp_path)
    shaped, joints = smpl_forward(arrays, SHAPE)
    assert_allclose(again.figure.mesh.positions, shaped, rtol=0, atol=EXACT)
    # The joints are bound at the positions of the shaped body.
    place = [again.figure.skeleton.names.index(name) for name in actor.figure.skeleton.names]
    inverse_bind = again.figure.skin.inverse_bind[place]
    assert_allclose(inverse_bind[:, :3, 3], -joints, rtol=0, atol=EXACT)
    assert again.figure.n_shapes == 0
    shapes, correctives = "10 blend shapes (the current shape is kept)", "pose correctives"
    assert parts_not_held(notes) == [shapes, correctives, "the joint regressor"]


def test_weights_refer_to_the_joints_in_their_new_order(tmp_path, body):
    actor, arrays, _ = body
    again, _ = there_and_back(actor, tmp_path)
    skin, old = again.figure.skin, actor.figure.skeleton.names
    dense = np.zeros((48, 24))
    rows = np.repeat(np.arange(48), np.diff(skin.starts))
    columns = [old.index(again.figure.skeleton.names[joint]) for joint in skin.joints]
    dense[rows, columns] = skin.weights
    assert_array_equal(dense, arrays["weights"])


# Order, offsets and limits


def test_joints_are_listed_depth_first(tmp_path):
    # The children of 0 are 1 and 2, those of 1 are 3 and 5, that of 2 is 4; the input is
    # breadth-first, the output depth-first.
    joints = ball_skeleton(tuple("abcdef"), np.array([-1, 0, 0, 1, 2, 1]), np.eye(6, 3))
    actor = Actor(Figure("tree", skeleton=joints))
    again, _ = there_and_back(actor, tmp_path)
    assert again.figure.skeleton.names == ("a", "b", "d", "f", "c", "e")
    assert again.figure.skeleton.parents.tolist() == [-1, 0, 1, 1, 0, 4]


def test_several_roots_remain_roots(tmp_path):
    joints = ball_skeleton(tuple("abc"), np.array([-1, -1, 0]), np.eye(3))
    actor = Actor(Figure("two", skeleton=joints))
    actor.pose.figure_translation[:] = 5, 6, 7
    again, _ = there_and_back(actor, tmp_path)
    assert again.figure.skeleton.names == ("a", "c", "b")
    found = joint_matrices(again.figure, again.pose)[:, :3, 3]
    # a and c are followed by b, and all are moved.
    assert_allclose(found, [[6, 6, 7], [5, 6, 8], [5, 7, 7]], rtol=0, atol=EXACT)


def test_skeleton_without_mesh_writes_one_file(tmp_path):
    actor = Actor(Figure("bones", skeleton=ball_skeleton(("hip",), np.array([-1]), np.eye(1, 3))))
    notes = faults.lines(export(actor, tmp_path / "rig.skin"))
    assert names(tmp_path) == ["rig.skel"]
    assert notes == [f"{tmp_path / 'rig.skel'}: 1 joint"]


def test_either_suffix_writes_both_files(tmp_path):
    for suffix in (".skel", ".skin", ".SKEL"):
        folder = tmp_path / suffix
        folder.mkdir()
        export(seamed_actor(), folder / f"rig{suffix}")
        assert names(folder) == ["rig.skel", "rig.skin"]


def test_limits_and_missing_dofs_are_kept(tmp_path):
    joints = skeleton(
        [-1, 0],
        [(0, "ty", 0.5), (0, "x", 0.2, -1, 1), (1, "z", 0.3, 0, 2)],
        offsets=[[0, 0, 0], [0, 1, 0]],
    )
    again, _ = there_and_back(Actor(Figure("hinge", skeleton=joints)), tmp_path)
    found = again.figure.skeleton
    # The translation DOF of the root becomes part of its offset.
    assert_array_equal(found.rest_translations, [[0, 0.5, 0], [0, 1, 0]])
    assert_array_equal(found.rest_dofs, [0, 0, 0, 0.2, 0, 0, 0, 0, 0.3])
    inf = np.inf
    limits = [[-inf, inf]] * 3 + [[-1, 1], [0, 0], [0, 0], [0, 0], [0, 0], [0, 2]]
    assert_array_equal(found.dof_limits, limits)


def test_boxes_are_kept_or_generated(tmp_path):
    boxes = np.array([[[-1, -2, -3], [1, 2, 3]]], dtype=float)
    joints = skeleton([-1], [(0, "x", 0)], boxes=boxes)
    again, _ = there_and_back(Actor(Figure("box", skeleton=joints)), tmp_path)
    assert_array_equal(again.figure.skeleton.boxes, boxes)
    again, _ = there_and_back(seamed_actor(), tmp_path)
    sizes = again.figure.skeleton.boxes[:, 1] - again.figure.skeleton.boxes[:, 0]
    assert (sizes > 0).all() and (sizes < 0.2).all()  # small relative to a bone of length 1


# Place


def test_figure_translation_is_stored_in_the_root(tmp_path):
    actor = seamed_actor()
    actor.pose.figure_translation[:] = 5, 6, 7
    again, notes = there_and_back(actor, tmp_path)
    assert_array_equal(again.figure.skeleton.rest_translations, [[5, 6, 7], [1, 0, 0]])
    # Along the seam, vertices 1 and 2 occur twice; vertex 4, which is in no triangle, is last.
    split = POSITIONS[[0, 1, 1, 2, 2, 3, 4]] + [5, 6, 7]
    assert_allclose(vertices(again), split, rtol=0, atol=EXACT)
    assert told_error(notes) == (0, "")


def test_scale_is_baked_into_all_lengths(tmp_path):
    actor = seamed_actor(unit="m")
    actor.pose.figure_scale = 1.5
    again, notes = there_and_back(actor, tmp_path)
    assert parts_not_held(notes) == []
    assert told_error(notes) == (0, "")
    wanted = 1.5 * actor.figure.mesh.positions
    found = viewer.deform(again.figure, again.pose)[0]
    assert np.allclose(found.max(axis=0), wanted.max(axis=0), atol=1e-12)
    assert np.allclose(found.min(axis=0), wanted.min(axis=0), atol=1e-12)


def test_error_of_a_figure_without_unit_is_relative_to_its_size(tmp_path, monkeypatch):
    # The reported error is that of a missing scale.
    monkeypatch.setattr("viewer.exporters.rig.placed", lambda figure, matrix: figure)
    actor = seamed_actor()
    actor.pose.figure_scale = 1.5
    _, notes = there_and_back(actor, tmp_path)
    # The bounding box of the mesh is from (0, 0, 0) to (3, 3, 3), so its diagonal is also sqrt(27).
    assert told_error(notes) == (pytest.approx(50, rel=5e-3), "% of the size")


def test_loss_of_the_up_axis_is_reported(tmp_path):
    _, notes = there_and_back(seamed_actor(up="z"), tmp_path)
    assert parts_not_held(notes) == ["the up axis z"]


# Weights and seams


def test_raw_weights_are_written_as_stored(tmp_path):
    actor = viewer.load(
        write_pig(tmp_path / "pig", skinning_weights="0 0 0.5\n1 1 1\n0 2 1\n2 3 1\n2 4 0.75\n")
    ).actors[0]
    actor.pose.dofs[3:6] = 0.1, 0.2, 0.3
    again, notes = there_and_back(actor, tmp_path)
    assert told_error(notes) == (0, "")
    sums = np.add.reduceat(again.figure.skin.weights, again.figure.skin.starts[:-1])
    assert_array_equal(sums, [0.5, 1, 1, 1, 1, 1, 0.75])  # vertices 1 and 2 are split
    assert ("X005.seams", {"before": 5, "after": 7}) in faults.told(notes)


def test_error_caused_by_raw_weights_is_reported(tmp_path):
    rows = "0 0 0.5\n1 1 1\n0 2 1\n2 3 1\n2 4 0.75\n"
    actor = viewer.load(write_pig(tmp_path / "pig", skinning_weights=rows)).actors[0]
    actor.pose.figure_translation[:] = 3, 4, 0
    _, notes = there_and_back(actor, tmp_path)
    # Because of its weights, vertex 0 moves by only half of the 5 m.
    assert told_error(notes) == (pytest.approx(2.5, rel=5e-3), "m")
    lost = [
        "the up axis {up}",
        "body parts",
        "the symmetry map",
        "the reduced mesh",
        "the joint regressor",
    ]
    assert [part.sentence for part in parts_not_held(notes)] == lost


@pytest.mark.parametrize(
    ("options", "sums"), [({"normalize": True}, [1, 1]), ({"max_influences": 1}, [1, 1])]
)
def test_weights_are_written_after_limiting_and_normalising(tmp_path, options, sums):
    weights = [[0.5, 0], [0, 1], [1, 0], [0.5, 0.75], [1, 0]]
    again, notes = there_and_back(seamed_actor(weights=weights), tmp_path, **options)
    skin = again.figure.skin
    found = np.add.reduceat(skin.weights, skin.starts[:-1])
    assert_allclose(found[[0, 5]], sums, rtol=0, atol=EXACT)
    # Vertex 3, at (1, 2, 1), has a sum of 1.25 in the figure, whose size is 3 sqrt(3).
    percent = 100 * 0.25 * 6**0.5 / 27**0.5
    assert told_error(notes) == (pytest.approx(percent, rel=5e-3), "% of the size")
    assert np.diff(skin.starts)[5] == (1 if "max_influences" in options else 2)


def test_loss_of_dual_quaternions_is_reported(tmp_path):
    weights = [[0.5, 0.5]] * 5
    actor = seamed_actor(weights=weights, unit="m")
    actor.pose.dofs[3] = np.pi / 2  # the tip about x, the line through both joints
    _, notes = there_and_back(actor, tmp_path, method="dqs")
    # DQS rotates by 45 degrees and preserves the distance r from the line, while LBS reduces it to
    # r cos 45; the farthest vertex is 4, sqrt(18) from the line.
    gap = 18**0.5 * (1 - 0.5**0.5)
    assert told_error(notes) == (pytest.approx(gap, rel=5e-3), "m")


def test_seams_are_split(tmp_path):
    again, notes = there_and_back(seamed_actor(), tmp_path)
    mesh = again.figure.mesh
    assert_array_equal(mesh.positions[mesh.triangles], POSITIONS[TRIANGLES])
    corners = np.array([[0, 1, 2], [3, 4, 5], [0, 4, 3]])
    assert_array_equal(mesh.uvs[mesh.triangles], UVS[corners])
    assert ("X005.seams", {"before": 5, "after": 7}) in faults.told(notes)


def test_texture_is_copied(tmp_path):
    mesh = seamed_mesh(pictures=(PICTURE,), of_triangle=np.zeros(3, np.int32))
    again, _ = there_and_back(seamed_actor(mesh=mesh), tmp_path)
    assert names(tmp_path) == ["cloth0.png", "rig.skel", "rig.skin"]
    assert_array_equal(again.figure.mesh.materials[0].image, PICTURE)


def test_embedded_images_are_named_as_files(tmp_path):
    """Images in glTF files have names such as image0: two of them keep apart in one folder."""
    of_triangle = np.array([0, 1, 2], np.int32)
    embedded = seamed_mesh(pictures=(PICTURE, PICTURE, OTHER_PICTURE), of_triangle=of_triangle)
    shared = [
        replace(material, base_texture=Texture(name, image))
        for material, name, image in zip(
            embedded.materials,
            ("Skin.001", "Skin.001", "image0"),
            (PICTURE, PICTURE, OTHER_PICTURE),
            strict=True,
        )
    ]
    mesh = replace(embedded, materials=tuple(shared))
    again, _ = there_and_back(seamed_actor(mesh=mesh), tmp_path)
    assert names(tmp_path) == ["rig.skel", "rig.skin", "rig_0.png", "rig_2.png"]
    pictures = [material.image for material in again.figure.mesh.materials]
    for found, expected in zip(pictures, (PICTURE, PICTURE, OTHER_PICTURE), strict=True):
        assert_array_equal(found, expected)


# Data in another form


def test_rest_rotations_are_part_of_the_pose_of_the_file(tmp_path):
    """The tip has a rest rotation of 90 degrees about z and rotates by 90 degrees about x."""
    actor = seamed_actor(unit="m")
    turned = actor.figure.skeleton.rest_rotations.copy()
    turned[1] = 0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)
    limits = actor.figure.skeleton.dof_limits.copy()
    limits[3] = 0.0, 3.0
    joints = replace(actor.figure.skeleton, rest_rotations=turned, dof_limits=limits)
    actor = Actor(replace(actor.figure, skeleton=joints))
    actor.pose.dofs[3] = np.pi / 2
    again, notes = there_and_back(actor, tmp_path)
    # Rz Rx: the angles of the file are those about z and x.
    assert_allclose(again.pose.dofs[6:], [np.pi / 2, 0, np.pi / 2], rtol=0, atol=EXACT)
    # From the tip at (1, 0, 0), vertex 3 is at (0, 2, 1): Rx gives (0, -1, 2), Rz (1, 0, 2). It has
    # half of this and half of its place at rest.
    assert_allclose(vertices(again)[5], [1.5, 1, 1.5], rtol=0, atol=EXACT)
    assert faults.lines(notes)[2:] == [
        "split at texture seams: 5 vertices become 7 in the .skin",
        "1 joint has a rest rotation, a constraint or another order of rotations: the pose in the "
        "file contains its whole rotation (tip)",
        "limits of 1 joint are omitted, because its angles in the file are defined differently: "
        "tip",
    ]


def test_other_rotation_orders_and_translations_are_written(tmp_path):
    """The knee rotates by 90 degrees about z, then about x, and is moved along y."""
    rows = [(0, "x", 0), (1, "ty", 0), (1, "z", 0), (1, "x", 0)]
    actor = Actor(Figure("a", skeleton=skeleton([-1, 0], rows, names=["hip", "knee"])))
    actor.pose.dofs[:] = 0, 0.5, np.pi / 2, np.pi / 2
    export(actor, tmp_path / "rig.skel")
    again = viewer.load(tmp_path / "rig.skel").actors[0]
    found = joint_matrices(again.figure, again.pose)[1]
    assert_allclose(found[:3, :3], [[0, -1, 0], [0, 0, -1], [1, 0, 0]], rtol=0, atol=EXACT)
    wanted = actor.figure.skeleton.rest_translations[1] + [0, 0.5, 0]
    assert_allclose(found[:3, 3], wanted, rtol=0, atol=EXACT)


def test_scales_of_joints_are_part_of_the_bindings(tmp_path):
    actor = seamed_actor()
    actor.pose.scales[:] = (2, 1, 1), (1, 1, 3)
    actor.pose.figure_scale, actor.pose.figure_translation[:] = 10.0, [0, 0, 5]
    again, notes = there_and_back(actor, tmp_path)
    # The root takes vertex 3 from (1, 2, 1) to (2, 2, 1), the tip to (2, 2, 3), and half of each to
    # (2, 2, 2). Then the figure is scaled by 10 and moved by 5.
    assert_allclose(vertices(again)[5], [20, 20, 25], rtol=0, atol=1e-11)
    places = joint_matrices(again.figure, again.pose)[:, :3, 3]
    assert_allclose(places, [[0, 0, 5], [20, 0, 5]], rtol=0, atol=1e-11)
    assert told_error(notes) == (0, "")
    assert "X005.skel-scaled" in {note.key for note in notes}


@pytest.mark.parametrize(
    ("name", "written"),
    [("a{b", "a(b"), ("two\nlines", "two lines"), ("offset", "_offset"), ("pose x", "_pose x")],
)
def test_names_that_the_format_cannot_hold_are_changed(tmp_path, name, written):
    joints = ball_skeleton((name,), np.array([-1]), np.zeros((1, 3)))
    notes = export(Actor(Figure("a", skeleton=joints)), tmp_path / "rig.skel")
    again = viewer.load(tmp_path / "rig.skel").actors[0].figure
    assert again.skeleton.names == (written,)
    assert notes[-1].key == "X005.skel-names" and notes[-1].values["names"] == [name]


# Data that the format cannot represent


def refused(actor, folder, error=RigError):
    with pytest.raises(error) as caught:
        export(actor, folder / "rig.skel")
    assert names(folder) == []
    return str(caught.value)


def test_scale_of_zero_is_refused(tmp_path):
    actor = seamed_actor()
    actor.pose.scales[1] = 0.0
    assert refused(actor, tmp_path) == (
        ".skin cannot store joint tip, which is scaled to 0: show it, or choose .glb"
    )


def test_mesh_without_skeleton_is_refused(tmp_path):
    actor = Actor(Figure("roof", seamed_mesh()))
    assert refused(actor, tmp_path) == "figure roof has no skeleton to write as .skel"


def test_refusal_of_the_skin_reverts_the_skeleton(tmp_path):
    mesh = replace(seamed_mesh(), triangles=np.zeros((0, 3), np.int32), uvs=None,
                   uv_triangles=None, triangle_materials=None, triangle_parts=None)  # fmt: skip
    actor = seamed_actor(mesh=mesh)
    text = refused(actor, tmp_path, UnsupportedFormatError)
    assert text == "figure roof has no triangles to write as .skin"
    for name in ("rig.skel", "rig.skin"):
        (tmp_path / name).write_text(f"precious {name}")
    with pytest.raises(UnsupportedFormatError):
        export(actor, tmp_path / "rig.skel")
    assert (tmp_path / "rig.skel").read_text() == "precious rig.skel"
    assert names(tmp_path) == ["rig.skel", "rig.skin"]


def test_texture_with_different_content_is_never_replaced(tmp_path):
    (tmp_path / "cloth0.png").write_bytes(b"precious")
    mesh = seamed_mesh(pictures=(PICTURE,), of_triangle=np.zeros(3, np.int32))
    with pytest.raises(OutputError) as caught:
        export(seamed_actor(mesh=mesh), tmp_path / "rig.skel")
    assert str(caught.value).startswith(f"{tmp_path / 'cloth0.png'}")
    assert names(tmp_path) == ["cloth0.png"]
    assert (tmp_path / "cloth0.png").read_bytes() == b"precious"
