"""``viewer info`` of captures and morphs: positions, up axis, and missing frames."""

import json

import numpy as np
import pytest
from app.tiny import write_rig
from formats.capture_files import body, standing, write_frames
from formats.synthetic_smpl import model

from viewer.cli import run


@pytest.fixture
def info(capsys):
    def lines(*arguments):
        assert run(["info", *map(str, arguments)]) == 0
        captured = capsys.readouterr()
        assert run(["info", *map(str, arguments), "--json"]) == 0
        return captured.out.splitlines(), json.loads(capsys.readouterr().out), captured.err

    return lines


def test_up_axis_is_that_of_the_scene(info, tmp_path):
    np.savez(tmp_path / "SMPL.npz", **model("smpl"))
    folder = write_frames(tmp_path / "take" / "smpl", {0: [body(0)]})
    lines, found, _ = info(folder, "--model", tmp_path / "SMPL.npz", "--up", "z")
    assert lines[0] == "take 0" and lines[1].endswith(", z up")
    assert lines[2] == "  figure     SMPL" and found["actors"][0]["figure"] == "SMPL"
    assert found["actors"][0]["up"] == "z"


def test_bounding_boxes_contain_only_present_people(info, tmp_path):
    frames = {3: [standing(0, 0.0)], 4: [standing(0, 0.0), standing(4, 2.0)]}
    folder = write_frames(tmp_path / "kp" / "keypoints3d", {**frames, 5: [standing(4, 2.0)]})
    lines, found, _ = info(folder)
    assert lines[:4] == [
        "kp body25 0",
        "  box        (0, 0, 1) to (0, 0, 1.6), size 0.6, z up",
        "  clip       kp: 0 to 0.067 s, 3 frames (3 to 5) at 30 fps, 25 points, 8.0 % visible",
        "    1 frame is missing: 5",
    ]
    assert lines[4:6] == ["kp body25 4", "  box        none: absent at this time, z up"]
    assert lines[7] == "    1 frame is missing: 3"
    away = found["actors"][1]
    assert (away["box"], away["size"], away["present"]) == (None, None, False)


def test_several_gaps_are_listed(info, tmp_path):
    there = [standing(0, 0.0)]
    frames = dict.fromkeys((0, 2, 5, 7), there)
    lines, _, _ = info(write_frames(tmp_path / "kp" / "keypoints3d", frames))
    assert lines[3] == "    4 frames are missing: 1, 3 to 4, 6"


def test_undetected_keypoints_have_no_bounding_box(info, tmp_path):
    unseen = {"id": 0, "keypoints3d": [[0.0] * 4] * 25}
    folder = write_frames(tmp_path / "kp" / "keypoints3d", {0: [unseen], 1: [unseen]})
    lines, found, err = info(folder, "--fps", "30")
    assert lines[1] == "  box        none: nothing is visible, z up"
    assert found["actors"][0]["present"] and found["actors"][0]["box"] is None
    assert err == "note: kp: no keypoint of person 0 is ever visible: every confidence is 0\n"


def test_morphs_are_listed_with_their_vertex_counts(info, tmp_path):
    skel, skin = write_rig(tmp_path)
    (tmp_path / "smile.morph").write_text(
        "positions 2 { 0 5 6 7  3 1 1 1 } normals 2 { 0 0 0 1  3 0 0 1 }"
    )
    (tmp_path / "frown.morph").write_text("positions 1 { 2 5 6 7 } normals 1 { 2 0 0 1 }")
    lines, found, _ = info(skel, skin, tmp_path / "smile.morph", tmp_path / "frown.morph")
    assert "  morph      smile: moves 2 vertices" in lines
    assert "  morph      frown: moves 1 vertex" in lines
    assert found["actors"][0]["morphs"] == [
        {"name": "smile", "vertices": 2, "materials": 0},
        {"name": "frown", "vertices": 1, "materials": 0},
    ]
    assert "morphs" not in info(skel, skin)[1]["actors"][0]
