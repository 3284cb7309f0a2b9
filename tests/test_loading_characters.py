"""Motions of bodies and other figures retargeted to characters with different joints."""

import re
from dataclasses import replace

import numpy as np
import pytest
from formats.capture_files import body, write_frames
from formats.gltf.files import File
from formats.vrm.swinging import swinging
from numpy.testing import assert_allclose

import viewer
from viewer.app.files.files import Loader
from viewer.cli import run
from viewer.errors import RigError
from viewer.loading import MotionSettings, begin, capturing, load, read_files
from viewer.rigs.retargeting.driven_clip import driven_clip
from viewer.rigs.retargeting.joint_map import JointMap
from viewer.rigs.scene import pose_actors
from viewer.rigs.skinning import joint_matrices

LIMBS = {
    "leftUpperArm": "leftLowerArm",
    "rightLowerArm": "rightHand",
    "leftUpperLeg": "leftLowerLeg",
    "rightLowerLeg": "rightFoot",
}
NAMES = {
    **{"leftUpperArm": "left_shoulder", "leftLowerArm": "left_elbow", "rightHand": "right_wrist"},
    **{"rightLowerArm": "right_elbow", "leftUpperLeg": "left_hip", "leftLowerLeg": "left_knee"},
    **{"rightLowerLeg": "right_knee", "rightFoot": "right_ankle"},
}
SPRINGS = MotionSettings(springs=True)


@pytest.fixture(scope="module")
def hero(tmp_path_factory):
    path = tmp_path_factory.mktemp("hero") / "hero.vrm"
    path.write_bytes(swinging(turn=False).glb())
    return path


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """A folder of captured frames of two people whose up axis is z."""
    folder = tmp_path_factory.mktemp("take") / "take"
    upright = {"Rh": [[np.pi / 2, 0.0, 0.0]]}
    frames = {
        f: [body(0, seed=f, Th=[[0.0, 0.1 * f, 1.0]], **upright), body(1, seed=9 + f, **upright)]
        for f in range(4)
    }
    write_frames(folder / "smpl", frames)
    return folder


@pytest.fixture(scope="module")
def amass(tmp_path_factory):
    path = tmp_path_factory.mktemp("amass") / "walk.npz"
    poses = np.zeros((5, 156))
    poses[:, 0], poses[:, 3] = np.pi / 2, np.linspace(0.0, 0.5, 5)
    moves = np.linspace([0, 0, 0.9], [0, -1, 0.9], 5)
    np.savez(path, poses=poses, trans=moves, mocap_framerate=30.0, gender="neutral")
    return path


def directions(actor, time, names=None):
    """Return the directions of some limbs in the scene."""
    pose_actors([actor], time)
    skeleton = actor.figure.require_skeleton()
    matrices = actor.placement @ viewer.joint_matrices(actor.figure, actor.pose)
    joints = skeleton.humanoid.joints if names is None else {
        bone: skeleton.names.index(name) for bone, name in names.items()
    }  # fmt: skip
    ends = [(matrices[joints[a], :3, 3], matrices[joints[b], :3, 3]) for a, b in LIMBS.items()]
    away = np.array([end - start for start, end in ends])
    return away / np.linalg.norm(away, axis=1, keepdims=True)


@pytest.mark.parametrize("is_named", [False, True])
def test_captured_people_are_shown_as_the_character(capture, hero, is_named):
    plain = load(capture)
    files = [capture] if is_named else [capture, hero]
    scene = load(*files, motion=MotionSettings(model=hero if is_named else None))
    assert [actor.person for actor in scene.actors] == [0, 1]
    assert {actor.figure.name for actor in scene.actors} == {"hero"} and scene.up == "z"
    for before, after in zip(plain.actors, scene.actors, strict=True):
        for frame in (0, 3):
            time = frame / 30
            # The rest pose of the body is a T-pose to within a few degrees, for which the limbs
            # compensate.
            found = directions(after, time)
            assert_allclose(found, directions(before, time, NAMES), rtol=0, atol=1e-6)


