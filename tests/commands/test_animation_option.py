"""Animations and weights of morph targets, chosen on the command line."""

import json

import numpy as np
import pytest
from app.tiny import skin_text, write_rig
from formats.gltf.files import File
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose

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


@pytest.mark.parametrize("output", ["out.bvh", "out.npz", "out_{frame}.obj", "out.html"])
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


# Vertices 11 and 10 of the tiny column, at (0.2, 2, -0.2) and (-0.2, 2, -0.2).
SHARP = "positions 1 {\n 11 0.2 5 -0.2\n}\nnormals 1 {\n 11 1 0 -1\n}\n"
WIDE = "positions 1 {\n 10 -4.2 2 -0.2\n}\nnormals 1 {\n 10 -1 0 -1\n}\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    skel, _ = write_rig(tmp_path)
    skel.write_text("balljoint root { balljoint arm { offset 0 1 0 } }")
    (tmp_path / "sharp.morph").write_text(SHARP)
    (tmp_path / "wide.morph").write_text(WIDE)
    np.savez(tmp_path / "smpl.npz", **model("smpl", 32))
    return tmp_path


RIG = ("tiny.skel", "tiny.skin", "sharp.morph", "wide.morph")


def vertices(*arguments) -> np.ndarray:
    assert run(["convert", *arguments, "-o", "x.npz", "--force"]) == 0
    with np.load("x.npz") as arrays:
        return arrays["vertices"]


@pytest.mark.parametrize(
    ("text", "sharp", "wide"),
    [
        ("sharp=0.5", 0.5, 0),
        ("sharp=0.5,wide=1", 0.5, 1),
        (" Wide = -1 ,", 0, -1),
        ("sharp=1e-1", 0.1, 0),
        ("0.5", 0.5, 0),
        ("0,2", 0, 2),
        ("0.25,0.75,0", 0.25, 0.75),
    ],
)
def test_morphs_move_their_vertices(folder, text, sharp, wide):
    plain = vertices(*RIG)
    assert_allclose(plain[[10, 11]], [[-0.2, 2, -0.2], [0.2, 2, -0.2]], atol=1e-12)
    moved = vertices(*RIG, f"--shape={text}") - plain
    expected = np.zeros((12, 3))
    expected[11, 1], expected[10, 0] = 3 * sharp, -4 * wide
    assert_allclose(moved, expected, atol=1e-12)


def test_morphs_do_not_need_a_skeleton(folder):
    (folder / "alone.skin").write_text(skin_text())
    moved = vertices("alone.skin", "sharp.morph", "--shape", "sharp=1")
    assert_allclose(moved[11], [0.2, 5, -0.2], atol=1e-12)


def test_body_shapes_can_be_set_by_name(folder):
    by_place = vertices("smpl.npz", "--shape", "0,2")
    assert np.abs(by_place - vertices("smpl.npz")).max() > 1e-3
    assert (by_place == vertices("smpl.npz", "--shape", "shape 1=2")).all()


def test_names_apply_to_a_body_opened_with_a_morphed_rig(folder):
    """A list sets the coefficients of the body; names apply to the figures that have them."""
    first = vertices(*RIG, "smpl.npz", "--shape", "sharp=1")
    assert_allclose(first[11], [0.2, 5, -0.2], atol=1e-12)
    first = vertices(*RIG, "smpl.npz", "--shape", "1")
    assert_allclose(first[11], [0.2, 2, -0.2], atol=1e-12)


@pytest.mark.parametrize(
    ("files", "text", "message"),
    [
        (RIG, "narrow=1", 'no shape is called "narrow"; there are 2: sharp, wide'),
        (RIG, "sharp=1,narrow=1", 'no shape is called "narrow"; there are 2: sharp, wide'),
        (RIG, "sharpe=1", 'no shape is called "sharpe"; did you mean sharp?'),
        (RIG, "sharp=much", 'expected NAME=NUMBER, found "sharp=much"'),
        (RIG, "sharp=nan", 'expected NAME=NUMBER, found "sharp=nan"'),
        (RIG, "=1", 'expected NAME=NUMBER, found "=1"'),
        (RIG, "sharp=1,0.5", 'expected NAME=NUMBER, found "0.5"'),
        (RIG, "1,2,3", "tiny has 2 morphs (sharp, wide), found 3 numbers"),
        (RIG[:2], "sharp=1", "no file has shapes or morphs"),
        (
            ("sharp.morph", "sub/sharp.morph", *RIG[:2]),
            "sharp=1",
            '2 shapes are called "sharp"; numbers without names set all shapes in order',
        ),
    ],
)
def test_invalid_shapes_are_refused_in_one_line(folder, capsys, files, text, message):
    (folder / "sub").mkdir()
    (folder / "sub" / "sharp.morph").write_text(WIDE)
    assert run(["info", *files, f"--shape={text}"]) == 2
    assert capsys.readouterr().err == f"viewer: --shape: {message}\n"


def test_long_name_lists_are_truncated(folder, capsys):
    assert run(["info", "smpl.npz", "--shape", "x=1"]) == 2
    assert 'no shape is called "x"; there are 10: ' in capsys.readouterr().err
