"""``viewer convert`` with captures: keypoints without bodies, absent and untracked people."""

import json
import math

import numpy as np
import pytest
from builders import rotation
from exporters.plain_bvh import PlainBvh
from exporters.plain_readers import read_obj
from exporters.small_rigs import ARMS_SKEL, clip_text, write_box, write_twist
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


STILL = "one frame: nothing moves, so the current pose was written"
POINTS = (
    "keypoints next to bodies are not written (take body25 0): to write them, open only the "
    "keypoints3d folder"
)
PRINTED = 1e-5  # in units, for six decimals summed along an arm


@pytest.fixture
def arms(tmp_path):
    path = tmp_path / "arms.skel"
    path.write_text(ARMS_SKEL)
    return path


@pytest.fixture
def gapped_recording(tmp_path):
    """A model, bodies 0 and 7 in frames 20 to 23 with 7 missing in 22, and keypoints of 0."""
    path = tmp_path / "SMPL.npz"
    np.savez(path, **model("smpl"))
    frames = {frame: [body(0, seed=frame), body(7)] for frame in range(20, 24)}
    frames[22] = frames[22][:1]
    write_frames(tmp_path / "take" / "smpl", frames)
    write_frames(tmp_path / "take" / "keypoints3d", {20: [points(0)], 21: [points(0)]})
    return tmp_path / "take", "--model", path


def written(folder, pattern):
    return sorted(path.name for path in folder.glob(pattern))


def test_static_figure_is_converted_to_a_bvh_of_its_pose(arms, tmp_path, capsys):
    out = tmp_path / "out.bvh"
    options = ["--dof", "root.z=90deg", "--dof", "root.tx=3", "--dof", "left.y=0.5"]
    assert convert(arms, *options, "-o", out) == 0
    bvh = PlainBvh(out)
    assert bvh.n_frames == 1
    # The rotation by 90 degrees maps x to y; the left hand is rotated further.
    places = bvh.places(0)
    assert_allclose(places["root"], [3, 0, 0], atol=PRINTED)
    assert_allclose(places["left"], [3, 1, 0], atol=PRINTED)
    hand = [3, 1 + math.cos(0.5), -math.sin(0.5)]
    assert_allclose(places["left_hand"], hand, atol=PRINTED)
    assert_allclose(places["right_hand"], [3, -2, 0], atol=PRINTED)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f"{out}: 5 joints, 1 frame (0) at 30 fps, ")
    assert lines[1:] == [STILL]


def test_requested_rest_frame_and_rate_are_used(arms, tmp_path):
    out = tmp_path / "out.bvh"
    assert convert(arms, "--dof", "root.z=90deg", "--rest-frame", "--fps", 50, "-o", out) == 0
    bvh = PlainBvh(out)
    assert (bvh.n_frames, bvh.frame_time) == (2, 0.02)
    assert_allclose(bvh.places(0)["left"], [1, 0, 0], atol=PRINTED)
    assert_allclose(bvh.places(1)["left"], [0, 1, 0], atol=PRINTED)


@pytest.mark.parametrize("options", [["-o", "x.bvh"], ["--body", "-o", "x.bvh"]])
def test_bundled_figures_are_converted_to_bvh(tmp_path, monkeypatch, capsys, options):
    monkeypatch.chdir(tmp_path)
    assert convert(*options) == 0
    assert PlainBvh(tmp_path / "x.bvh").n_frames == 1
    assert capsys.readouterr().out.splitlines()[-1] == STILL


def test_animals_are_converted_to_bvh(tmp_path):
    folder = write_box(tmp_path / "pig")
    assert convert(folder, "--dof", "figure.ty=2", "-o", tmp_path / "x.bvh") == 0
    places = PlainBvh(tmp_path / "x.bvh").places(0)
    # Six joints at the origin are moved by two metres along y; z is up in the model and becomes y.
    assert_allclose(list(places.values()), np.tile([0, 0, -200], (6, 1)), atol=PRINTED)


