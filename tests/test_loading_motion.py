"""Motions, poses and morphs opened together with figures: assignment and refusals."""

import json

import numpy as np
import pytest
from app.tiny import SKEL, skin_text, write_rig
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose

import viewer
from viewer.errors import RigError
from viewer.loading import MotionSettings, bundled_body, load
from viewer.rigs.scene import pose_actors
from viewer.rigs.skinning import joint_matrices

BVH = """HIERARCHY
ROOT pelvis
{
 OFFSET 0 0 0
 CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
 JOINT left_hip
 {
  OFFSET 10 -5 0
  CHANNELS 3 Zrotation Yrotation Xrotation
  JOINT left_knee
  {
   OFFSET 0 -40 0
   CHANNELS 3 Zrotation Yrotation Xrotation
   End Site
   {
    OFFSET 0 -42 0
   }
  }
 }
 JOINT right_hip
 {
  OFFSET -10 -5 0
  CHANNELS 3 Zrotation Yrotation Xrotation
  JOINT right_knee
  {
   OFFSET 0 -40 0
   CHANNELS 3 Zrotation Yrotation Xrotation
   End Site
   {
    OFFSET 0 -42 0
   }
  }
 }
}
MOTION
Frames: 2
Frame Time: 0.1
0 90 0  0 0 0  0 0 0  0 0 0  0 0 0  0 0 0
5 90 0  0 0 0  0 0 -30  0 0 45  0 0 0  0 0 0
"""


def person(number, x, angle=0.0):
    poses = np.zeros(72)
    poses[3 * 4] = angle
    return {
        "id": number, "Rh": [[np.pi / 2, 0, 0]], "Th": [[x, 0, 1.0]],
        "poses": [poses.tolist()], "shapes": [[0.0] * 10],
    }  # fmt: skip


@pytest.fixture
def recording(tmp_path):
    """A folder of four frames: person 0 always, person 7 in the middle two."""
    folder = tmp_path / "output" / "smpl"
    folder.mkdir(parents=True)
    for frame in range(4):
        people = [person(0, 0.1 * frame, 0.2 * frame)]
        if frame in (1, 2):
            people.append(person(7, 5.0))
        (folder / f"{frame + 20:06}.json").write_text(json.dumps(people))
    return tmp_path / "output"


@pytest.fixture
def smpl(tmp_path):
    path = tmp_path / "SMPL.npz"
    np.savez(path, **model("smpl"))
    return path


def test_people_appear_and_disappear(recording, smpl):
    scene = load(recording, smpl)
    assert [actor.person for actor in scene.actors] == [0, 7]
    assert scene.up == "z"
    first, second = scene.actors
    assert first.figure is second.figure
    for frame in range(4):
        for actor in scene.actors:
            pose_actors([actor], frame / 30.0)
        assert first.is_present and second.is_present == (frame in (1, 2))
        assert_allclose(first.pose.dofs[3 * 4], 0.2 * frame, atol=1e-12)


def test_model_among_the_files_is_not_a_separate_actor(recording, smpl):
    assert len(load(smpl, recording).actors) == 2
    named = load(recording, motion=MotionSettings(model=smpl))
    assert [actor.figure.name for actor in named.actors] == ["SMPL", "SMPL"]


def test_without_a_model_the_bundled_body_is_used_with_a_note(recording):
    scene = load(recording)
    assert scene.actors[0].figure.n_shapes == 10
    assert any("drawn with the bundled body" in text for text in scene.warnings)


def test_bundled_body_ignores_shapes_and_expressions_of_the_files(tmp_path):
    for name, extra, lost in (
        (
            "a",
            {"shapes": [[1.0] * 10]},
            ", to which the shape coefficients of the files do not apply",
        ),
        (
            "b",
            {"shapes": [[1.0] * 10], "expression": [[0.0] * 10]},
            ", to which the shape and expression coefficients of the files do not apply",
        ),
        ("c", {}, ""),
    ):
        folder = tmp_path / name / "smpl"
        folder.mkdir(parents=True)
        (folder / "000000.json").write_text(json.dumps([person(0, 0.0) | extra]))
        text = (
            f"{tmp_path / name}: drawn with the bundled body{lost} (--model selects another body)"
        )
        assert load(tmp_path / name).warnings == (text,)


def test_people_without_shapes_are_reported_once(tmp_path, smpl):
    folder = tmp_path / "output" / "smpl"
    folder.mkdir(parents=True)
    people = [person(0, 0.0), person(7, 5.0)]
    for record in people:
        del record["shapes"]
    for frame in range(300):  # read in several parts
        (folder / f"{frame:06}.json").write_text(json.dumps(people))
    text = (
        f"{tmp_path / 'output'}: no shape coefficients in the files: the model's mean shape is "
        "used for all"
    )
    motion = MotionSettings(frame_rate=30.0)
    assert load(tmp_path / "output", smpl, motion=motion).warnings == (text,)
    (folder / "000299.json").write_text(json.dumps([person(0, 0.0), people[1]]))
    assert text not in load(tmp_path / "output", smpl).warnings


def test_requested_frame_rate_is_used(recording, smpl):
    scene = load(recording, smpl, motion=MotionSettings(frame_rate=50.0))
    assert scene.actors[0].clip.end == pytest.approx(3 / 50)


def test_requested_up_axis_is_used(recording, smpl):
    assert load(recording, smpl, motion=MotionSettings(up="y")).up == "y"
    turned = load(recording, smpl, motion=MotionSettings(up="-y"))
    assert turned.up == "y"
    assert_allclose(turned.actors[1].placement[:3, :3], np.diag([1.0, -1.0, -1.0]), atol=1e-15)