def test_root_translation_of_a_capture_is_scaled_by_the_ratio_of_leg_lengths(capture, hero):
    actors = [load(capture).actors[0], load(capture, hero).actors[0]]
    moves = []
    for actor in actors:
        places = []
        for frame in (0, 3):
            pose_actors([actor], frame / 30)
            places.append(viewer.joint_matrices(actor.figure, actor.pose)[0, :3, 3])
        moves.append(places[1] - places[0])
    assert_allclose(moves[0][1], 0.3, rtol=0, atol=0.1)
    # One factor applies to all axes: the ratio of leg lengths.
    factor = moves[1][1] / moves[0][1]
    assert 0.5 < factor < 2.0
    assert_allclose(moves[1], factor * moves[0], rtol=0, atol=1e-9)


def test_amass_motion_drives_the_figure_of_the_model_option(amass, hero):
    (plain,) = load(amass).actors
    (found,) = load(amass, motion=MotionSettings(model=hero)).actors
    assert found.figure.name == "hero" and found.title == "walk"
    assert_allclose(directions(found, 0.1), directions(plain, 0.1, NAMES), rtol=0, atol=1e-6)


@pytest.mark.parametrize("is_named", [True, False])
def test_joint_map_applies_to_all_people_of_a_capture(capture, hero, is_named, tmp_path):
    files = [capture] if is_named else [capture, hero]
    settings = MotionSettings(model=hero if is_named else None)
    (own, _) = load(*files, motion=settings).actors
    names, arm = own.figure.skeleton.names, own.figure.skeleton.humanoid.joints["leftLowerArm"]
    chosen = JointMap(((names[arm], ""),), tmp_path / "map.txt", (1,))
    for actor in load(*files, motion=replace(settings, joint_map=chosen)).actors:
        clip, _ = driven_clip(actor.drive, actor.figure)
        assert actor.drive.motion.clip.n_rows == 4
        assert_allclose(actor.clip.rotations, clip.rotations, rtol=0, atol=1e-12)
        assert not np.ptp(clip.rotations[:, arm], axis=0).any()
    bad = replace(chosen, pairs=((names[arm], "left_elbw"),))
    with pytest.raises(RigError) as problem:
        load(*files, motion=replace(settings, joint_map=bad))
    found = problem.value.diagnostic
    assert (found.key, found.path, found.line) == ("F004.mapping-joint", bad.path, 1)


@pytest.mark.parametrize("feet", [True, False])
def test_whole_captures_are_retargeted_once_and_growing_ones_in_parts(
    capture, hero, feet, monkeypatch
):
    calls = []

    def counted(drive, figure):
        calls.append(drive.motion.clip.n_rows)
        return driven_clip(drive, figure)

    monkeypatch.setattr(capturing, "driven_clip", counted)
    settings = MotionSettings(model=hero, feet=feet)
    whole = load(capture, motion=settings).actors
    # The first frame of both people is retargeted for an early display, then all frames.
    assert calls == [1, 1, 4, 4]
    calls.clear()
    scene, (builder,) = begin(read_files([capture], settings=settings), settings)
    for part in builder.parts():
        builder.add(part)
    assert calls == [1, 1, 3, 3] + ([4, 4] if feet else [])
    for one, other in zip(whole, scene.actors, strict=True):
        same = np.abs(np.einsum("nja,nja->nj", one.clip.rotations, other.clip.rotations))
        assert_allclose(same, 1.0, rtol=0, atol=1e-9)
        assert one.clip.timing.rows.tolist() == other.clip.timing.rows.tolist() == [0, 1, 2, 3]


@pytest.mark.parametrize("is_named", [True, False])
def test_finger_joints_missing_in_the_body_are_reported_in_a_note(is_named, hero, tmp_path):
    poses = np.zeros((2, 156))
    poses[:, 66:69] = 0.3  # left_index1: the hands follow the 22 body joints
    np.savez(tmp_path / "hand.npz", poses=poses, trans=np.zeros((2, 3)), mocap_framerate=30.0)
    paths = (tmp_path / "hand.npz", *(() if is_named else (hero,)))
    scene = load(*paths, motion=MotionSettings(model=hero if is_named else None))
    assert [actor.figure.name for actor in scene.actors] == ["hero"]
    notes = [note for note in scene.diagnostics if note.key == "F007.joints-left-out"]
    assert [note.values["names"] for note in notes] == [["left_index1"]]


