"""Spring chains of VRM files, and their simulation while a motion plays."""

from pathlib import Path

import numpy as np
import pytest
from formats.gltf.files import File
from formats.vrm.swinging import HAIR, swinging
from numpy.testing import assert_allclose

import viewer
from viewer.cli import run
from viewer.loading import MotionSettings, load
from viewer.rigs.scene import Actor, pose_actors
from viewer.rigs.springs.simulation import release_springs, with_baked_springs
from viewer.rigs.springs.spring_joints import Springs

ON = MotionSettings(springs=True)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("springs")
    for version in (0, 1):
        (folder / f"ada{version}.vrm").write_bytes(swinging(version).glb())
    return folder


def springs_in(actor: Actor) -> Springs:
    springs = actor.figure.require_skeleton().springs
    assert springs is not None
    return springs


def opened(file: File, folder: Path) -> viewer.Scene:
    path = folder / "a.vrm"
    path.write_bytes(file.glb())
    return load(path)


def hair(actor: Actor, time: float) -> np.ndarray:
    """Return the positions of the hair's joints at some time."""
    pose_actors([actor], time)
    names = actor.figure.require_skeleton().names
    matrices = viewer.joint_matrices(actor.figure, actor.pose)
    return matrices[[names.index(name) for name in HAIR], :3, 3]


def test_joints_point_at_the_next_joint_of_their_chain(folder):
    actor = load(folder / "ada1.vrm").actors[0]
    skeleton, springs = actor.figure.require_skeleton(), springs_in(actor)
    assert [skeleton.names[joint] for joint in springs.joints] == [*HAIR[:3]]
    assert_allclose(springs.tails, [[0, 0, -0.1], [0, -0.12, 0], [0, -0.12, 0]])
    assert_allclose(springs.gravities, [[0, -0.6, 0]] * 3)
    assert springs.obstacles == ((0, 1),) * 3 and springs.centers.tolist() == [-1] * 3
    shapes = springs.colliders
    assert [skeleton.names[joint] for joint in shapes.joints] == ["head", "spine"]
    assert_allclose(shapes.tails, [[0, 0.05, 0], [0, 0.2, 0]])
    assert dict(actor.figure.facts)["springs"] == "1 chain, 3 joints, 2 colliders"


def test_colliders_of_two_groups_push_twice(tmp_path):
    file = swinging()
    extension = file.root["extensions"]["VRMC_springBone"]
    extension["colliderGroups"].append({"colliders": [1, 0]})
    extension["springs"][0]["colliderGroups"] = [0, 1]
    springs = springs_in(opened(file, tmp_path).actors[0])
    assert springs.obstacles == ((0, 1, 1, 0),) * 3


def test_version_0_swings_all_joints_below_a_bone(folder):
    actor = load(folder / "ada0.vrm").actors[0]
    skeleton, springs = actor.figure.require_skeleton(), springs_in(actor)
    assert [skeleton.names[joint] for joint in springs.joints] == [*HAIR]
    # The last joint points 7 cm further in its own direction.
    assert_allclose(springs.tails[-1], [0, -0.07, 0])
    # The z axis of Unity has the opposite direction.
    assert_allclose(springs.colliders.offsets, [[0, 0.05, -0.02]])


@pytest.mark.parametrize(
    ("extension", "pointer", "key"),
    [
        ({"springs": [{"joints": [{"node": 1}, {"node": 0}]}]}, "springs/0", "G006.spring"),
        ({"springs": [{"joints": [{"node": 99}]}]}, "springs/0", "G006.spring"),
        (
            {"springs": [{"joints": [{"node": 0, "dragForce": "a"}, {"node": 1}]}]},
            "springs/0",
            "G006.spring",
        ),
        ({"colliders": [{"node": 0, "shape": {}}]}, "colliders/0", "G006.collider"),
    ],
)
def test_invalid_chains_and_colliders_are_ignored_and_reported(tmp_path, extension, pointer, key):
    file = swinging()
    file.root["extensions"]["VRMC_springBone"] = extension
    scene = opened(file, tmp_path)
    assert scene.actors[0].figure.require_skeleton().springs is None
    (found,) = [each for each in scene.diagnostics if each.key.startswith("G006")]
    assert (found.key, found.pointer) == (key, f"/extensions/VRMC_springBone/{pointer}")


