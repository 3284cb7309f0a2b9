"""``viewer convert`` with captures: keypoints without bodies, absent and untracked people."""

import json

import numpy as np
import pytest
from formats.capture_files import body, points, standing, write_frames
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose, assert_array_equal

import viewer
from viewer.cli import run


def convert(*arguments):
    return run(["convert", *map(str, arguments)])


@pytest.fixture
def keypoints(tmp_path):
    """Frames 10 to 12, with person 0 in all and person 4 in the last."""
    frames = {10: [standing(0, 0.0)], 11: [standing(0, 0.1)]}
    write_frames(
        tmp_path / "kp" / "keypoints3d", {**frames, 12: [standing(0, 0.2), standing(4, 2)]}
    )
    return tmp_path / "kp"


@pytest.fixture
def recording(tmp_path):
    """A model, and bodies in frames 20 to 23: person 0 in all and person 7 in the first two."""
    path = tmp_path / "SMPL.npz"
    np.savez(path, **model("smpl"))
    frames = {frame: [body(0), body(7)] if frame < 22 else [body(0)] for frame in range(20, 24)}
    write_frames(tmp_path / "take" / "smpl", frames)
    return tmp_path / "take", "--model", path


def test_keypoints_are_written_person_by_person(keypoints, tmp_path, capsys):
    assert convert(keypoints, "-o", tmp_path / "m.npz") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f"{tmp_path}/m-0.npz: 3 frames at 30 fps, z up: name, up, ")
    assert lines[1].startswith(f"{tmp_path}/m-4.npz: 3 frames at 30 fps; 2 of them missing")
    with np.load(tmp_path / "m-4.npz") as arrays:
        assert (str(arrays["name"]), str(arrays["up"])) == ("kp body25 4", "z")
        assert arrays["frames"].tolist() == [10, 11, 12]
        assert arrays["present"].tolist() == [False, False, True]
        assert arrays["joint_names"][[0, 8]].tolist() == ["nose", "mid_hip"]
        assert_array_equal(arrays["points"][2, [0, 8]], [[2, 0, 1.6], [2, 0, 1]])
        assert_array_equal(arrays["confidences"][2, [0, 1, 8]], [0.5, 0.0, 1.0])
        assert np.isnan(arrays["points"][2, 1]).all()


def test_upside_down_keypoints_are_written_upright(keypoints, tmp_path):
    assert convert(keypoints, "--up=-z", "-o", tmp_path / "m.npz") == 0
    with np.load(tmp_path / "m-4.npz") as arrays:
        assert str(arrays["up"]) == "z"
        assert_allclose(arrays["points"][2, 0], [2, 0, -1.6], rtol=0, atol=1e-15)


def test_keypoints_at_one_frame_keep_the_frame_number(keypoints, tmp_path, capsys):
    assert convert(keypoints, "-o", tmp_path / "m.npz", "--frame", 11) == 0
    assert capsys.readouterr().out.splitlines()[1:] == [
        "kp body25 4: absent at that time, not written"
    ]
    assert [path.name for path in tmp_path.glob("*.npz")] == ["m-0.npz"]
    with np.load(tmp_path / "m-0.npz") as arrays:
        assert str(arrays["up"]) == "z" and arrays["points"].shape == (25, 3)
        assert_array_equal(arrays["points"][0], [0.1, 0, 1.6])


@pytest.mark.parametrize("arguments", [["m.bvh"], ["m"], ["m.npz", "--as", "amass"]])
def test_keypoints_without_bodies_are_refused_as_joint_motion(
    keypoints, tmp_path, capsys, arguments
):
    name, *others = arguments
    assert convert(keypoints, "-o", tmp_path / name, "--fps", 30, *others) == 2
    assert capsys.readouterr().err == (
        "viewer: there are only keypoints: a motion of joints cannot be written "
        "(.npz stores points)\n"
    )
    assert not [*tmp_path.glob("m*")]


def test_keypoints_omitted_next_to_bodies_are_reported(recording, tmp_path, capsys):
    write_frames(tmp_path / "take" / "keypoints3d", {20: [points(0)]})
    assert convert(*recording, "-o", tmp_path / "w.bvh") == 0
    assert capsys.readouterr().out.splitlines()[-1] == (
        "keypoints next to bodies are not written (take body25 0): to write them, open only the "
        "keypoints3d folder"
    )


@pytest.mark.parametrize("name", ["w.bvh", "w.npz", "w-{person}.glb"])
def test_absent_people_are_omitted_without_renaming_the_others(recording, tmp_path, capsys, name):
    assert convert(*recording, "-o", tmp_path / name, "--frames", "22:24") == 0
    suffix = name.partition(".")[2]
    assert [path.name for path in tmp_path.glob("w*")] == [f"w-0.{suffix}"]
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1] == "take 7: absent in frames 22 to 23, not written"


def test_glb_contains_all_people(recording, tmp_path, capsys):
    assert convert(*recording, "-o", tmp_path / "w.glb", "--up", "y") == 0
    assert [path.name for path in tmp_path.glob("w*")] == ["w.glb"]
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f"{tmp_path}/w.glb: 2 figures: take 0, take 7; one animation of 0.1")
    assert "take 7: missing frames 22 to 23: the last pose is held" in lines
    figures = [actor.figure for actor in viewer.load(tmp_path / "w.glb").actors]
    assert [figure.name for figure in figures] == ["take 0", "take 7"]
    assert [figure.animations[0].name for figure in figures] == ["take", "take"]


def test_glb_of_the_only_person_present_keeps_its_name(recording, tmp_path, capsys):
    assert convert(*recording, "-o", tmp_path / "w.glb", "--frames", "22:24") == 0
    assert [path.name for path in tmp_path.glob("w*")] == ["w.glb"]
    assert "96 vertices" in capsys.readouterr().out.splitlines()[0]