FINGERED = """
mixamorig:Hips 0 1 0
 mixamorig:Spine 0 0.4 0
  mixamorig:LeftArm 0.2 0.1 0
   mixamorig:LeftForeArm 0.3 0 0
    mixamorig:LeftHand 0.25 0 0
     mixamorig:LeftHandIndex1 0.1 0 0.03
      mixamorig:LeftHandIndex2 0.04 0 0
       mixamorig:LeftHandIndex3 0.03 0 0
     mixamorig:LeftHandPinky1 0.1 0 -0.03
      mixamorig:LeftHandPinky2 0.03 -0.01 0
  mixamorig:RightArm -0.2 0.1 0
   mixamorig:RightForeArm -0.3 0 0
 mixamorig:LeftUpLeg 0.1 0 0
  mixamorig:LeftLeg 0 -0.5 0
   mixamorig:LeftFoot 0 -0.4 0
 mixamorig:RightUpLeg -0.1 0 0
  mixamorig:RightLeg 0 -0.5 0
   mixamorig:RightFoot 0 -0.4 0
"""


def character_of(table: str) -> File:
    """Return a file with the joints of an indented list of names and offsets, and a small mesh."""
    file, nodes, above = File(), [], []
    for line in table.strip("\n").split("\n"):
        depth = len(line) - len(line.lstrip())
        name, *offset = line.split()
        nodes.append({"name": name, "translation": [float(value) for value in offset]})
        above = [*above[:depth], len(nodes) - 1]
        if depth:
            nodes[above[-2]].setdefault("children", []).append(len(nodes) - 1)
    joints, weights = file.accessor([[0] * 4] * 3, "B"), file.accessor([[1, 0, 0, 0]] * 3)
    mesh = file.mesh(JOINTS_0=joints, WEIGHTS_0=weights)
    file.root["nodes"] = [*nodes, {"mesh": mesh, "skin": 0}]
    file.root["skins"] = [{"joints": [*range(len(nodes))]}]
    file.root["scenes"] = [{"nodes": [0, len(nodes)]}]
    return file


RIGGED = """
pelvis 0 2 0
 spine1 0 0.4 0
  left_shoulder 0.4 0.5 0
   left_elbow 0.6 0 0
    left_wrist 0.5 0 0
  right_shoulder -0.4 0.5 0
   right_elbow -0.6 0 0
    right_wrist -0.5 0 0
 left_hip 0.2 0 0
  left_knee 0 -1 0
   left_ankle 0 -0.8 0
 right_hip -0.2 0 0
  right_knee 0 -1 0
   right_ankle 0 -0.8 0
"""


SNAKE = """
head 0 0 1
 trunk 0 0 -1
  tail 0 0 -1
"""


@pytest.mark.parametrize("is_named", [False, True])
def test_character_with_joint_names_of_a_body_model_walks_in_its_own_size(
    amass, is_named, tmp_path
):
    """Such joints have figures rigged by default, whatever their size and origin are."""
    hero = tmp_path / "hero.glb"
    hero.write_bytes(character_of(RIGGED).glb())
    settings = MotionSettings(model=hero if is_named else None, feet=False)
    (found,) = load(*([amass] if is_named else [amass, hero]), motion=settings).actors
    (plain,) = load(amass).actors
    paths, legs = [], []
    for actor in (plain, found):
        names = actor.figure.skeleton.names
        leg = [names.index(f"left_{joint}") for joint in ("hip", "knee", "ankle")]
        places = []
        for time in (0.0, 4 / 30):
            pose_actors([actor], time)
            matrices = actor.placement @ viewer.joint_matrices(actor.figure, actor.pose)
            places.append(matrices[:, :3, 3])
        legs.append(np.linalg.norm(np.diff(places[0][leg], axis=0), axis=1).sum())
        paths.append(places[1][names.index("pelvis")] - places[0][names.index("pelvis")])
    assert_allclose(legs[1], 1.8, rtol=1e-6)
    # The file moves by 1 m along -y of a world with z up.
    assert_allclose(paths[0], [0, -1, 0], rtol=0, atol=1e-9)
    forward = [0, -1, 0] if is_named else [0, 0, 1]  # the up axis of the scene
    assert_allclose(paths[1], legs[1] / legs[0] * np.array(forward), rtol=0, atol=1e-3)


