"""Motions of humanoids in ``.vrma`` files, alone and on a character."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formats.gltf.files import File
from numpy.testing import assert_allclose

import viewer
from viewer.errors import FormatError
from viewer.rig.motion.evaluation import pose_actor
from viewer.rig.skinning import joint_matrices

BONES = ("hips", "spine", "head", "leftUpperArm", "leftLowerArm", "rightUpperArm")
PARENTS = (-1, 0, 1, 1, 3, 1)
PLACES = ((0, 1, 0), (0, 0.3, 0), (0, 0.3, 0), (0.2, 0.2, 0), (0.3, 0, 0), (-0.2, 0.2, 0))
HALF = np.sqrt(0.5)
ABOUT_X, ABOUT_Y, ABOUT_Z = [HALF, 0, 0, HALF], [0, HALF, 0, HALF], [0, 0, HALF, HALF]


def humanoid(extension: str, prefix: str, scale: float = 1.0, **more: Any) -> File:
    """Return a person in a T-pose, its bones as nodes 0 to 5."""
    bones = {bone: {"node": node} for node, bone in enumerate(BONES)}
    told = {"specVersion": "1.0", "humanoid": {"humanBones": bones}, **more}
    file = File(extensionsUsed=[extension], extensions={extension: told})
    for node, place in enumerate(PLACES):
        children = [child for child, parent in enumerate(PARENTS) if parent == node]
        item: dict[str, Any] = {"name": f"{prefix}{node}"}
        item["translation"] = [scale * part for part in place]
        file.add("nodes", item | ({"children": children} if children else {}))
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


def character() -> File:
    """Return a character of half the size; its upper arm has other axes at rest."""
    binds = [{"node": 6, "index": 0, "weight": 1.0}]
    expressions = {"preset": {"happy": {"morphTargetBinds": binds}}}
    file = humanoid("VRMC_vrm", "c", 0.5, expressions=expressions)
    file.root["nodes"][3]["rotation"] = ABOUT_X
    mesh = file.mesh()
    file.primitive["targets"] = [{"POSITION": file.accessor([[1, 0, 0]] * 3)}]
    file.add("nodes", {"name": "face", "mesh": mesh})
    file.root["nodes"][2]["children"] = [6]
    return file


def written(folder: Path, name: str, file: File) -> Path:
    path = folder / name
    path.write_bytes(file.glb())
    return path


def test_a_motion_opened_alone_is_a_skeleton(tmp_path: Path) -> None:
    scene = viewer.load(written(tmp_path, "wave.vrma", motion()))
    (actor,) = scene.actors
    skeleton = actor.figure.require_skeleton()
    assert skeleton.names == ("m0", "m1", "m2", "m3", "m5", "m4")
    assert actor.clip is not None and (actor.clip.start, actor.clip.end) == (0.0, 1.0)
    pose_actor(actor, 1.0)
    arm = joint_matrices(actor.figure, actor.require_pose())[skeleton.names.index("m4"), :3, 3]
    # 0.4 along x; the chain 0, 0.5, 0 is vertical; 0.2 along x points backwards.
    assert_allclose(arm, [0.4, 1.5 + 0.3, -0.2], atol=1e-6)


def test_a_character_plays_a_motion_with_facial_expressions(tmp_path: Path) -> None:
    paths = (written(tmp_path, "a.vrm", character()), written(tmp_path, "wave.vrma", motion()))
    scene = viewer.load(*paths)
    (actor,) = scene.actors
    figure = actor.figure
    assert figure.blend_shapes is not None
    for time, weight in ((0.25, 0.5), (1.0, 1.0)):
        pose_actor(actor, time)
        pose = actor.require_pose()
        column = figure.blend_shapes.names.index("happy")
        # Weights above 1 are clamped; the keys are sampled at 30 frames per second.
        assert_allclose(pose.shape_weights[column], weight, atol=0.02)
    worlds = joint_matrices(figure, actor.require_pose())
    names = figure.require_skeleton().names
    arm, below = (worlds[names.index(name)] for name in ("c3", "c4"))
    # Hips and arm, then the rest pose: Ry Rz Rx, each by 90 degrees.
    turn = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]) @ [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    quarter = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    assert_allclose(arm[:3, :3], turn @ quarter, atol=1e-6)
    # The lower arm is above the upper arm now; half the size, so half the way.
    assert_allclose(below[:3, 3] - arm[:3, 3], turn @ quarter @ [0.15, 0, 0], atol=1e-6)
    assert_allclose(worlds[names.index("c0"), :3, 3], [0.2, 0.5, 0.0], atol=1e-6)


def test_motions_without_bones_or_keys_are_refused(tmp_path: Path) -> None:
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
