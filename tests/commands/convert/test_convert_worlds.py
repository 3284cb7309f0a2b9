"""Round trips of upside-down captures through ``viewer convert``."""

import json

import numpy as np
import pytest
from formats.capture_files import body, write_frames
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose

import viewer
from viewer.cli import run
from viewer.rig.geometry.rotation import matrix_to_rotation_vector, rotation_vector_to_matrix

OVER = np.diag([1.0, -1.0, -1.0])


@pytest.fixture
def smpl(tmp_path):
    path = tmp_path / "SMPL.npz"
    np.savez(path, **model("smpl"))
    return path


@pytest.fixture
def hanging(tmp_path):
    """Bodies upright along y that are explicitly rotated upside down."""
    frames = {}
    for frame in range(3):
        record = body(0, seed=0.01 * frame)
        turn = rotation_vector_to_matrix(np.array(record["Rh"][0]))
        record["Rh"] = [matrix_to_rotation_vector(OVER @ turn).tolist()]
        record["Th"] = [(OVER @ np.array(record["Th"][0])).tolist()]
        frames[frame] = [record]
    write_frames(tmp_path / "take" / "smpl", frames)
    return tmp_path / "take"


def records(folder):
    return [json.loads(path.read_text())[0] for path in sorted((folder / "smpl").iterdir())]


def convert(*arguments):
    assert run(["convert", *map(str, arguments)]) == 0


def test_upside_down_world_is_reported_when_detected(hanging, smpl):
    scene = viewer.load(smpl, hanging)
    told = (
        f"{hanging}: -y up, estimated from the poses: the capture is upside down and is rotated "
        "upright; --up overrides it"
    )
    assert told in scene.warnings
    assert scene.up == "y"
    assert_allclose(scene.actors[0].placement[:3, :3], OVER, atol=1e-12)


def test_easymocap_round_trips_its_values(hanging, smpl, tmp_path, capsys):
    convert(hanging, "--model", smpl, "-o", tmp_path / "back")
    assert ", -y up; " in capsys.readouterr().out
    for found, wanted in zip(records(tmp_path / "back"), records(hanging), strict=True):
        for key in ("Rh", "Th"):
            assert_allclose(found[key], wanted[key], atol=1e-9)


def test_amass_keeps_the_capture_values_and_round_trips(hanging, smpl, tmp_path):
    convert(hanging, "--model", smpl, "-o", tmp_path / "m.npz")
    (path,) = tmp_path.glob("m*.npz")
    first = viewer.load(smpl, hanging)
    with np.load(smpl) as arrays:  # J0 of the shaped body, from the arrays of the model
        shape = first.actors[0].pose.shape_weights
        vertices = arrays["v_template"] + arrays["shapedirs"][:, :, : len(shape)] @ shape
        regressor = arrays["J_regressor"]
        root = (regressor @ vertices)[0]
    with np.load(path) as arrays:
        assert str(arrays["up"]) == "-y"
        for record, trans in zip(records(hanging), arrays["trans"], strict=True):
            turn = rotation_vector_to_matrix(np.array(record["Rh"][0]))
            # The specification: transl = T + R J0 - J0.
            assert_allclose(trans, np.array(record["Th"][0]) + turn @ root - root, atol=1e-6)
    second = viewer.load(smpl, path)
    for one, other in zip(first.actors, second.actors, strict=True):
        assert_allclose(
            viewer.deform(one.figure, one.pose)[0], viewer.deform(other.figure, other.pose)[0],
            atol=1e-6,
        )  # fmt: skip
        assert_allclose(one.placement, other.placement, atol=1e-12)


def test_amass_with_a_different_requested_up_axis_is_upright(hanging, smpl, tmp_path):
    convert(hanging, "--model", smpl, "-o", tmp_path / "m.npz", "--to-up", "y")
    (path,) = tmp_path.glob("m*.npz")
    scene = viewer.load(smpl, path)
    assert scene.up == "y" and scene.warnings == ()
    names = scene.actors[0].figure.skeleton.names
    joints = viewer.joint_matrices(scene.actors[0].figure, scene.actors[0].pose)[:, 1, 3]
    assert joints[names.index("head")] > joints[names.index("pelvis")]


def test_up_axis_is_inferred_from_the_people_if_not_recorded(smpl, tmp_path):
    # A rotation by 90 degrees about x maps the model's up axis y to z.
    poses = np.zeros((4, 72))
    poses[:, 0] = np.pi / 2
    np.savez(tmp_path / "m.npz", poses=poses, trans=np.zeros((4, 3)), fps=np.array(25))
    scene = viewer.load(smpl, tmp_path / "m.npz")
    assert scene.up == "z"
    told = f"{tmp_path / 'm.npz'}: z up, estimated from the poses; --up overrides it"
    assert told in scene.warnings