@pytest.mark.parametrize("kind", ["file", "capture"])
@pytest.mark.parametrize(
    "table", [RIGGED, SNAKE, None], ids=["body names", "other names", "no joints"]
)
def test_people_opened_in_the_window_drive_the_open_character(amass, kind, table, tmp_path):
    """The bundled body replaced characters that the same files drive on the command line."""
    hero = tmp_path / ("hero.obj" if table is None else "hero.glb")
    if table is None:
        hero.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    else:
        hero.write_bytes(character_of(table).glb())
    people = amass if kind == "file" else write_frames(tmp_path / "smpl", {0: [body(0)]})
    loader = Loader([people], [[people]], lambda: None, opened=[hero])
    assert loader.wait(60.0)
    assert loader.error == ""
    (actor,) = loader.scene.actors
    assert actor.figure.name == ("hero" if table is RIGGED else "body")
    assert loader.paths == ((hero, people) if table is RIGGED else (people,))


HANDLESS = """
Hips 0 1 0
 Spine 0 0.4 0
  LeftArm 0.2 0.1 0
   LeftForeArm 0.3 0 0
    end {0} 0 {1}
  RightArm -0.2 0.1 0
   RightForeArm -0.3 0 0
    end -{0} 0 {1}
 LeftUpLeg 0.1 0 0
  LeftLeg 0 -0.5 0
   end 0 -0.4 0
 RightUpLeg -0.1 0 0
  RightLeg 0 -0.5 0
   end 0 -0.4 0
"""


def bvh_of(table: str) -> str:
    """Return a BVH file of one frame at rest of an indented list of names and offsets."""
    lines, depth, count = ["HIERARCHY"], 0, 0
    for line in table.strip("\n").split("\n"):
        deep = len(line) - len(line.lstrip())
        lines += ["}"] * (depth - deep)
        name, *offset = line.split()
        kind = "ROOT" if deep == 0 else "End Site" if name == "end" else "JOINT"
        lines.append(f"{kind} {'' if name == 'end' else name} {{ OFFSET {' '.join(offset)}")
        if name != "end":
            count += 6 if deep == 0 else 3
            place = "6 Xposition Yposition Zposition" if deep == 0 else "3"
            lines.append(f"CHANNELS {place} Zrotation Xrotation Yrotation")
        depth = deep + 1
    frames = f"MOTION\nFrames: 1\nFrame Time: 0.04\n0 1 0{' 0' * (count - 3)}\n"
    return "\n".join([*lines, "}" * depth, frames])


@pytest.mark.parametrize(("length", "is_wrist"), [(0.25, True), (0.05, False)])
def test_end_sites_of_forearms_and_shins_without_hands_and_feet_are_followed(
    tmp_path, length, is_wrist
):
    """Without a wrist, elbows kept the bend of the figure's own rest pose."""
    hero, path = tmp_path / "hero.glb", tmp_path / "a.bvh"
    hero.write_bytes(character_of(RIGGED).glb())
    # Elbows are bent forwards by atan(3 / 4).
    path.write_text(bvh_of(HANDLESS.format(0.8 * length, 0.6 * length)))
    scene = load(path, motion=MotionSettings(model=hero))
    (actor,) = scene.actors
    pose_actors([actor], 0.0)
    joints = joint_matrices(actor.figure, actor.pose)[:, :3, 3]
    places = dict(zip(actor.figure.skeleton.names, joints, strict=True))
    forearm = (places["left_wrist"] - places["left_elbow"]) / 0.5
    assert_allclose(forearm, [0.8, 0, 0.6] if is_wrist else [1, 0, 0], rtol=0, atol=1e-6)
    shin = (places["left_ankle"] - places["left_knee"]) / 0.8
    assert_allclose(shin, [0, -1, 0], rtol=0, atol=1e-6)
    (driven,) = [note for note in scene.diagnostics if note.key.startswith("F007.joints-matched")]
    # Hips, spine and four joints of the arms and legs each, with their ends.
    assert driven.values["n"] == (14 if is_wrist else 12)


@pytest.mark.parametrize("prefix", ["", "DEF-"])
def test_figure_that_has_no_hands_and_feet_either_is_driven_without_doubts(tmp_path, prefix):
    """Joints for End Sites made the figure of the same skeleton another one, with three notes."""
    hero, path = tmp_path / "hero.glb", tmp_path / "a.bvh"
    text = HANDLESS.format(0.2, 0.15)
    path.write_text(bvh_of(text))
    rows = [row for row in text.strip("\n").split("\n") if row.split()[0] != "end"]
    table = "\n".join(re.sub(r"(\w+)", rf"{prefix}\1", row, count=1) for row in rows)
    hero.write_bytes(character_of(table).glb())
    scene = load(path, motion=MotionSettings(model=hero, feet=False))
    (driven,) = [note for note in scene.diagnostics if note.key.startswith("F007.joints-matched")]
    assert driven.values["n"] == 10
    keys = {note.key.partition(":")[0] for note in scene.diagnostics}
    assert not keys & {"F007.joints-without-partner", "C018.limbs-unknown"}


