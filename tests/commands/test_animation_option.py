"""The option --animation, tested on a file with two animations of a node."""

import json

import numpy as np
import pytest
from formats.gltf.files import File

from viewer.cli import run


@pytest.fixture
def box(tmp_path) -> str:
    """A file of a triangle that moves along x by 1 in a second, or along y by 2 from 1 to 3 s."""
    file = File(nodes=[{"mesh": 0, "name": "box"}])
    file.mesh()
    for name, times, end in (("Slide", [0.0, 1.0], [1, 0, 0]), ("Rise", [1.0, 3.0], [0, 2, 0])):
        keys = file.accessor([[0, 0, 0], end])
        sampler = {"input": file.times(times), "output": keys}
        channel = {"sampler": 0, "target": {"node": 0, "path": "translation"}}
        file.add("animations", {"name": name, "samplers": [sampler], "channels": [channel]})
    path = tmp_path / "box.glb"
    path.write_bytes(file.glb())
    return str(path)


def info(capsys, *arguments):
    assert run(["info", "--json", *arguments]) == 0
    (actor,) = json.loads(capsys.readouterr().out)["actors"]
    return actor


def test_info_lists_animations_and_plays_the_requested_one(capsys, box):
    actor = info(capsys, box)
    assert [one["name"] for one in actor["animations"]] == ["Slide", "Rise"]
    assert actor["clip"]["name"] == "Slide" and actor["clip"]["kind"] == "transforms"
    for text in ("rise", "2"):
        found = info(capsys, box, "--animation", text)
        assert found["clip"]["range"] == [1.0, 3.0]
        assert [one["plays"] for one in found["animations"]] == [False, True]
    assert "clip" not in info(capsys, box, "--animation", "none")
    # The times are those of the file.
    low, high = info(capsys, box, "--animation", "rise", "--time", "2")["box"]
    np.testing.assert_allclose([low[1], high[1]], [1.0, 2.0], atol=1e-6)


def test_unknown_animation_ends_with_exit_code_2(capsys, box, tmp_path):
    out = str(tmp_path / "out.glb")
    for command in (["info"], ["convert", "-o", out], ["diff", box]):
        assert run([*command, box, "--animation", "Slice"]) == 2
        assert "did you mean Slide?" in capsys.readouterr().err
    run(["lint", box, "--animation", "Slice"])
    assert "did you mean Slide?" in capsys.readouterr().out


def test_conversion_writes_the_requested_animation(capsys, box, tmp_path):
    out = str(tmp_path / "out.npz")
    assert run(["convert", box, "--animation", "Rise", "--fps", "2", "-o", out]) == 0
    with np.load(out) as arrays:
        np.testing.assert_allclose(arrays["vertices"][:, 0, 1], [0, 0.5, 1, 1.5, 2], atol=1e-6)
        np.testing.assert_allclose(arrays["times"], [1, 1.5, 2, 2.5, 3])
    copy = str(tmp_path / "copy.glb")
    assert run(["convert", box, "--animation", "Rise", "-o", copy]) == 0
    capsys.readouterr()
    assert run(["diff", box, copy, "--animation", "Rise", "--tolerance", "1e-6"]) == 0


@pytest.mark.parametrize("output", ["out.bvh", "out.npz", "out_{frame}.obj"])
def test_conversion_to_frames_names_the_animations_that_are_not_written(
    capsys, box, tmp_path, output
):
    assert run(["convert", box, "--frames", "0:2", "-o", str(tmp_path / output)]) == 0
    assert "1 other animation is not written: Rise" in capsys.readouterr().out
    again = ["convert", box, "--animation", "Rise", "--force", "-o", str(tmp_path / output)]
    assert run([*again, "--frames", "30:32"]) == 0
    assert "1 other animation is not written: Slide" in capsys.readouterr().out
    # One pose is requested: nothing that was asked for is missing.
    assert run(["convert", box, "--time", "0.5", "-o", str(tmp_path / "pose.bvh")]) == 0
    assert "other animation" not in capsys.readouterr().out


@pytest.fixture
def still(tmp_path) -> str:
    """A file of a triangle without a motion."""
    file = File(nodes=[{"mesh": 0, "name": "still"}])
    file.mesh()
    path = tmp_path / "still.glb"
    path.write_bytes(file.glb())
    return str(path)


@pytest.mark.parametrize(
    ("time", "y", "held"),
    [("0", 0.0, "first"), ("0.99", 0.0, ""), ("3.01", 2.0, ""), ("7", 2.0, "last")],
)
def test_poses_are_held_outside_the_keys(capsys, box, time, y, held):
    assert run(["info", "--json", box, "--animation", "rise", "--time", time]) == 0
    captured = capsys.readouterr()
    (actor,) = json.loads(captured.out)["actors"]
    assert actor["box"][0][1] == pytest.approx(y, abs=1e-6)
    message = f"the motion has keys from 1 to 3 seconds, so its {held} pose is held"
    expected = f"warning: --time {time}: {message}\n" if held else ""
    assert captured.err == expected


@pytest.mark.parametrize("option", ["time", "frame"])
def test_still_files_have_one_pose(capsys, still, option):
    assert run(["info", still, f"--{option}", "0"]) == 0
    error = capsys.readouterr().err
    assert error == f"warning: --{option} has no effect: no file has a motion\n"


def test_still_and_moving_files_are_opened_without_an_animation(capsys, box, still):
    for files in ([still], [box], [still, box]):
        assert run(["info", *files, "--animation", "none"]) == 0
        assert capsys.readouterr().err == ""
