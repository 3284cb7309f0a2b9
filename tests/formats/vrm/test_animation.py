"""Motions of humanoids in ``.vrma`` files, alone and on a character."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formats.gltf.files import File, source_of
from numpy.testing import assert_allclose

import viewer
from viewer.cli import run
from viewer.errors import FormatError
from viewer.formats.gltf import read
from viewer.loading import MotionSettings, load
from viewer.loading.body_models import is_body
from viewer.rigs.constraints.constraint import Constraint
from viewer.rigs.scene import pose_actors
from viewer.rigs.skinning import deform, joint_matrices

BONES = ("hips", "spine", "head", "leftUpperArm", "leftLowerArm", "rightUpperArm")
PARENTS = (-1, 0, 1, 1, 3, 1)
PLACES = ((0, 1, 0), (0, 0.3, 0), (0, 0.3, 0), (0.2, 0.2, 0), (0.3, 0, 0), (-0.2, 0.2, 0))
HALF = np.sqrt(0.5)
ABOUT_X, ABOUT_Y, ABOUT_Z = [HALF, 0, 0, HALF], [0, HALF, 0, HALF], [0, 0, HALF, HALF]


def humanoid(extension: str, prefix: str, scale: float = 1.0, **more: Any) -> File:
    """Return a person in a T-pose with bones as nodes 0 to 5."""
    bones = {bone: {"node": node} for node, bone in enumerate(BONES)}
    told = {"specVersion": "1.0", "humanoid": {"humanBones": bones}, **more}
    file = File(extensionsUsed=[extension], extensions={extension: told})
    for node, place in enumerate(PLACES):
        children = [child for child, parent in enumerate(PARENTS) if parent == node]
        item: dict[str, Any] = {"name": f"{prefix}{node}"}
        item["translation"] = [scale * part for part in place]
        file.add("nodes", item | ({"children": children} if children else {}))
    return file


def character() -> File:
    """Return a character of half the size, with different rest axes of the upper arm."""
    binds = [{"node": 6, "index": 0, "weight": 1.0}]
    expressions = {"preset": {"happy": {"morphTargetBinds": binds}}}
    file = humanoid("VRMC_vrm", "c", 0.5, expressions=expressions)
    file.root["nodes"][3]["rotation"] = ABOUT_X
    mesh = file.mesh()
    file.primitive["targets"] = [{"POSITION": file.accessor([[1, 0, 0]] * 3)}]
    file.add("nodes", {"name": "face", "mesh": mesh})
    file.root["nodes"][2]["children"] = [6]
    return file


def motion(**more: Any) -> File:
    """Return a motion of one second: hips and left arm rotate by 90 degrees; the face moves."""
    expressions = {"preset": {"happy": {"node": 6}}}
    file = humanoid("VRMC_vrm_animation", "m", expressions=expressions, **more)
    file.add("nodes", {"name": "happy"})
    still = [0, 0, 0, 1]
    rows = [
        (0, "rotation", [still, ABOUT_Y]),
        (0, "translation", [[0, 1, 0], [0.4, 1, 0]]),
        (3, "rotation", [still, ABOUT_Z]),
        (6, "translation", [[0, 0, 0], [2, 0, 0]]),
    ]
    times = file.times([0.0, 1.0])
    channels, samplers = [], []
    for index, (node, path, values) in enumerate(rows):
        channels.append({"sampler": index, "target": {"node": node, "path": path}})
        samplers.append({"input": times, "output": file.accessor(values)})
    file.add("animations", {"name": "wave", "channels": channels, "samplers": samplers})
    return file


def written(folder: Path, name: str, file: File) -> Path:
    path = folder / name
    path.write_bytes(file.glb())
    return path


def test_motion_opened_alone_is_shown_as_a_skeleton(tmp_path):
    scene = viewer.load(written(tmp_path, "wave.vrma", motion()))
    (actor,) = scene.actors
    skeleton = actor.figure.require_skeleton()
    assert skeleton.names == ("m0", "m1", "m2", "m3", "m5", "m4")
    assert actor.clip is not None and (actor.clip.start, actor.clip.end) == (0.0, 1.0)
    pose_actors([actor], 1.0)
    arm = joint_matrices(actor.figure, actor.pose)[skeleton.names.index("m4"), :3, 3]
    # The limb of 0.4 is along x, the chain of 0, 0.5, 0 is vertical, and the 0.2 along x points
    # backwards.
    assert_allclose(arm, [0.4, 1.5 + 0.3, -0.2], atol=1e-6)


def test_character_plays_a_motion_with_facial_expressions(tmp_path):
    paths = (written(tmp_path, "a.vrm", character()), written(tmp_path, "wave.vrma", motion()))
    scene = viewer.load(*paths)
    (actor,) = scene.actors
    figure = actor.figure
    assert figure.blend_shapes is not None
    for time, weight in ((0.25, 0.5), (1.0, 1.0)):
        pose_actors([actor], time)
        pose = actor.pose
        column = figure.blend_shapes.names.index("happy")
        # Weights above 1 are clamped; the keys are sampled at 30 frames per second.
        assert_allclose(pose.shape_weights[column], weight, atol=0.02)
    worlds = joint_matrices(figure, actor.pose)
    names = figure.require_skeleton().names
    arm, below = (worlds[names.index(name)] for name in ("c3", "c4"))
    # Rotations of hips and arm, then of the rest pose: Ry Rz Rx, each by 90 degrees.
    turn = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]) @ [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    quarter = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    assert_allclose(arm[:3, :3], turn @ quarter, atol=1e-6)
    # The lower arm is now above the upper arm, at half the distance because of half the size.
    assert_allclose(below[:3, 3] - arm[:3, 3], turn @ quarter @ [0.15, 0, 0], atol=1e-6)
    assert_allclose(worlds[names.index("c0"), :3, 3], [0.2, 0.5, 0.0], atol=1e-6)


def test_captured_body_drives_a_character(tmp_path):
    poses = np.random.default_rng(2).uniform(-0.3, 0.3, (3, 156))
    path = tmp_path / "walk.npz"
    still = {"trans": np.zeros((3, 3)), "betas": np.zeros(10), "gender": "neutral"}
    np.savez(path, poses=poses, mocap_framerate=30.0, **still)
    hero, up = written(tmp_path, "a.vrm", character()), MotionSettings(up="y")
    (driven,) = viewer.load(path, hero, motion=up).actors
    (body,) = viewer.load(path, motion=up).actors
    beside = viewer.load(path, hero, motion=MotionSettings(up="y", drives=False))
    assert [actor.clip is None for actor in beside.actors] == [True, False]
    for time in (0.0, 2 / 30):
        ways = []
        for actor, pair in ((driven, ("c3", "c4")), (body, ("left_shoulder", "left_elbow"))):
            pose_actors([actor], time)
            names = actor.figure.require_skeleton().names
            places = joint_matrices(actor.figure, actor.pose)[:, :3, 3]
            way = places[names.index(pair[1])] - places[names.index(pair[0])]
            ways.append(way / np.linalg.norm(way))
        assert_allclose(ways[0], ways[1], atol=1e-9)


@pytest.mark.parametrize("is_family", [True, False])
def test_characters_with_the_root_of_a_body_model_are_driven(tmp_path, is_family):
    """Unreal's characters have the root pelvis, as bodies of the SMPL family have."""
    # The joints of characters rigged by default even have the names of all joints of the family.
    prefix = "{side}_{bone}" if is_family else "{bone}_{side}"
    sides, legs = ("left", "right") if is_family else ("l", "r"), ("hip", "knee", "ankle")
    bones = legs if is_family else ("thigh", "calf", "foot")
    file, nodes = File(), [{"name": "pelvis", "children": [1, 4], "translation": [0, 1, 0]}]
    for first, side in zip((1, 4), sides, strict=True):
        for index, bone in enumerate(bones):
            name = prefix.format(side=side, bone=bone)
            below = {"children": [first + index + 1]} if index < 2 else {}
            place = [0.1 if first == 1 else -0.1, 0, 0] if index == 0 else [0, -0.4, 0]
            nodes.append({"name": name, "translation": place, **below})
    joints, weights = file.accessor([[0] * 4] * 3, "B"), file.accessor([[1, 0, 0, 0]] * 3)
    mesh = file.mesh(JOINTS_0=joints, WEIGHTS_0=weights)
    file.root["nodes"] = [*nodes, {"mesh": mesh, "skin": 0}]
    file.root["skins"] = [{"joints": [*range(7)]}]
    (actor,) = viewer.load(written(tmp_path, "a.glb", file)).actors
    assert not is_body(actor.figure)