@pytest.mark.parametrize("is_named", [True, False])
def test_course_clip_of_a_bare_skeleton_drives_a_figure(tmp_path, is_named):
    """The clip used to move only its own skeleton, with a note that --model has no effect."""
    hero, skel, anim = tmp_path / "hero.glb", tmp_path / "a.skel", tmp_path / "a.anim"
    hero.write_bytes(character_of(RIGGED).glb())
    # The same hierarchy in half the size, whose root moves by 1 along z and whose left thigh swings
    # by a right angle about x, both within a second.
    lines, depth = [], 0
    for line in RIGGED.strip("\n").split("\n"):
        deep = len(line) - len(line.lstrip())
        lines += ["}"] * (depth - deep)
        name, *offset = line.split()
        lines.append(f"balljoint {name} {{ offset {' '.join(f'{float(x) / 2}' for x in offset)}")
        depth = deep + 1
    skel.write_text("\n".join([*lines, "}" * depth]))
    names = [line.split()[0] for line in RIGGED.strip("\n").split("\n")]
    ends = np.zeros(3 + 3 * len(names))
    ends[2], ends[3 + 3 * names.index("left_hip")] = 1.0, -np.pi / 2
    channels = "".join(
        f"channel {{ extrapolate constant constant keys 2 {{ 0 0 linear linear 1 {end} linear "
        "linear } }\n"
        for end in ends
    )
    anim.write_text(f"animation {{ range 0 1 numchannels {len(ends)}\n{channels} }}")
    settings = MotionSettings(model=hero if is_named else None, feet=False)
    files = [skel, anim] if is_named else [skel, anim, hero]  # as of --body
    (actor,) = load(*files, motion=settings).actors
    assert actor.figure.name == "hero"
    places = []
    for time in (0.0, 1.0):
        pose_actors([actor], time)
        joints = joint_matrices(actor.figure, actor.pose)[:, :3, 3]
        places.append([joints[actor.figure.skeleton.names.index(name)] for name in names])
    start, end = (dict(zip(names, each, strict=True)) for each in places)
    assert_allclose(end["pelvis"] - start["pelvis"], [0, 0, 2], rtol=0, atol=1e-9)
    assert_allclose(start["left_knee"] - start["left_hip"], [0, -1, 0], rtol=0, atol=1e-9)
    # Rx(-90) (0, -1, 0) = (0, 0, 1)
    assert_allclose(end["left_knee"] - end["left_hip"], [0, 0, 1], rtol=0, atol=1e-9)
    beside = load(*files, motion=replace(settings, drives=False))
    assert [each.figure.name for each in beside.actors] == (["a"] if is_named else ["a", "hero"])


@pytest.mark.parametrize("is_named", [False, True])
def test_fingers_of_smplh_drive_those_of_a_character(is_named, tmp_path):
    """The bundled body has no fingers, so they used to stay at rest."""
    hero = tmp_path / "hero.glb"
    hero.write_bytes(character_of(FINGERED).glb())
    poses = np.zeros((1, 156)).reshape(1, 52, 3)
    poses[0, 22, 2] = -np.pi / 3  # left_index1 bends by 60 degrees, towards the palm
    poses[0, 29] = [0, np.pi / 2, 0]  # left_pinky2
    poses[0, 20, 0] = np.pi / 2  # left_wrist turns the palm backwards: y becomes z
    still = {"trans": np.zeros((1, 3)), "betas": np.zeros(10), "gender": "neutral"}
    np.savez(tmp_path / "a.npz", poses=poses.reshape(1, 156), mocap_framerate=30.0, **still)
    settings = MotionSettings(up="y", model=hero if is_named else None, feet=False)
    paths = [tmp_path / "a.npz"] if is_named else [tmp_path / "a.npz", hero]
    (actor,) = load(*paths, motion=settings).actors
    names = [name.split(":")[1] for name in actor.figure.skeleton.names]
    pose_actors([actor], 0.0)
    places = joint_matrices(actor.figure, actor.pose)[:, :3, 3]

    def bone(start, end):
        step = places[names.index(f"LeftHand{end}")] - places[names.index(f"LeftHand{start}")]
        return step / np.linalg.norm(step)

    # R = Rx(90) Rz(-60): x becomes (0.5, -0.866, 0), then (0.5, 0, -0.866). The tolerance is the
    # slope of the bundled body's forearm in its rest pose, 3 degrees, which the figure lacks.
    near = np.radians(3.0)
    assert_allclose(bone("Index1", "Index2"), [0.5, 0, -np.sqrt(0.75)], atol=near)
    assert_allclose(bone("Index2", "Index3"), bone("Index1", "Index2"), atol=1e-6)
    # The hand keeps its own curl: the little finger is lowered by 0.01 along 0.03 at rest.
    assert_allclose(bone("Pinky1", "Pinky2"), np.array([3, 0, -1]) / np.sqrt(10), atol=near)