@pytest.mark.parametrize("kind", ["glb", "bvh"])
def test_person_field_in_a_name_is_replaced(recording, tmp_path, kind):
    assert convert(*recording, "-o", tmp_path / f"p{{person}}_take.{kind}") == 0
    names = sorted(path.name for path in tmp_path.glob("p*"))
    assert names == [f"p0_take.{kind}", f"p7_take.{kind}"]


def test_meshes_are_numbered_by_person_and_frame(recording, tmp_path):
    assert convert(*recording, "-o", tmp_path / "p{person}-{frame:03}.obj") == 0
    names = sorted(path.name for path in tmp_path.glob("p*.obj"))
    assert names == [
        *(f"p0-{frame:03}.obj" for frame in range(20, 24)),
        *(f"p7-{frame:03}.obj" for frame in range(20, 22)),
    ]


def test_split_gaps_write_a_glb_per_person(recording, tmp_path):
    assert convert(*recording, "-o", tmp_path / "w.glb", "--gaps", "split") == 0
    assert sorted(path.name for path in tmp_path.glob("w*")) == ["w-0.glb", "w-7.glb"]


def test_absent_people_are_omitted_from_folders(recording, tmp_path, capsys):
    assert convert(*recording, "-o", tmp_path / "w", "--frames", "23:24") == 0
    text = capsys.readouterr().out
    assert "1 frame of 1 person" in text and "take 7: absent in frame 23, not" in text
    (frame,) = (tmp_path / "w" / "smpl").iterdir()
    assert [record["id"] for record in json.loads(frame.read_text())] == [0]


@pytest.mark.parametrize("name", ["w.bvh", "w.npz", "w.glb", "w"])
def test_empty_capture_is_refused_before_anything_is_written(recording, tmp_path, capsys, name):
    (tmp_path / "take" / "smpl" / "000023.json").write_text("[]")
    before = {path.name for path in tmp_path.iterdir()}
    assert convert(*recording, "-o", tmp_path / name, "--frames", "23:24") == 2
    message = "no person is present in frame 23: there is nothing to write"
    assert capsys.readouterr().err.endswith(f"viewer: {message}\n")
    assert {path.name for path in tmp_path.iterdir()} == before


def test_time_without_any_present_person_is_refused(recording, tmp_path, capsys):
    (tmp_path / "take" / "smpl" / "000023.json").write_text("[]")
    assert convert(*recording, "-o", tmp_path / "w.obj", "--frame", 23) == 2
    message = "no person is present at that time: there is nothing to write"
    assert capsys.readouterr().err.endswith(f"viewer: {message}\n")


def test_untracked_people_have_unique_names(recording, tmp_path, capsys):
    frames = {0: [body(-1), body(3), body(-1, seed=1.0)], 1: [body(3), body(-1)]}
    folder = write_frames(tmp_path / "un" / "smpl", frames)
    assert convert(folder, *recording[1:], "-o", tmp_path / "w.bvh") == 0
    names = sorted(path.name for path in tmp_path.glob("w*"))
    assert names == ["w-3.bvh", "w-untracked-2.bvh", "w-untracked.bvh"]
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1] == (
        "w-untracked.bvh, w-untracked-2.bvh: not tracked, possibly a different person in each frame"
    )
    assert lines[0].startswith(f"{tmp_path}/w-3.bvh")  # people with a track are listed first


def test_untracked_people_in_one_file_are_named(recording, tmp_path, capsys):
    frames = {0: [body(-1), body(3)], 1: [body(3), body(-1)]}
    folder = write_frames(tmp_path / "un" / "smpl", frames)
    assert convert(folder, *recording[1:], "-o", tmp_path / "w.glb") == 0
    assert capsys.readouterr().out.splitlines()[-1] == (
        "un untracked: not tracked, possibly a different person in each frame"
    )


def test_untracked_people_round_trip_untracked(recording, tmp_path):
    frames = {0: [body(-1), body(3), body(-1, seed=1.0)], 1: [body(3), body(-1)]}
    folder = write_frames(tmp_path / "un" / "smpl", frames)
    assert convert(folder, *recording[1:], "-o", tmp_path / "back") == 0
    written = sorted((tmp_path / "back" / "smpl").iterdir())
    ids = [[record["id"] for record in json.loads(path.read_text())] for path in written]
    assert ids == [[3, -1, -1], [3, -1]]
    people = json.loads(written[0].read_text())
    assert_allclose(people[2]["Th"][0], body(-1, seed=1.0)["Th"][0], rtol=0, atol=1e-6)


def test_motion_of_one_frame_is_written(recording, tmp_path):
    path = tmp_path / "one.npz"
    arrays = {"poses": np.zeros((1, 72)), "trans": np.ones((1, 3)), "betas": np.zeros(16)}
    np.savez(path, **arrays, mocap_framerate=np.array(60.0))
    assert convert(path, *recording[1:], "-o", tmp_path / "w.bvh") == 0
    lines = (tmp_path / "w.bvh").read_text().splitlines()
    assert lines[lines.index("MOTION") + 1] == "Frames: 1"


def test_single_frame_of_upside_down_keypoints_is_written_upright(keypoints, tmp_path):
    assert convert(keypoints, "--up=-z", "-o", tmp_path / "m.npz", "--frame", 12) == 0
    with np.load(tmp_path / "m-4.npz") as arrays:
        assert str(arrays["up"]) == "z"
        assert_allclose(arrays["points"][0], [2, 0, -1.6], rtol=0, atol=1e-15)
        assert arrays["confidences"][0] == 0.5