def test_hands_without_bodies_require_a_hand_model(tmp_path):
    folder = tmp_path / "smpl"
    folder.mkdir()
    record = person(0, 0.0) | {"poses": [[0.0] * 9]}
    (folder / "000000.json").write_text(json.dumps([record]))
    with pytest.raises(RigError, match=r"MANO.*--model"):
        load(folder)


def test_bvh_drives_a_body_or_is_shown_as_a_skeleton(tmp_path):
    path = tmp_path / "legs.bvh"
    path.write_text(BVH)
    alone = load(path)
    assert [actor.figure.name for actor in alone.actors] == ["legs"]
    assert alone.actors[0].figure.mesh is None
    driven = load(path, bundled_body())
    assert len(driven.actors) == 1 and driven.actors[0].figure.mesh is not None
    actor = driven.actors[0]
    pose_actors([actor], 0.1)
    names, matrices = actor.figure.skeleton.names, joint_matrices(actor.figure, actor.pose)
    places = [matrices[names.index(f"left_{name}"), :3, 3] for name in ("hip", "knee", "ankle")]
    thigh, shin = np.diff(places, axis=0)
    bend = np.arccos(thigh @ shin / np.linalg.norm(thigh) / np.linalg.norm(shin))
    # The file has no ankles, but its End Sites show the direction of the shin.
    assert_allclose(bend, np.pi / 4, atol=1e-6)
    beside = load(path, bundled_body(), motion=MotionSettings(drives=False))
    assert len(beside.actors) == 2


def test_bvh_that_drives_no_model_is_a_separate_actor(tmp_path):
    path = tmp_path / "legs.bvh"
    path.write_text(BVH)
    scene = load(path, *write_rig(tmp_path))
    assert len(scene.actors) == 2
    assert any("shown separately" in text for text in scene.warnings)
    boxes = [viewer.rigs.scene.actor_points(actor) for actor in scene.actors]
    assert (
        boxes[0][:, 0].max() < boxes[1][:, 0].min() or boxes[1][:, 0].max() < boxes[0][:, 0].min()
    )


def test_requested_unit_rate_and_up_axis_of_a_bvh_are_used(tmp_path):
    path = tmp_path / "legs.bvh"
    path.write_text(BVH)
    scene = load(path, motion=MotionSettings(unit="cm", frame_rate=20.0, up="z"))
    skeleton = scene.actors[0].figure.skeleton
    assert_allclose(skeleton.rest_translations[2], [0.0, -0.4, 0.0], atol=1e-12)
    assert scene.actors[0].clip.end == pytest.approx(0.05)
    assert scene.up == "z"


def morph_text():
    return "positions 1 { 0 5 6 7 } normals 1 { 0 0 0 1 }"


def test_morph_is_added_to_its_skin_with_or_without_a_skeleton(tmp_path):
    skel, skin = write_rig(tmp_path)
    morph = tmp_path / "smile.morph"
    morph.write_text(morph_text())
    for files in ((skel, skin, morph), (morph, skin)):
        actor = load(*files).actors[0]
        rest, _ = viewer.deform(actor.figure, actor.pose)
        assert actor.figure.blend_shapes.names == ("smile",)
        actor.pose.shape_weights[0] = 0.5
        moved = viewer.shaped(actor.figure, actor.pose.shape_weights).mesh.positions
        base = actor.figure.mesh.positions
        assert_allclose(moved[0], base[0] + 0.5 * (np.array([5, 6, 7]) - base[0]), atol=1e-12)
        assert_allclose(moved[1:], base[1:], atol=1e-15)
        assert (viewer.deform(actor.figure, actor.pose)[0] != rest).any()


def test_morph_without_a_skin_and_morph_of_another_skin_are_refused(tmp_path):
    morph = tmp_path / "smile.morph"
    morph.write_text("positions 1 { 99999 5 6 7 } normals 1 { 99999 0 0 1 }")
    with pytest.raises(RigError, match=r"open it together with its \.skin"):
        load(morph)
    skel, skin = write_rig(tmp_path)
    with pytest.raises(RigError, match="vertex index 99999 is out of range"):
        load(skel, skin, morph)


def test_rig_file_opens_its_files_even_with_cycles(tmp_path):
    (tmp_path / "a.skel").write_text(SKEL)
    (tmp_path / "a.skin").write_text(skin_text())
    (tmp_path / "smile.morph").write_text(morph_text())
    (tmp_path / "a.rig").write_text(
        "rig a { skeleton a.skel skin a.skin morphs 1 { smile.morph } }"
    )
    (actor,) = load(tmp_path / "a.rig").actors
    assert actor.figure.is_attached and actor.figure.blend_shapes.names == ("smile",)
    (tmp_path / "b.rig").write_text("rig b { skeleton c.rig }")
    (tmp_path / "c.rig").write_text("rig c { skeleton ./b.rig skin a.skin }")
    (only,) = load(tmp_path / "b.rig").actors
    assert only.figure.skeleton is None


def test_anim_clip_is_accepted_for_skel_rigs_only(tmp_path, smpl):
    # An SMPL body has 72 DOFs, as a .skel-style rig of 23 joints, with different meanings.
    channel = " channel { extrapolate constant constant keys 1 { 0 0 flat flat } }"
    path = tmp_path / "walk.anim"
    path.write_text("animation { range 0 1 numchannels 72" + 72 * channel + " }")
    with pytest.raises(RigError, match="72 channels"):
        load(smpl, path)
