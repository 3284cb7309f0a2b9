"""``viewer convert``: requested outputs, verified by independent readers."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from exporters.plain_readers import columns, read_obj, read_ply
from exporters.plain_smpl import smpl_forward
from exporters.small_rigs import ARMS_SKEL, clip_text, pose_190, write_box, write_twist
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose, assert_array_equal

from viewer.cli import run
from viewer.errors import OutputError
from viewer.exporters import EXPORTERS, obj
from viewer.formats import save_parts

DIGITS = 5e-9  # half of the ninth digit of numbers below 10
EXACT = 1e-12
SUFFIXES = ", ".join(
    {"/": "a folder for EasyMocap"}.get(suffix, suffix)
    for suffix in dict.fromkeys(s for kind in EXPORTERS.values() for s in kind.suffixes)
)
NO_MEMBER = (
    "twist cannot be written as an EasyMocap folder: expected the joints of "
    "SMPL, SMPL+H, SMPL-X or MANO, found different ones"
)
NO_FILE = "cannot be read: No such file or directory"


def write_model(folder, kind="smpl", n_vertices=48):
    arrays = model(kind, n_vertices)
    np.savez(folder / f"{kind}.npz", **arrays)
    return str(folder / f"{kind}.npz"), arrays


def arrays_of(tmp_path, *arguments):
    """Convert to ``.npz`` and return the arrays."""
    out = tmp_path / "posed.npz"
    assert run(["convert", *map(str, arguments), "-o", str(out), "--force"]) == 0
    with np.load(out) as archive:
        return dict(archive)


def listed(numbers):
    return ",".join(map(repr, np.ravel(numbers).tolist()))


# Body models


SHAPE = [1.2, -0.5, 0.0, 2.0]
POSE = 0.4 * np.sin(np.arange(72.0))


def test_smpl_parameters_are_converted_to_an_obj_in_one_command(tmp_path, capsys):
    path, arrays = write_model(tmp_path)
    out = tmp_path / "person.obj"
    options = ["--shape", "1.2,-0.5,0,2", "--pose", listed(POSE)]
    assert run(["convert", path, *options, "-o", str(out)]) == 0
    captured = capsys.readouterr()
    assert captured.out.splitlines() == [
        f"{out}: 48 vertices, 92 triangles",
        "not stored in .obj and .mtl: the skeleton, the skin, 10 blend shapes (the current "
        "shape is kept)",
    ]
    assert captured.err == ""
    obj = read_obj(out)
    assert_allclose(obj.v, smpl_forward(arrays, SHAPE, POSE)[0], rtol=0, atol=DIGITS)
    found = [[v - 1 for v, _, _ in corners] for _, corners in obj.faces]
    assert_array_equal(found, arrays["f"])
    assert_allclose(np.linalg.norm(obj.vn, axis=1), 1, rtol=0, atol=DIGITS)


@pytest.mark.parametrize("kind", ["smpl", "smplh", "smplx", "mano", "flame"])
def test_every_member_of_the_family_is_posed(tmp_path, kind):
    path, arrays = write_model(tmp_path, kind, 32)
    pose = 0.3 * np.cos(np.arange(3.0 * arrays["weights"].shape[1]))
    found = arrays_of(tmp_path, path, "--shape=-1,0.5", f"--pose={listed(pose)}")
    vertices, joints = smpl_forward(arrays, [-1, 0.5], pose)
    assert_allclose(found["vertices"], vertices, rtol=0, atol=EXACT)
    assert_allclose(found["joints"], joints, rtol=0, atol=EXACT)
    assert_allclose(found["own_numbers"], pose, rtol=0, atol=EXACT)


def test_ply_contains_the_same_mesh(tmp_path):
    path, arrays = write_model(tmp_path)
    out = tmp_path / "person.ply"
    assert run(["convert", path, "--pose", listed(POSE), "-o", str(out)]) == 0
    found = columns(read_ply(out).elements["vertex"], "x", "y", "z")
    assert_allclose(found, smpl_forward(arrays, (), POSE)[0], rtol=0, atol=1e-6)  # float32


@pytest.mark.parametrize("suffix", [".txt", ".json", ".npz"])
def test_pose_may_be_a_file(tmp_path, suffix):
    path, arrays = write_model(tmp_path)
    pose = tmp_path / f"pose{suffix}"
    if suffix == ".txt":
        pose.write_text(" ".join(map(repr, POSE.tolist())))
    elif suffix == ".json":
        pose.write_text(json.dumps({"poses": POSE.tolist(), "betas": SHAPE}))
    else:
        np.savez(pose, global_orient=POSE[:3], body_pose=POSE[3:], betas=np.array([SHAPE]))
    found = arrays_of(tmp_path, path, "--pose", pose)
    shape = [] if suffix == ".txt" else SHAPE
    assert_allclose(found["vertices"], smpl_forward(arrays, shape, POSE)[0], rtol=0, atol=EXACT)


def test_shape_option_overrides_the_pose_file(tmp_path):
    path, arrays = write_model(tmp_path)
    (tmp_path / "pose.json").write_text(json.dumps({"poses": POSE.tolist(), "betas": [9, 9]}))
    found = arrays_of(tmp_path, path, "--pose", tmp_path / "pose.json", "--shape", "1")
    assert_allclose(found["vertices"], smpl_forward(arrays, [1.0], POSE)[0], rtol=0, atol=EXACT)


def test_expression_uses_the_columns_after_the_shape(tmp_path):
    path, arrays = write_model(tmp_path, "flame", 32)
    found = arrays_of(tmp_path, path, "--shape", "1,2", "--expression", "-1.5,0,3")
    vertices, _ = smpl_forward(arrays, [1, 2, -1.5, 3], columns=[0, 1, 10, 12])
    assert_allclose(found["vertices"], vertices, rtol=0, atol=EXACT)


@pytest.mark.parametrize("which", ["mean", "flat"])
def test_hands_are_the_mean_or_flat(tmp_path, which):
    path, arrays = write_model(tmp_path, "mano", 32)
    found = arrays_of(tmp_path, path, "--hands", which)
    mean = arrays["hands_mean"] * (which == "mean")
    vertices, _ = smpl_forward(arrays, (), np.concatenate([np.zeros(3), mean]))
    assert_allclose(found["vertices"], vertices, rtol=0, atol=EXACT)


def test_pose_values_follow_the_hands(tmp_path):
    path, arrays = write_model(tmp_path, "mano", 32)
    pose = 0.1 * np.arange(48.0)
    found = arrays_of(tmp_path, path, "--hands", "mean", "--pose", listed(pose))
    assert_allclose(found["vertices"], smpl_forward(arrays, (), pose)[0], rtol=0, atol=1e-11)


def test_correctives_may_be_disabled(tmp_path):
    path, arrays = write_model(tmp_path)
    found = arrays_of(tmp_path, path, "--pose", listed(POSE), "--no-correctives")
    vertices, _ = smpl_forward(arrays, (), POSE, correct=False)
    assert_allclose(found["vertices"], vertices, rtol=0, atol=EXACT)


# DOFs and clips


def test_dofs_pose_and_place_the_figure(tmp_path):
    rig = write_twist(tmp_path)
    dofs = ["--dof", "low.z=90deg", "--dof", "figure.scale=2", "--dof", "figure.ty=10"]
    found = arrays_of(tmp_path, *rig, *dofs)
    # (1, y) is rotated to (-y, 1), doubled, and moved up by 10.
    expected = [[0, 12, 0], [-2, 12, 0], [-4, 12, 0]]
    assert_allclose(found["vertices"], expected, rtol=0, atol=EXACT)
    assert_allclose(found["joints"], [[0, 10, 0], [-2, 10, 0]], rtol=0, atol=EXACT)


@pytest.mark.parametrize(
    ("options", "x"),
    [
        (["--time", "0.5"], -1 + 0.5 * 2),  # the clip starts at 1 s and is constant before
        (["--time", "1.5"], 1),
        (["--frame", "0"], 0),
        (["--frame", "30"], 2),
        (["--frame", "15", "--fps", "10"], 3),
        (["--frame", "999999"], 4),
        (["--time", "-7"], 0),
    ],
)
def test_clip_poses_at_a_time_or_frame(tmp_path, options, x):
    rig = write_twist(tmp_path)
    (tmp_path / "move.anim").write_text(clip_text(start=1.0))
    found = arrays_of(tmp_path, *rig, tmp_path / "move.anim", *options)
    assert_allclose(found["joints"], [[x, 0, 0], [x, 1, 0]], rtol=0, atol=EXACT)


def test_mirror_swaps_the_arms(tmp_path):
    (tmp_path / "arms.skel").write_text(ARMS_SKEL)
    options = ["--dof", "left.z=0.5", "--dof", "root.tx=3", "--mirror"]
    found = arrays_of(tmp_path, tmp_path / "arms.skel", *options)
    places = dict(zip(found["joint_names"].tolist(), found["joints"], strict=True))
    c, s = math.cos(0.5), math.sin(0.5)
    assert_allclose(places["right_hand"], [-3 - 1 - c, s, 0], rtol=0, atol=EXACT)
    assert_allclose(places["left_hand"], [-3 + 2, 0, 0], rtol=0, atol=EXACT)


# Skinning

HALF = math.sqrt(0.5)


@pytest.mark.parametrize(
    ("options", "radius"),
    [
        ([], HALF),  # with LBS, the middle of a rotation by 90 degrees
        (["--method", "lbs"], HALF),
        (["--method", "dqs"], 1),
        (["--method", "mix", "--blend-factor", "0"], HALF),
        (["--method", "mix", "--blend-factor", "1"], 1),
        (["--method", "mix"], (1 + HALF) / 2),
    ],
)
def test_method_determines_the_radius_of_a_twist(tmp_path, options, radius):
    found = arrays_of(tmp_path, *write_twist(tmp_path), "--dof", "high.y=90deg", *options)
    # Both methods rotate the middle vertex by 45 degrees about y, towards -z.
    expected = [[1, 0, 0], [radius * HALF, 1, -radius * HALF], [0, 2, -1]]
    assert_allclose(found["vertices"], expected, rtol=0, atol=EXACT)


def test_influences_are_pruned_and_weights_normalised(tmp_path):
    rows = [f"0 {vertex} {0.5 if vertex == 1 else 1}" for vertex in range(7)]
    weights = "\n".join([*rows, "0 7 0.6", "1 7 0.3"])
    box = write_box(tmp_path / "box", skinning_weights=weights)
    turned = ["--pose", pose_190(6, n8=math.pi / 2)]  # joint 1 about z moves (1, 2) to (-2, 1)
    found = arrays_of(tmp_path, box, *turned)["vertices"]
    assert_allclose(found[1], [0.5, 0, 0], rtol=0, atol=EXACT)
    assert_allclose(found[7], [0.6 - 0.3 * 2, 0.6 * 2 + 0.3, 0.9 * 3], rtol=0, atol=EXACT)
    found = arrays_of(tmp_path, box, *turned, "--normalize")["vertices"]
    assert_allclose(found[1], [1, 0, 0], rtol=0, atol=EXACT)
    assert_allclose(found[7], [2 / 3 - 2 / 3, 4 / 3 + 1 / 3, 3], rtol=0, atol=EXACT)
    found = arrays_of(tmp_path, box, *turned, "--influences", "1")["vertices"]
    assert_allclose(found[7], [1, 2, 3], rtol=0, atol=EXACT)


# Files


def test_rig_is_written_from_a_body_and_read_back(tmp_path, capsys):
    path, arrays = write_model(tmp_path)
    out = tmp_path / "person.skin"
    options = ["--pose", listed(POSE), "--shape", "1", "--no-correctives"]
    assert run(["convert", path, *options, "-o", str(out)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == [f"{tmp_path / 'person.skel'}: 24 joints", f"{out}: 48 vertices"]
    (loss,) = (line for line in lines if "differ" in line)
    assert loss.endswith(": pose correctives are left out, as requested")
    found = arrays_of(tmp_path, tmp_path / "person.skel", out)
    vertices, _ = smpl_forward(arrays, [1], POSE, correct=False)
    assert_allclose(found["vertices"], vertices, rtol=0, atol=EXACT)


def test_skeletons_without_a_mesh_do_not_stop_the_other_figures(tmp_path, capsys):
    rig, bare, out = write_twist(tmp_path), tmp_path / "bare.skel", tmp_path / "out.ply"
    bare.write_text("balljoint root { balljoint tip { offset 1 0 0 } }")
    assert run(["convert", *rig, str(bare), "-o", str(out)]) == 0
    lines = capsys.readouterr().out.splitlines()
    lost = "not stored in .ply: the skeleton, the skin"
    assert lines == [f"{out}: 3 vertices, 1 triangle", lost, "bare: no mesh, not written"]
    # Alone, it is an error.
    assert run(["convert", str(bare), "-o", str(tmp_path / "bare.ply")]) == 2
    assert "figure bare has no mesh to write as .ply" in capsys.readouterr().err


def test_existing_file_is_replaced_only_with_force(tmp_path, capsys):
    rig = write_twist(tmp_path)
    out = tmp_path / "out.obj"
    out.write_text("precious")
    assert run(["convert", *rig, "-o", str(out)]) == 5
    assert capsys.readouterr().err == f"viewer: {out}: already exists (--force replaces it)\n"
    assert out.read_text() == "precious"
    assert run(["convert", *rig, "-o", str(out), "--force"]) == 0
    assert len(read_obj(out).v) == 3


@pytest.mark.parametrize("name", ["out.glb", "out.bvh", "motion/smpl/000000.json"])
def test_parts_that_are_read_late_are_checked_before_a_file_is_replaced(tmp_path, name, capsys):
    path, arrays = write_model(tmp_path)
    content, stored = Path(path).read_bytes(), arrays["posedirs"].tobytes()
    at = content.index(stored[:64]) + 32
    Path(path).write_bytes(content[:at] + b"damaged!" + content[at + 8 :])
    out = tmp_path / name
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text("precious")
    target = tmp_path / "motion" if "/" in name else out
    assert run(["convert", path, "-o", str(target), "--force"]) == 2
    assert f"{path}: posedirs" in capsys.readouterr().err
    assert out.read_text() == "precious"
    assert sorted(each.name for each in out.parent.iterdir() if each.name[0] == ".") == []


@pytest.mark.parametrize("beside", [".skel", ".skin"])
def test_either_file_of_a_rig_is_replaced_only_with_force(tmp_path, beside, capsys):
    rig = write_twist(tmp_path)
    (tmp_path / f"out{beside}").write_text("precious")
    assert run(["convert", *rig, "-o", str(tmp_path / "out.skel")]) == 5
    assert capsys.readouterr().err == (
        f"viewer: {tmp_path / f'out{beside}'}: already exists (--force replaces it)\n"
    )
    assert (tmp_path / f"out{beside}").read_text() == "precious"


def test_input_is_never_replaced(tmp_path, capsys):
    path, _ = write_model(tmp_path)
    kept = (tmp_path / "smpl.npz").read_bytes()
    (tmp_path / "link.npz").symlink_to("smpl.npz")
    pose = tmp_path / "pose.npz"
    np.savez(pose, poses=POSE)
    for out in ("smpl.npz", "link.npz", "pose.npz"):
        arguments = [path, "--pose", str(pose), "-o", str(tmp_path / out), "--force"]
        assert run(["convert", *arguments]) == 5
        assert "input files are never overwritten" in capsys.readouterr().err
    assert (tmp_path / "smpl.npz").read_bytes() == kept
    rig = write_twist(tmp_path)
    assert run(["convert", rig[1], rig[0], "-o", str(tmp_path / "twist.skin"), "--force"]) == 5
    assert "twist.skel: input files are never overwritten" in capsys.readouterr().err


def test_several_actors_are_written_to_numbered_files(tmp_path, capsys):
    first, second = write_twist(tmp_path, "a"), write_twist(tmp_path, "b")
    path, arrays = write_model(tmp_path)
    out = tmp_path / "out.obj"
    assert run(["convert", *first, *second, path, "-o", str(out)]) == 0
    lines = capsys.readouterr().out.splitlines()
    counts = [" 3 vertices, 1 triangle", " 3 vertices, 1 triangle", " 48 vertices, 92 triangles"]
    paths = [out, tmp_path / "out-2.obj", tmp_path / "out-3.obj"]
    # Each is followed by what the file cannot hold.
    assert lines[::2] == [f"{path}:{text}" for path, text in zip(paths, counts, strict=True)]
    # The placement in the scene is not exported.
    assert_array_equal(read_obj(paths[1]).v, read_obj(paths[0]).v)
    assert_allclose(read_obj(paths[2]).v, arrays["v_template"], rtol=0, atol=DIGITS)


def test_existing_numbered_file_is_refused_before_any_is_written(tmp_path, capsys):
    (tmp_path / "out-2.obj").write_text("precious")
    rigs = [*write_twist(tmp_path, "a"), *write_twist(tmp_path, "b")]
    assert run(["convert", *rigs, "-o", str(tmp_path / "out.obj")]) == 5
    assert "out-2.obj: already exists" in capsys.readouterr().err
    assert not (tmp_path / "out.obj").exists()
    assert (tmp_path / "out-2.obj").read_text() == "precious"


def test_actor_that_cannot_be_written_reverts_all_files(tmp_path, capsys, monkeypatch):
    rig = [*write_twist(tmp_path), *write_twist(tmp_path, "second")]
    (tmp_path / "out.obj").write_text("precious")
    before = sorted(tmp_path.iterdir())

    def fails_at_the_second(path, *rest):
        if path.name == "out-2.obj":
            raise OutputError(f"{path.name}: no space")
        save_parts(path, *rest)

    monkeypatch.setattr(obj, "save_parts", fails_at_the_second)
    assert run(["convert", *rig, "-o", str(tmp_path / "out.obj"), "--force"]) == 5
    captured = capsys.readouterr()
    assert captured.err == "viewer: out-2.obj: no space\n"
    assert captured.out == "" and sorted(tmp_path.iterdir()) == before
    assert (tmp_path / "out.obj").read_text() == "precious"


@pytest.mark.parametrize(
    ("out", "code", "message"),
    [
        (
            "x.fbx",
            2,
            'no exporter for ".fbx", which is only read; .glb holds figures and motions; '
            f"supported: {SUFFIXES}",
        ),
        ("x.xyz", 2, f'no exporter for ".xyz"; supported: {SUFFIXES}'),
        ("x", 2, NO_MEMBER),
        ("missing/x.obj", 5, "{folder}/missing/x.obj: the folder {folder}/missing does not exist"),
        (
            "missing/x.skel",
            5,
            "{folder}/missing/x.skel: the folder {folder}/missing does not exist",
        ),
        (
            "twist.skel/x.obj",
            5,
            "{folder}/twist.skel/x.obj: the folder {folder}/twist.skel does not exist",
        ),
    ],
)
def test_impossible_output_is_refused_in_one_line(tmp_path, capsys, out, code, message):
    rig = write_twist(tmp_path)
    before = sorted(tmp_path.iterdir())
    assert run(["convert", *rig, "-o", str(tmp_path / out)]) == code
    captured = capsys.readouterr()
    assert captured.err == f"viewer: {message.format(folder=tmp_path)}\n" and not captured.out
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("out", ["x" * 300 + ".obj", "a\0b.npz", "x" * 300 + ".skel"])
def test_invalid_output_name_is_exit_code_5(tmp_path, capsys, out):
    assert run(["convert", *write_twist(tmp_path), "-o", f"{tmp_path}/{out}"]) == 5
    error = capsys.readouterr().err
    assert error.startswith("viewer: ") and error.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["arms.skel", "-o", "x.obj"], "viewer: figure arms has no mesh to write as .obj"),
        (["arms.skel", "-o", "x.ply"], "viewer: figure arms has no mesh to write as .ply"),
        (["twist.skin", "-o", "x.skel"], "viewer: figure twist has no skeleton to write as .skel"),
        (["missing.npz", "-o", "x.obj"], "missing.npz: MISSING"),
        (["arms.skel", "--frame", "1", "-o", "x.npz"], "viewer: --frame: no file has a motion"),
        (["arms.skel", "--pose", "no.json", "-o", "x.npz"], "no.json: MISSING"),
    ],
)
def test_error_is_reported_in_one_line_without_written_files(
    tmp_path, monkeypatch, capsys, arguments, message
):
    monkeypatch.chdir(tmp_path)
    write_twist(tmp_path)
    (tmp_path / "arms.skel").write_text(ARMS_SKEL)
    before = sorted(tmp_path.iterdir())
    assert run(["convert", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.err == message.replace("MISSING", NO_FILE) + "\n" and not captured.out
    assert sorted(tmp_path.iterdir()) == before


def test_output_must_be_named(tmp_path, capsys):
    assert run(["convert", *write_twist(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert "-o/--output" in error and error.count("\n") == 1


def test_fox_is_written_if_no_files_are_given(tmp_path):
    assert run(["convert", "-o", str(tmp_path / "fox.ply")]) == 0
    assert len(read_ply(tmp_path / "fox.ply").elements["vertex"]) > 1000


def test_bundled_body_is_shaped_and_written(tmp_path):
    plain = arrays_of(tmp_path, "--body")
    shaped = arrays_of(tmp_path, "--body", "--shape", "2")
    assert len(plain["joints"]) == 24 and str(plain["name"]) == "body"
    assert np.abs(shaped["vertices"] - plain["vertices"]).max() > 0.005
