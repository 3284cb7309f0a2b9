"""Motions of humanoids as VRM animations that are read back onto a character."""

from pathlib import Path

import numpy as np
import pytest
from exporters.vrm.test_vrm_export import Written
from exporting import export_frames
from formats.vrm.swinging import BONES, swinging
from numpy.testing import assert_allclose

import viewer
from viewer.cli import run
from viewer.diagnostics import Diagnostic
from viewer.exporters import ExportOptions
from viewer.loading import MotionSettings, load
from viewer.rigs.motion.sampled_animation import single_frame
from viewer.rigs.scene import Actor, pose_actors

LIMBS = (("leftUpperArm", "leftLowerArm"), ("rightUpperLeg", "rightLowerLeg"), ("hips", "head"))
TO_Y = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # (x, y, z) -> (x, z, -y)


def joints(actor: Actor, time: float) -> dict[str, np.ndarray]:
    pose_actors([actor], time)
    matrices = viewer.joint_matrices(actor.figure, actor.pose)
    humanoid = actor.figure.require_skeleton().humanoid
    return {bone: matrices[joint, :3, 3] for bone, joint in humanoid.joints.items()}


def directions(actor: Actor, time: float) -> np.ndarray:
    places = joints(actor, time)
    away = np.array([places[end] - places[start] for start, end in LIMBS])
    return away / np.linalg.norm(away, axis=1, keepdims=True)


@pytest.mark.parametrize("version", [0, 1])
def test_character_moves_as_before_the_round_trip(tmp_path, version):
    path, still, out = (tmp_path / name for name in ("ada.vrm", "still.vrm", "out.vrma"))
    path.write_bytes(swinging(version).glb())
    still.write_bytes(swinging(turn=False).glb())
    assert run(["convert", str(path), "-o", str(out)]) == 0
    (plain,), (found,) = load(path).actors, load(out, still).actors
    # Version 0.x faces -z and version 1.0 +z, so the character is rotated by 180 degrees.
    facing = np.diag([1.0, 1.0, 1.0] if version else [-1.0, 1.0, -1.0])
    for time in (0.5, 1.0):
        before, after = joints(plain, time), joints(found, time)
        for bone in ("leftHand", "rightFoot", "head", "hips"):
            # The file has single precision.
            assert_allclose(after[bone], facing @ before[bone], rtol=0, atol=1e-6)


def test_motions_of_worlds_with_z_up_are_rotated(tmp_path):
    amass, hero, out = (tmp_path / name for name in ("walk.npz", "hero.vrm", "out.vrma"))
    poses = np.zeros((4, 156))
    poses[:, 0], poses[:, 3], poses[:, 50] = np.pi / 2, np.linspace(0.0, 0.6, 4), -1.0
    moves = np.linspace([0, 0, 0.9], [0.1, -1, 0.9], 4)
    np.savez(amass, poses=poses, trans=moves, mocap_framerate=30.0, gender="neutral")
    hero.write_bytes(swinging(turn=False).glb())
    assert run(["convert", str(amass), "--model", str(hero), "-o", str(out)]) == 0
    (plain,) = load(amass, motion=MotionSettings(model=hero)).actors
    (found,) = load(out, hero).actors
    for time in (0.0, 0.1):
        assert_allclose(
            directions(found, time), directions(plain, time) @ TO_Y.T, rtol=0, atol=1e-6
        )
    steps = [joints(each, 0.1)["hips"] - joints(each, 0.0)["hips"] for each in (plain, found)]
    assert_allclose(steps[1], TO_Y @ steps[0], rtol=0, atol=1e-6)


def test_expressions_of_version_0_are_written_as_their_presets(tmp_path):
    file, path, out = swinging(0), tmp_path / "ada.vrm", tmp_path / "out.vrma"
    groups = file.root["extensions"]["VRM"]["blendShapeMaster"]["blendShapeGroups"]
    groups[0] |= {"name": "Smile", "presetName": "joy"}
    path.write_bytes(file.glb())
    assert run(["convert", str(path), "--shape", "Smile=0.5", "-o", str(out)]) == 0
    told = Written(out).root["extensions"]["VRMC_vrm_animation"]["expressions"]
    assert {kind: [*names] for kind, names in told.items()} == {"preset": ["happy"]}


@pytest.mark.parametrize("scale", [[0.0, 0.0, 0.0], [1.0, 0.0, 1.0]])
def test_hidden_joints_have_the_rotations_of_shown_ones(tmp_path, scale):
    outs = []
    for name in ("shown", "hidden"):
        file, path = swinging(), tmp_path / f"{name}.vrm"
        if name == "hidden":
            file.root["nodes"][BONES.index("leftHand")]["scale"] = scale
        path.write_bytes(file.glb())
        outs.append(path.with_suffix(".vrma"))
        assert run(["convert", str(path), "-o", str(outs[-1])]) == 0
    shown, hidden = (Written(out).binary for out in outs)
    assert shown == hidden


def test_expressions_are_written_and_other_figures_refused(tmp_path, capsys):
    path, out = tmp_path / "ada.vrm", tmp_path / "out.vrma"
    path.write_bytes(swinging().glb())
    assert run(["convert", str(path), "--shape", "happy=0.5", "-o", str(out)]) == 0
    assert "17 human bones, 1 expression, 46 frames" in capsys.readouterr().out
    (found,) = load(out, path).actors
    pose_actors([found], 0.5)
    names = found.figure.blend_shapes.names
    assert_allclose(found.pose.shape_weights[names.index("happy")], 0.5, rtol=0, atol=1e-6)
    assert run(["convert", "-o", str(tmp_path / "fox.vrma")]) == 2
    assert "required human bones not found" in capsys.readouterr().err


def test_scale_that_the_format_cannot_hold_is_reported(tmp_path):
    """The hips are written where they are; all other bones keep their distances from the hips."""
    hero, out = tmp_path / "hero.vrm", tmp_path / "out.vrma"
    hero.write_bytes(swinging().glb())
    actor = load(hero).actors[0]
    assert not any(note.code == "X002" for note in _exported(actor, out))
    actor.pose.figure_scale = 2.0
    (note,) = (note for note in _exported(actor, out) if note.code == "X002")
    places = viewer.joint_matrices(actor.figure, viewer.rest_pose(actor.figure.skeleton))[:, :3, 3]
    own = dict(actor.figure.skeleton.humanoid.joints)
    farthest = max(np.linalg.norm(places[joint] - places[own["hips"]]) for joint in own.values())
    assert note.values["joint"].values["distance"] == pytest.approx(farthest, rel=1e-5)


def _exported(actor: Actor, path: Path) -> list[Diagnostic]:
    return export_frames(single_frame(actor), path, "vrma", ExportOptions())
