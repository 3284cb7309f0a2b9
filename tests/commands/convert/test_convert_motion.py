"""``viewer convert`` with motions: exporters, frames, files, and refusals."""

import json

import numpy as np
import pytest
from app.tiny import write_rig
from exporters.gltf.two_parts import two_parts
from exporters.plain_gltf import Gltf
from exporting import export_clips
from formats.capture_files import body, write_frames
from formats.synthetic_smpl import model
from formats.vrm.swinging import HAIR, swinging
from numpy.testing import assert_allclose

import viewer
from viewer.cli import run
from viewer.loading import MotionSettings, load
from viewer.rigs.geometry.rotation import matrix_to_rotation_vector, rotation_vector_to_matrix
from viewer.rigs.scene import Actor, pose_actors
from viewer.rigs.skinning import Skinning, deform


@pytest.fixture
def walk(tmp_path):
    """The tiny rig and a clip that starts at 1 s and moves the root right by 0.5 in a second."""
    skel, skin = write_rig(tmp_path)
    count = viewer.load(skel).actors[0].figure.skeleton.n_dofs
    moving = (
        "channel { extrapolate constant constant keys 2 { 1 0 linear linear 2 0.5 linear linear } }"
    )
    still = "channel { extrapolate constant constant keys 1 { 0 0 flat flat } }"
    clip = tmp_path / "walk.anim"
    channels = " ".join([moving] + [still] * (count - 1))
    clip.write_text(f"animation {{ range 1 2 numchannels {count} {channels} }}")
    return str(skel), str(skin), str(clip)


@pytest.fixture
def recording(tmp_path):
    """A model, and a folder of five frames in which person 3 is missing in the middle frame."""
    path = tmp_path / "SMPL.npz"
    np.savez(path, **model("smpl"))
    folder = tmp_path / "take" / "smpl"
    folder.mkdir(parents=True)
    for frame in range(5):
        people = []
        for person in (0, 3):
            if (person, frame) == (3, 2):
                continue
            poses = np.zeros(72)
            poses[12] = 0.1 * frame
            record = {
                "id": person,
                "Rh": [[0.3, 0.2, 0.1 * frame]],
                "Th": [[person, 0.1 * frame, 1.0]],
            }
            people.append({**record, "poses": [poses.tolist()], "shapes": [[0.5] + [0.0] * 9]})
        (folder / f"{frame:06}.json").write_text(json.dumps(people))
    return str(tmp_path / "take"), "--model", str(path)


def convert(*arguments):
    return run(["convert", *map(str, arguments)])


def test_numbered_meshes_are_the_posed_meshes(walk, tmp_path, capsys):
    out = tmp_path / "w_{frame:03}.obj"
    assert convert(*walk, "-o", out, "--fps", 4, "--frames", "1:4") == 0
    assert "3 files, w_001.obj to w_003.obj" in capsys.readouterr().out
    actor = viewer.load(*walk).actors[0]
    for frame in (1, 2, 3):
        pose_actors([actor], 1.0 + frame / 4)
        wanted, _ = viewer.deform(actor.figure, actor.pose)
        lines = (tmp_path / f"w_{frame:03}.obj").read_text().splitlines()
        found = np.array([line.split()[1:] for line in lines if line.startswith("v ")], float)
        assert_allclose(found, wanted, atol=1e-7)
    assert not (tmp_path / "w_000.obj").exists()


def test_arrays_contain_all_frames(walk, tmp_path):
    out = tmp_path / "walk.npz"
    assert convert(*walk, "-o", out, "--fps", 4) == 0
    with np.load(out) as arrays:
        assert_allclose(arrays["times"], [1.0, 1.25, 1.5, 1.75, 2.0])
        roots = arrays["joints"][:, 0, 0]
        assert_allclose(roots - roots[0], [0.0, 0.125, 0.25, 0.375, 0.5], atol=1e-12)
        moved = arrays["vertices"] - arrays["vertices"][0]
        assert_allclose(moved[4], np.broadcast_to([0.5, 0, 0], moved[4].shape), atol=1e-12)