def test_model_option_accepts_a_character_file(tmp_path):
    settings = MotionSettings(model=written(tmp_path, "a.vrm", character()))
    (actor,) = viewer.load(written(tmp_path, "wave.vrma", motion()), motion=settings).actors
    assert actor.figure.mesh is not None and actor.clip is not None


def test_motions_without_bones_or_keys_are_refused(tmp_path):
    empty = motion()
    del empty.root["animations"]
    bare = motion(humanoid={})
    for name, file, key in (
        ("empty.vrma", empty, "F002.vrma-animation"),
        ("bare.vrma", bare, "F002.vrma-bones"),
    ):
        with pytest.raises(FormatError) as caught:
            viewer.load(written(tmp_path, name, file))
        assert caught.value.diagnostic.key == key


NAME = "VRMC_node_constraint"
AT = f"/extensions/{NAME}"


def file_of(*constraints: dict[str, Any] | None) -> File:
    """Return a file with a chain of nodes, each with or without a constraint."""
    file = File(extensionsUsed=[NAME])
    for node, constraint in enumerate(constraints):
        item: dict[str, Any] = {"name": f"n{node}"}
        if node + 1 < len(constraints):
            item["children"] = [node + 1]
        if constraint is not None:
            item["extensions"] = {NAME: {"specVersion": "1.0", "constraint": constraint}}
        file.add("nodes", item)
    return file


