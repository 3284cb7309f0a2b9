"""Single poses of captures as files, with y up in glTF and a recorded up axis in other formats."""

import json

import numpy as np
import pytest
from export.plain_gltf import Gltf
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose

import viewer
from viewer.cli import run
from viewer.loading import MotionSettings
from viewer.rig.motion.evaluation import pose_actors
from viewer.rig.skinning import Skinning, deform

TO_Y = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # (x, y, z) -> (x, z, -y)
OVER = np.diag([1.0, -1.0, -1.0])


@pytest.fixture
def recording(tmp_path):
    """A model with y up, and a folder of two frames of a person upright along z."""
    path = tmp_path / "SMPL.npz"
    np.savez(path, **model("smpl"))
    folder = tmp_path / "take" / "smpl"
    folder.mkdir(parents=True)
    for frame in range(2):
        poses = np.zeros(72)
        poses[12] = 0.1 * frame
        record = {"id": 0, "Rh": [[np.pi / 2, 0, 0]], "Th": [[1.0, 2.0, 3.0 + frame]]}
        record |= {"poses": [poses.tolist()], "shapes": [[0.5] + [0.0] * 9]}
        (folder / f"{frame:06}.json").write_text(json.dumps([record]))
    return tmp_path / "take", path


def wanted(recording, up="z"):
    """Return the vertices in the world of the capture, without correctives."""
    folder, path = recording
    settings = MotionSettings(model=path, up=up)
    (actor,) = viewer.load(folder, motion=settings).actors
    pose_actors([actor], 1 / 30)
    return deform(actor.figure, actor.pose, Skinning(correctives=False))[0]


def convert(recording, out, *options):
    folder, path = recording
    files = [str(folder), "--model", str(path), "-o", str(out), "--frame", "1", *options]
    assert run(["convert", *files]) == 0


@pytest.mark.parametrize(("up", "turn"), [("z", TO_Y), ("y", np.eye(3)), ("-y", OVER)])
def test_gltf_of_one_frame_has_y_up(recording, tmp_path, up, turn):
    out = tmp_path / "pose.glb"
    convert(recording, out, f"--up={up}")
    gltf = Gltf(out)
    found = gltf.vertices()[0]
    assert_allclose(found, wanted(recording, up) @ turn.T, rtol=0, atol=1e-5)


def test_standing_people_are_upright_in_gltf(recording, tmp_path):
    convert(recording, tmp_path / "pose.glb")  # z is detected as the up axis
    gltf = Gltf(tmp_path / "pose.glb")
    world = gltf.world()
    head, pelvis = (world[gltf.named(name), :3, 3] for name in ("head", "pelvis"))
    rest = viewer.load(recording[1]).actors[0]
    joints = viewer.joint_matrices(rest.figure, rest.pose)[:, :3, 3]
    names = rest.figure.skeleton.names
    height = (joints[names.index("head")] - joints[names.index("pelvis")])[1]
    assert (head - pelvis)[1] == pytest.approx(height, rel=0.2)
    assert gltf.nodes[gltf.top(gltf.named("head"))]["name"] == "z up"


def test_other_formats_record_the_up_axis(recording, tmp_path):
    convert(recording, tmp_path / "pose.obj")
    assert ": z up, metres\n" in (tmp_path / "pose.obj").read_text().partition("v ")[0]
    convert(recording, tmp_path / "pose.npz")
    with np.load(tmp_path / "pose.npz") as arrays:
        assert str(arrays["up"]) == "z"
    convert(recording, tmp_path / "over.npz", "--up=-y")
    with np.load(tmp_path / "over.npz") as arrays:
        assert str(arrays["up"]) == "y"
        found = arrays["vertices"][:, 1]
    assert_allclose(found, -heights_in_capture(recording), rtol=0, atol=1e-9)


def heights_in_capture(recording):
    folder, path = recording
    (actor,) = viewer.load(folder, motion=MotionSettings(model=path, up="y")).actors
    pose_actors([actor], 1 / 30)
    return deform(actor.figure, actor.pose)[0][:, 1]