def test_single_pose_is_written_if_a_time_is_given(walk, tmp_path):
    out = tmp_path / "pose.npz"
    assert convert(*walk, "-o", out, "--time", 1.5) == 0
    with np.load(out) as arrays:
        assert arrays["vertices"].ndim == 2


def test_each_person_is_written_to_a_file(recording, tmp_path, capsys):
    assert convert(*recording, "-o", tmp_path / "walk.bvh") == 0
    written = sorted(path.name for path in tmp_path.glob("*.bvh"))
    assert written == ["walk-0.bvh", "walk-3.bvh"]
    text = capsys.readouterr().out
    assert " differ " not in text
    assert "missing frames 2" in text or "missing frame 2" in text


def test_captures_round_trip_through_amass(recording, tmp_path):
    assert convert(*recording, "-o", tmp_path / "m.npz") == 0
    source = viewer.load(recording[0], motion=viewer.loading.MotionSettings(model=recording[2]))
    for actor in source.actors:
        back = viewer.load(tmp_path / f"m-{actor.person}.npz", recording[2]).actors[0]
        for frame in (0, 1, 3, 4):
            pose_actors([actor], frame / 30.0)
            pose_actors([back], frame / 30.0)
            first, _ = viewer.deform(actor.figure, actor.pose)
            second, _ = viewer.deform(back.figure, back.pose)
            assert_allclose(second, first, atol=1e-9)