def test_constraints_are_read_in_the_order_of_evaluation():
    source = source_of(
        file_of(
            None,
            {"rotation": {"source": 2, "weight": 0.25}},
            {"roll": {"source": 0, "rollAxis": "Y"}},
            {"aim": {"source": 0, "aimAxis": "NegativeX"}},
        )
    )
    skeleton = read(source).figures[0].require_skeleton()
    assert skeleton.constraints == (
        Constraint(2, 0, "roll", (0.0, 1.0, 0.0)),
        Constraint(1, 2, "rotation", weight=0.25),
        # The position of the source depends on its ancestors.
        Constraint(3, 0, "aim", (-1.0, 0.0, 0.0)),
    )
    assert not source.diagnostics
    # Sliders of constrained joints would have no effect.
    assert skeleton.dof_joints[skeleton.locked].tolist() == [1, 1, 1, 2, 2, 2, 3, 3, 3]


@pytest.mark.parametrize(
    "constraints",
    [
        (None, {"rotation": {"source": 2}}, {"rotation": {"source": 1}}),
        # The position of the source depends on the joint that aims at it.
        (None, {"aim": {"source": 2, "aimAxis": "PositiveX"}}, None),
    ],
)
def test_cycles_are_refused(constraints):
    with pytest.raises(FormatError) as caught:
        read(source_of(file_of(*constraints)))
    assert caught.value.diagnostic.key == "F002.constraint-cycle"
    assert caught.value.diagnostic.pointer == f"/nodes/1{AT}"


@pytest.mark.parametrize(
    ("constraint", "expected"),
    [
        ({}, "one of roll, aim and rotation"),
        ({"rotation": {"source": 1}}, "the index of another node as source"),
        ({"rotation": {"source": 9}}, "the index of another node as source"),
        ({"roll": {"source": 0, "rollAxis": "W"}}, "rollAxis X, Y, Z"),
        ({"rotation": {"source": 0, "weight": "1"}}, "a weight from 0 to 1"),
        ({"rotation": {"source": 0, "weight": 10**400}}, "a weight from 0 to 1"),
    ],
)
def test_invalid_constraints_are_ignored(constraint, expected):
    source = source_of(file_of(None, constraint))
    assert read(source).figures[0].require_skeleton().constraints == ()
    found = next(iter(source.diagnostics))
    assert (found.key, found.pointer) == ("G006.constraint", f"/nodes/1{AT}/constraint")
    assert found.values["expected"] == expected


def test_exported_poses_include_the_effect_of_constraints(tmp_path):
    file = file_of(None, {"rotation": {"source": 0}}, None)
    file.root["nodes"][2]["mesh"] = file.mesh()
    half = math.sqrt(0.5)
    file.root["nodes"][0]["rotation"] = [0.0, 0.0, half, half]
    still, turned = [0.0, 0.0, half, half], [0.0, 0.0, 1.0, 0.0]
    samplers = [{"input": file.times([0.0, 1.0]), "output": file.accessor([still, turned])}]
    channels = [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}]
    file.add("animations", {"name": "wave", "channels": channels, "samplers": samplers})
    path, again = tmp_path / "hero.glb", tmp_path / "again.glb"
    path.write_bytes(file.glb())
    assert run(["convert", str(path), "-o", str(again)]) == 0
    for name in (path, again):
        (actor,) = load(name).actors
        pose_actors([actor], 1.0)
        corners = deform(actor.figure, actor.pose)[0]
        # The parent rotates to 180 degrees, and the joint by its 90 degrees relative to the rest
        # pose.
        assert_allclose(corners, [[0, 0, 0], [0, -1, 0], [1, 0, 0]], atol=1e-6)
