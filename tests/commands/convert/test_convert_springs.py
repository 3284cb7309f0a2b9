"""``viewer convert --bake-springs``: simulated rotations of hair in written motions."""

import numpy as np
import pytest
from formats.vrm.swinging import HAIR, swinging
from numpy.testing import assert_allclose

import viewer
from viewer.cli import run
from viewer.loading import MotionSettings, load
from viewer.rig.motion.evaluation import pose_actors


def places(actor, time):
    pose_actors([actor], time)
    names = actor.figure.require_skeleton().names
    matrices = viewer.joint_matrices(actor.figure, actor.pose)
    return matrices[[names.index(name) for name in HAIR], :3, 3]


@pytest.mark.slow
@pytest.mark.parametrize("bakes", [False, True])
def test_springs_are_written_only_on_request(tmp_path, capsys, bakes):
    path, out = tmp_path / "ada.vrm", tmp_path / "out.glb"
    file = swinging()
    path.write_bytes(file.glb())
    options = ["--bake-springs"] if bakes else []
    assert run(["convert", str(path), "-o", str(out), "--fps", "60", *options]) == 0
    said = capsys.readouterr().out
    assert ("simulated rotations of 3 spring joints are written" in said) == bakes
    assert "the humanoid bone map, 1 spring chain, authors and licence of the VRM" in said
    assert ("viewer convert --bake-springs writes the simulated ones" in said) == (not bakes)
    (wanted,) = load(path, motion=MotionSettings(springs=bakes)).actors
    (found,) = load(out).actors
    for time in (0.5, 1.0):
        # The file has single precision.
        assert_allclose(places(found, time), places(wanted, time), rtol=0, atol=1e-6)


def test_figures_without_springs_are_refused(tmp_path, capsys):
    path = tmp_path / "ada.vrm"
    file = swinging()
    del file.root["extensions"]["VRMC_springBone"]
    path.write_bytes(file.glb())
    out = str(tmp_path / "a.glb")
    assert run(["convert", str(path), "-o", out, "--bake-springs"]) == 2
    said = capsys.readouterr().err
    assert "--bake-springs: no figure with a motion has spring joints" in said
    assert np.array_equal([*tmp_path.iterdir()], [path])


@pytest.mark.parametrize("suffix", [".vrm", ".vrma"])
def test_formats_without_such_motions_are_refused(tmp_path, capsys, suffix):
    path = tmp_path / "ada.vrm"
    path.write_bytes(swinging().glb())
    assert run(["convert", str(path), "-o", f"{tmp_path}/a{suffix}", "--bake-springs"]) == 2
    said = capsys.readouterr().err
    assert f"--bake-springs: {suffix} cannot store motions of spring joints" in said
    assert [*tmp_path.iterdir()] == [path]