def test_easymocap_folder_is_written_and_inputs_never_replaced(recording, tmp_path, capsys):
    assert convert(*recording, "-o", tmp_path / "again") == 0
    frames = sorted((tmp_path / "again" / "smpl").iterdir())
    assert [path.name for path in frames] == [f"{n:06}.json" for n in range(5)]
    assert [record["id"] for record in json.loads(frames[2].read_text())] == [0]
    assert convert(*recording, "-o", tmp_path / "again") == 5
    assert "already exists (--force replaces it)" in capsys.readouterr().err
    assert convert(*recording, "-o", tmp_path / "take", "--force") == 5
    assert "input folders are never overwritten" in capsys.readouterr().err
    assert (
        convert(tmp_path / "take" / "smpl", *recording[1:], "-o", tmp_path / "take", "--force") == 5
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["-o", "w.obj", "--frames", "0:2"], "expected a name with {frame}, such as walk_"),
        (["-o", "{frame[0]}.obj"], "{frame[0]}.obj: expected a name with {frame}, such as walk_"),
        (["-o", "{frame:99999999999}.obj"], "99}.obj: expected a name with {frame}, "),
        (["-o", "w.bvh", "--frames", "2:1"], "--frames: expected A:B"),
        (["-o", "w.bvh", "--frames", "0:4:2"], "--frames: expected A:B"),
        (["-o", "w.xyz"], 'no exporter for ".xyz"; supported:'),
        (["-o", "w.webp"], "; viewer render draws pictures and videos"),
        (["-o", "w.bvh", "--as", "anim"], "--as anim: expected a name with .anim"),
        (["-o", "missing/w.bvh"], "missing/w.bvh: the folder "),
        (["-o", "w.bvh", "--digits", "99"], "--digits: expected 1 to 15, found 99"),
        (["-o", "w.bvh", "--digits", "0"], "--digits: expected 1 to 15, found 0"),
    ],
)  # fmt: skip
def test_invalid_requests_are_refused(walk, tmp_path, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(tmp_path)
    before = set(tmp_path.iterdir())
    assert run(["convert", *walk, *arguments]) in (2, 5)
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1
    assert set(tmp_path.iterdir()) == before


def test_static_figures_are_refused_for_motion_output(tmp_path, capsys):
    skel, skin = write_rig(tmp_path)
    for options in (["-o", tmp_path / "w_{frame}.obj"], ["--frames", ":9", "-o", tmp_path / "w"]):
        assert convert(skel, skin, *options) == 2
        assert "no file has a motion: a motion cannot be written" in capsys.readouterr().err


def test_existing_files_require_force(walk, tmp_path, capsys):
    (tmp_path / "w.bvh").write_text("precious")
    assert convert(*walk, "-o", tmp_path / "w.bvh") == 5
    assert (tmp_path / "w.bvh").read_text() == "precious"
    assert convert(*walk, "-o", tmp_path / "w.bvh", "--force") == 0
    assert (tmp_path / "w.bvh").read_text().startswith("HIERARCHY")


def test_upside_down_worlds_are_written_upright(recording, tmp_path):
    # With y pointing down, the joints of a body are rotated by 180 degrees about x.
    assert convert(*recording, "--up=-y", "-o", tmp_path / "a.npz", "--as", "npz") == 0
    assert convert(*recording, "--up=y", "-o", tmp_path / "b.npz", "--as", "npz") == 0
    with np.load(tmp_path / "a-0.npz") as a, np.load(tmp_path / "b-0.npz") as b:
        assert (str(a["up"]), str(b["up"])) == ("y", "y")
        assert_allclose(a["joints"], b["joints"] * [1, -1, -1], atol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["-o", "w_{frame}.bvh"], (".obj", "found .bvh")),
        (["-o", "w_{frame:03}.glb", "--frames", "0:2"], (".obj", "found .glb")),
        (["-o", "w_{frame}"], (".obj", "found a folder")),
        (["-o", "w_{fram}.obj", "--frames", "0:2"], ("{frame}",)),
        (["-o", "w.obj", "--as", "bvh"], ("--as bvh", ".bvh", "found w.obj")),
        (["-o", "w.skel", "--as", "easymocap"], ("--as easymocap", "/", "found w.skel")),
    ],
)
def test_invalid_name_is_a_usage_error_before_files_are_read(
    tmp_path, monkeypatch, capsys, arguments, words
):
    monkeypatch.chdir(tmp_path)
    assert run(["convert", "missing.skel", *arguments]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "missing.skel" not in error
    assert all(word in error for word in words)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("options", "animations", "printed"),
    [
        ([], ["wave", "jump"], "2 animations with their own keys"),
        (["--animation", "jump"], ["jump"], "1 animation with its own keys"),
        (["--animation", "none"], [], "2 joints"),
        (["--time", "0.5"], [], "2 joints"),
        (["--frames", "0:4"], ["wave"], "4 frames (0 to 3)"),
        (["--optimize"], ["wave", "jump"], "quantised with rounding errors of up to"),
    ],
)
def test_animations_are_written_with_their_keys(tmp_path, capsys, options, animations, printed):
    export_clips(Actor(two_parts()), tmp_path / "in.glb")
    assert run(["convert", str(tmp_path / "in.glb"), "-o", f"{tmp_path}/out.glb", *options]) == 0
    assert printed in capsys.readouterr().out
    figure = viewer.load(tmp_path / "out.glb").actors[0].figure
    assert [animation.name for animation in figure.animations] == animations


def test_figure_without_the_chosen_animation_is_written_in_its_pose(tmp_path, capsys):
    figure = two_parts()
    export_clips(Actor(figure), tmp_path / "both.glb")
    export_clips(Actor(figure), tmp_path / "wave.glb", clips=[figure.animations[0].clip()])
    files = [str(tmp_path / name) for name in ("both.glb", "wave.glb")]
    out = tmp_path / "out.glb"
    assert run(["convert", *files, "--animation", "jump", "--optimize", "-o", str(out)]) == 0
    said = capsys.readouterr().out
    assert "both: vertices differ by up to" in said and "in 1 animation" in said
    assert "wave: vertices differ from the pose by up to" in said and "0 animations" not in said