def test_each_of_several_figures_is_written_to_a_file(arms, tmp_path, capsys):
    assert convert(arms, *write_twist(tmp_path), "-o", tmp_path / "x.bvh") == 0
    assert written(tmp_path, "*.bvh") == ["x-2.bvh", "x.bvh"]
    assert PlainBvh(tmp_path / "x-2.bvh").names == ["low", "high"]
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 3 and lines[-1] == STILL


def test_omitted_figures_without_joints_are_reported(tmp_path, capsys):
    (tmp_path / "stone.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    files = [*write_twist(tmp_path), tmp_path / "stone.obj"]
    assert convert(*files, "-o", tmp_path / "x.bvh") == 0
    assert written(tmp_path, "*.bvh") == ["x.bvh"]
    lines = capsys.readouterr().out.splitlines()
    assert lines[-2:] == [STILL, "stone: no joints, not written"]


def test_static_body_is_converted_to_parameters_of_its_family(tmp_path, capsys):
    path = tmp_path / "SMPL.npz"
    np.savez(path, **model("smpl"))
    pose = np.round(0.3 * np.sin(np.arange(72.0)), 3)
    options = ["--pose", ",".join(map(str, pose)), "--shape", "0.5,-1"]
    assert convert(path, *options, "-o", tmp_path / "a.npz", "--as", "amass") == 0
    with np.load(tmp_path / "a.npz") as arrays:
        assert_allclose(arrays["poses"], pose[None], atol=1e-12)
        assert_allclose(arrays["betas"][:3], [0.5, -1, 0], atol=1e-12)
        assert_allclose(arrays["trans"], [[0, 0, 0]], atol=1e-12)
    assert convert(path, *options, "-o", tmp_path / "out") == 0
    assert written(tmp_path / "out" / "smpl", "*") == ["000000.json"]
    (record,) = json.loads((tmp_path / "out" / "smpl" / "000000.json").read_text())
    assert_allclose(rotation(record["Rh"][0]), rotation(pose[:3]), atol=1e-6)
    assert_allclose(record["poses"][0], [0, 0, 0, *pose[3:]], atol=1e-6)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f"{tmp_path}/a.npz: 1 frame of SMPL at 30 fps, y up"
    assert lines[1] == lines[-1] == STILL


def test_keys_contain_the_pose_and_move_the_rig_to_it(arms, tmp_path, capsys):
    options = ["--dof", "root.z=90deg", "--dof", "root.tx=3"]
    assert convert(arms, *options, "-o", tmp_path / "a.anim") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines == [f"{tmp_path}/a.anim: 18 channels with 18 keys, 0 to 0 s", STILL]
    assert convert(arms, tmp_path / "a.anim", "-o", tmp_path / "x.npz", "--frame", 0) == 0
    with np.load(tmp_path / "x.npz") as arrays:
        place = dict(zip(arrays["joint_names"].tolist(), arrays["joints"], strict=True))
    assert_allclose(place["left_hand"], [3, 2, 0], atol=1e-6)


def test_figures_without_dofs_have_no_keys(tmp_path, capsys):
    assert convert("--body", "-o", tmp_path / "x.anim") == 2
    assert capsys.readouterr().err == (
        "viewer: .anim needs a root translation and three angles per joint, as in .skel files; "
        "body has other DOFs\n"
    )
    assert not written(tmp_path, "*")


def test_mesh_without_joints_cannot_be_written_as_bvh(tmp_path, capsys):
    (tmp_path / "stone.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert convert(tmp_path / "stone.obj", "-o", tmp_path / "x.bvh") == 2
    message = "no file has a motion: a motion cannot be written"
    assert capsys.readouterr().err == f"viewer: {message}\n"


# Poses at a frame or time


@pytest.mark.parametrize(
    ("options", "x", "frame", "line"),
    [
        (["--frame", "15"], 1.0, 15, "one frame: the pose at frame 15"),
        (["--time", "0.5"], 1.0, 15, "one frame: the pose at 0.5 s"),
        (["--time", "0.51"], 1.02, 15, "one frame: the pose at 0.51 s"),
        (["--frame", "5", "--fps", "10"], 1.0, 5, "one frame: the pose at frame 5"),
    ],
)
def test_one_frame_of_a_clip_is_written(tmp_path, capsys, options, x, frame, line):
    rig = write_twist(tmp_path)
    (tmp_path / "walk.anim").write_text(clip_text())
    assert convert(*rig, tmp_path / "walk.anim", *options, "-o", tmp_path / "x.bvh") == 0
    bvh = PlainBvh(tmp_path / "x.bvh")
    assert bvh.n_frames == 1
    assert_allclose(bvh.places(0)["low"], [x, 0, 0], atol=PRINTED)
    lines = capsys.readouterr().out.splitlines()
    assert f"1 frame ({frame}) at " in lines[0] and lines[-1] == line


def test_one_frame_of_a_clip_is_written_as_keys(tmp_path, capsys):
    rig = write_twist(tmp_path)
    (tmp_path / "walk.anim").write_text(clip_text())
    out = tmp_path / "x.anim"
    assert convert(*rig, tmp_path / "walk.anim", "--time", 0.5, "-o", out) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f"{out}: 9 channels with 9 keys, 0.5 to 0.5 s"
    assert convert(*rig, out, "-o", tmp_path / "x.npz", "--frame", 0) == 0
    with np.load(tmp_path / "x.npz") as arrays:
        assert_allclose(arrays["joints"][0], [1, 0, 0], atol=1e-6)


def test_one_frame_of_a_capture_is_exact(gapped_recording, tmp_path, capsys):
    for options in (["--frame", 21], ["--time", 1 / 30]):
        out = tmp_path / f"{options[0][2:]}.bvh"
        assert convert(*gapped_recording, *options, "-o", out) == 0
    assert convert(*gapped_recording, "-o", tmp_path / "all.bvh") == 0
    whole = PlainBvh(tmp_path / "all-0.bvh")
    for name in ("frame-0.bvh", "time-0.bvh"):
        one = PlainBvh(tmp_path / name)
        assert one.n_frames == 1
        places = whole.places(1)
        assert_allclose([one.places(0)[n] for n in places], list(places.values()), atol=1e-4)
    assert "1 frame (21) at 30 fps" in capsys.readouterr().out.splitlines()[0]


def test_one_frame_of_a_capture_keeps_its_number(gapped_recording, tmp_path, capsys):
    assert convert(*gapped_recording, "--frame", 21, "-o", tmp_path / "out") == 0
    (path,) = (tmp_path / "out" / "smpl").iterdir()
    assert path.name == "000021.json"
    people = json.loads(path.read_text())
    assert [person["id"] for person in people] == [0, 7]
    assert_allclose(people[0]["Th"][0], body(0, seed=21)["Th"][0], atol=1e-6)
    assert_allclose(people[1]["shapes"][0], body(7)["shapes"][0], atol=1e-6)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f"{tmp_path}/out/smpl: 1 frame of 2 people, ")
    assert lines[1:] == ["one frame: the pose at frame 21", POINTS]


def test_numbered_mesh_of_one_frame_is_written(gapped_recording, tmp_path, capsys):
    assert convert(*gapped_recording, "--frame", 21, "-o", tmp_path / "m_{frame:04}.obj") == 0
    assert convert(*gapped_recording, "--frame", 21, "-o", tmp_path / "plain.obj") == 0
    assert written(tmp_path, "m_*") == ["m_0021-0.obj", "m_0021-7.obj"]
    found, wanted = read_obj(tmp_path / "m_0021-7.obj"), read_obj(tmp_path / "plain-7.obj")
    assert_allclose(found.v, wanted.v, atol=1e-8)
    assert "-0.obj: 1 file, m_0021-0.obj" in capsys.readouterr().out.splitlines()[0]


@pytest.mark.parametrize("name", ["w.bvh", "w", "w.obj"])
def test_people_absent_in_the_frame_are_omitted(gapped_recording, tmp_path, capsys, name):
    assert convert(*gapped_recording, "--frame", 22, "-o", tmp_path / name) == 0
    if name == "w":
        records = json.loads((tmp_path / "w" / "smpl" / "000022.json").read_text())
        assert [record["id"] for record in records] == [0]
    else:
        assert written(tmp_path, "w*") == [name.replace(".", "-0.")]
    text = capsys.readouterr().out
    assert "take 7: absent " in text and text.splitlines()[-1] == POINTS


@pytest.mark.parametrize("option", ["frame", "time"])
def test_range_and_single_frame_exclude_each_other(gapped_recording, tmp_path, capsys, option):
    assert (
        convert(*gapped_recording, "--frames", ":2", f"--{option}", 1, "-o", tmp_path / "x.bvh")
        == 2
    )
    message = f"--frames and --{option}: expected one of them, found both"
    assert capsys.readouterr().err == f"viewer: {message}\n"


# Keypoints together with bodies


@pytest.mark.parametrize("suffix", ["obj", "ply", "glb", "json", "txt", "skel", "npz"])
def test_bodies_are_written_without_their_keypoints(gapped_recording, tmp_path, capsys, suffix):
    assert convert(*gapped_recording, "--frame", 21, "-o", tmp_path / f"w.{suffix}") == 0
    # glTF can contain several figures.
    files = ["w.glb"] if suffix == "glb" else [f"w-0.{suffix}", f"w-7.{suffix}"]
    assert written(tmp_path, f"w*.{suffix}") == files
    assert capsys.readouterr().out.splitlines()[-1] == POINTS


def test_static_figures_omitted_next_to_a_motion_are_reported(arms, tmp_path, capsys):
    rig = write_twist(tmp_path)
    (tmp_path / "walk.anim").write_text(clip_text())
    files = [*rig, tmp_path / "walk.anim", arms]
    for options in ([], ["--frame", 3]):
        assert convert(*files, *options, "-o", tmp_path / "x.bvh", "--force") == 0
        line = "arms: no motion, not written"
        assert capsys.readouterr().out.splitlines()[-1] == line
    assert written(tmp_path, "*.bvh") == ["x.bvh"]


# Gaps


@pytest.mark.parametrize(
    ("gaps", "ids"), [([], [0]), (["--gaps", "hold"], [0, 7]), (["--gaps", "split"], [0])]
)
def test_gaps_in_folders_and_meshes_are_filled_if_requested(gapped_recording, tmp_path, gaps, ids):
    assert convert(*gapped_recording, *gaps, "-o", tmp_path / "out") == 0
    records = json.loads((tmp_path / "out" / "smpl" / "000022.json").read_text())
    assert [record["id"] for record in records] == ids
    if len(records) > 1:
        before = json.loads((tmp_path / "out" / "smpl" / "000021.json").read_text())
        assert records[1] == before[1]
    assert convert(*gapped_recording, *gaps, "-o", tmp_path / "m_{frame}.obj") == 0
    assert written(tmp_path, "m_22*") == [f"m_22-{person}.obj" for person in ids]


def test_gaps_in_keypoints_are_interpolated_or_refused(gapped_recording, tmp_path, capsys):
    folder = tmp_path / "kp" / "keypoints3d"
    first, last = points(0, seed=1.0), points(0, seed=2.0)
    write_frames(folder, {0: [first], 1: [], 2: [last]})
    out = tmp_path / "x.npz"
    assert convert(tmp_path / "kp", "--gaps", "hold", "-o", out) == 2
    message = "--gaps: expected interpolate for keypoints, found hold"
    assert capsys.readouterr().err.endswith(f"viewer: {message}\n")
    assert convert(tmp_path / "kp", "--gaps", "interpolate", "-o", out) == 0
    with np.load(out) as arrays:
        assert arrays["present"].tolist() == [True, True, True]
        middle = np.add(first["keypoints3d"], last["keypoints3d"])[:, :3] / 2
        assert_allclose(arrays["points"][1], middle, atol=1e-12)