@pytest.mark.parametrize("version", [0, 1])
def test_hair_lags_behind_the_head_and_keeps_its_length(folder, version):
    still = load(folder / f"ada{version}.vrm").actors[0]
    actor = load(folder / f"ada{version}.vrm", motion=ON).actors[0]
    assert still.springs is None and actor.springs is not None
    stiff, loose = hair(still, 0.5), hair(actor, 0.5)
    assert np.linalg.norm(loose - stiff, axis=1).max() > 0.01
    lengths = [np.linalg.norm(np.diff(points, axis=0), axis=1) for points in (stiff, loose)]
    assert_allclose(lengths[1], lengths[0], rtol=0, atol=1e-12)


def test_result_depends_only_on_the_time(folder):
    played = load(folder / "ada1.vrm", motion=ON).actors[0]
    for step in range(60):
        hair(played, step / 60 * 1.2)
    scrubbed = load(folder / "ada1.vrm", motion=ON).actors[0]
    last = hair(scrubbed, 1.4)
    for time in (0.7, 1.18, 0.0, 1.4):
        assert np.array_equal(hair(played, time), hair(scrubbed, time))
    assert np.array_equal(hair(scrubbed, 1.4), last)


def test_actors_posed_together_swing_as_if_posed_alone(folder):
    actors = [load(folder / "ada1.vrm", motion=ON).actors[0]]
    actors.append(actors[0].copy())
    actors[1].offset = 0.25
    pose_actors(actors, 0.75)
    found = [viewer.joint_matrices(each.figure, each.pose)[-1] for each in actors]
    for actor, matrix, time in zip(actors, found, (0.75, 0.75), strict=True):
        hair(actor, time)
        again = viewer.joint_matrices(actor.figure, actor.pose)[-1]
        assert_allclose(matrix, again, rtol=0, atol=1e-12)


def test_released_springs_are_at_rest(folder):
    actor = load(folder / "ada1.vrm", motion=ON).actors[0]
    hair(actor, 0.5)
    actor.springs = None
    release_springs(actor)
    still = load(folder / "ada1.vrm").actors[0]
    assert_allclose(hair(actor, 0.5), hair(still, 0.5), rtol=0, atol=1e-12)


def test_baked_frames_contain_the_simulation(folder):
    actor = load(folder / "ada1.vrm", motion=ON).actors[0]
    wanted = [hair(actor, frame / 30) for frame in (0, 7, 20)]
    actor.clip, actor.springs = with_baked_springs(actor, 30.0), None
    for frame, points in zip((0, 7, 20), wanted, strict=True):
        assert_allclose(hair(actor, frame / 30), points, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("shape", "kind", "tail", "radius"),
    [
        ({"sphere": {"offset": [1, 2, 3], "radius": 0.5, "inside": True}}, 1, [1, 2, 3], 0.5),
        ({"capsule": {"offset": [1, 2, 3], "tail": [4, 5, 6], "radius": 1}}, 0, [4, 5, 6], 1.0),
        ({"plane": {"offset": [1, 2, 3], "normal": [0, 1, 0]}}, 2, [1, 3, 3], 0.0),
        ({"plane": {"offset": [1, 2, 3]}}, 2, [1, 2, 4], 0.0),
    ],
)
def test_extended_colliders_replace_the_shape(tmp_path, shape, kind, tail, radius):
    file, name = swinging(1), "VRMC_springBone_extended_collider"
    (first, *_) = file.root["extensions"]["VRMC_springBone"]["colliders"]
    first["extensions"] = {name: {"specVersion": "1.0", "shape": shape}}
    file.root["extensionsUsed"] = [*file.root.get("extensionsUsed", []), name]
    path, out = tmp_path / "a.vrm", tmp_path / "b.vrm"
    path.write_bytes(file.glb())
    assert run(["convert", str(path), "-o", str(out)]) == 0
    for each in (path, out):  # the extension is kept when it is written
        scene = viewer.load(each)
        shapes = springs_in(scene.actors[0]).colliders
        assert shapes.kinds[0] == kind and shapes.radii[0] == radius
        assert_allclose([shapes.offsets[0], shapes.tails[0]], [[1, 2, 3], tail], atol=1e-12)
        assert not [found for found in scene.diagnostics if name in found.message]