def test_optimisation_of_other_formats_is_refused(tmp_path, capsys):
    export_clips(Actor(two_parts()), tmp_path / "in.glb")
    command = ["convert", str(tmp_path / "in.glb"), "-o", f"{tmp_path}/out.bvh", "--optimize"]
    assert run(command) == 2
    assert "--optimize: expected .glb, .gltf or .vrm, found .bvh" in capsys.readouterr().err


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


TO_Y = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # (x, y, z) -> (x, z, -y)
OVER = np.diag([1.0, -1.0, -1.0])


@pytest.fixture
def upright_recording(tmp_path):
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


def convert_one_frame(recording, out, *options):
    folder, path = recording
    files = [str(folder), "--model", str(path), "-o", str(out), "--frame", "1", *options]
    assert run(["convert", *files]) == 0


@pytest.mark.parametrize(("up", "turn"), [("z", TO_Y), ("y", np.eye(3)), ("-y", OVER)])
def test_gltf_of_one_frame_has_y_up(upright_recording, tmp_path, up, turn):
    out = tmp_path / "pose.glb"
    convert_one_frame(upright_recording, out, f"--up={up}")
    gltf = Gltf(out)
    found = gltf.vertices()[0]
    assert_allclose(found, wanted(upright_recording, up) @ turn.T, rtol=0, atol=1e-5)


def test_standing_people_are_upright_in_gltf(upright_recording, tmp_path):
    convert_one_frame(upright_recording, tmp_path / "pose.glb")  # z is detected as the up axis
    gltf = Gltf(tmp_path / "pose.glb")
    world = gltf.world()
    head, pelvis = (world[gltf.named(name), :3, 3] for name in ("head", "pelvis"))
    rest = viewer.load(upright_recording[1]).actors[0]
    joints = viewer.joint_matrices(rest.figure, rest.pose)[:, :3, 3]
    names = rest.figure.skeleton.names
    height = (joints[names.index("head")] - joints[names.index("pelvis")])[1]
    assert (head - pelvis)[1] == pytest.approx(height, rel=0.2)
    assert gltf.nodes[gltf.top(gltf.named("head"))]["name"] == "z up"


def test_other_formats_record_the_up_axis(upright_recording, tmp_path):
    convert_one_frame(upright_recording, tmp_path / "pose.obj")
    assert ": z up, metres\n" in (tmp_path / "pose.obj").read_text().partition("v ")[0]
    convert_one_frame(upright_recording, tmp_path / "pose.npz")
    with np.load(tmp_path / "pose.npz") as arrays:
        assert str(arrays["up"]) == "z"
    convert_one_frame(upright_recording, tmp_path / "over.npz", "--up=-y")
    with np.load(tmp_path / "over.npz") as arrays:
        assert str(arrays["up"]) == "y"
        found = arrays["vertices"][:, 1]
    assert_allclose(found, -heights_in_capture(upright_recording), rtol=0, atol=1e-9)


def heights_in_capture(recording):
    folder, path = recording
    (actor,) = viewer.load(folder, motion=MotionSettings(model=path, up="y")).actors
    pose_actors([actor], 1 / 30)
    return deform(actor.figure, actor.pose)[0][:, 1]


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


def converted(*arguments):
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
    converted(hanging, "--model", smpl, "-o", tmp_path / "back")
    assert ", -y up; " in capsys.readouterr().out
    for found, wanted in zip(records(tmp_path / "back"), records(hanging), strict=True):
        for key in ("Rh", "Th"):
            assert_allclose(found[key], wanted[key], atol=1e-9)


def test_amass_keeps_the_capture_values_and_round_trips(hanging, smpl, tmp_path):
    converted(hanging, "--model", smpl, "-o", tmp_path / "m.npz")
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
    converted(hanging, "--model", smpl, "-o", tmp_path / "m.npz", "--to-up", "y")
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