def test_gravity_points_along_the_down_axis_of_the_motion(amass, hero):
    (found,) = load(amass, motion=MotionSettings(model=hero, springs=True)).actors
    skeleton = found.springs.skeleton_of(found.figure)
    assert_allclose(skeleton.springs.gravities, [[0, 0, -0.6]] * 3, rtol=0, atol=1e-12)
    (still,) = load(hero, motion=SPRINGS).actors
    assert still.springs.skeleton_of(still.figure) is still.figure.skeleton


def test_non_humanoid_model_is_refused(capture, tmp_path):
    path = tmp_path / "box.skel"
    path.write_text("balljoint root { balljoint tip { offset 0 1 0 } }")
    (tmp_path / "box.skin").write_text(
        "positions 3 { 0 0 0 1 0 0 0 1 0 } normals 3 { 0 0 1 0 0 1 0 0 1 } "
        "skinweights 3 { 1 0 1 1 0 1 1 1 1 } triangles 1 { 0 1 2 } bindings 2 { "
        "matrix { 1 0 0 0 1 0 0 0 1 0 0 0 } matrix { 1 0 0 0 1 0 0 0 1 0 1 0 } }"
    )
    out = tmp_path / "box.glb"
    assert run(["convert", str(path), str(path.with_suffix(".skin")), "-o", str(out)]) == 0
    with pytest.raises(RigError, match="--model selects the model"):
        load(capture, motion=MotionSettings(model=out))


def test_animation_of_another_figure_drives_a_character(hero, tmp_path):
    dancer = tmp_path / "dancer.vrm"
    dancer.write_bytes(swinging().glb())
    (found,) = load(hero, motion=MotionSettings(motions=(dancer,), animation="turn")).actors
    (plain,) = load(dancer).actors
    assert found.figure.name == "hero"
    for time in (0.25, 0.75):
        assert_allclose(directions(found, time), directions(plain, time), rtol=0, atol=1e-9)
    with pytest.raises(RigError, match='no animation is called "jump"'):
        load(hero, motion=MotionSettings(motions=(dancer,), animation="jump"))


def test_skeleton_with_animations_drives_a_character_opened_with_it(hero, tmp_path):
    file = swinging()
    file.root["nodes"] = file.root["nodes"][:-2]
    del file.root["meshes"], file.root["materials"], file.root["extensions"]["VRMC_springBone"]
    file.root["extensionsUsed"].remove("VRMC_materials_mtoon")
    del file.root["extensions"]["VRMC_vrm"]["expressions"]
    del file.root["extensions"]["VRMC_vrm"]["firstPerson"]
    file.root["scenes"] = [{"nodes": [0]}]
    bare = tmp_path / "bare.glb"
    bare.write_bytes(file.glb())
    (found,) = load(bare, hero).actors
    assert found.figure.name == "hero" and found.clip is not None
    assert found.drive.source_rest == "auto"
    with pytest.raises(RigError, match=r"bare\.glb: --source-rest: expected a frame from 0 to"):
        load(bare, hero, motion=MotionSettings(source_rest=999))
    beside = load(bare, hero, motion=MotionSettings(drives=False)).actors
    assert [actor.figure.name for actor in beside] == ["bare", "hero"]
    assert beside[1].clip is None


def test_file_without_motion_is_refused(hero, capsys):
    assert run(["info", str(hero)]) == 0
    capsys.readouterr()
    out = str(hero.with_suffix(".png"))
    assert run(["render", str(hero), "--motion", str(hero), "-o", out]) == 2
    said = capsys.readouterr().err
    assert "--motion: expected a motion or an animation of a skeleton, found none" in said
