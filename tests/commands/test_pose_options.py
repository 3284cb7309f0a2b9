"""Invalid shape, pose and skinning options, refused in one line with the expected value."""

import json

import numpy as np
import pytest
from exporters.small_rigs import ARMS_SKEL, LOPSIDED_SKEL, clip_text, write_box, write_twist
from formats.synthetic_smpl import model

from viewer.cli import run
from viewer.rigs.scalars import SCALARS

pytestmark = pytest.mark.slow


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Figures of all kinds in the current folder."""
    monkeypatch.chdir(tmp_path)
    write_twist(tmp_path)
    write_box(tmp_path / "pig")
    np.savez(tmp_path / "smpl.npz", **model("smpl", 32))
    np.savez(tmp_path / "mano.npz", **model("mano", 32))
    (tmp_path / "arms.skel").write_text(ARMS_SKEL)
    (tmp_path / "lopsided.skel").write_text(LOPSIDED_SKEL)
    (tmp_path / "move.anim").write_text(clip_text())
    return tmp_path


def refused(capsys, *arguments):
    """Return the single line with which ``info`` ends."""
    assert run(["info", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.count("\n") == 1
    return captured.err.removesuffix("\n")


def described(capsys, *arguments):
    """Return the ``info --json`` entry of the first actor, and the warnings."""
    assert run(["info", *arguments, "--json"]) == 0
    captured = capsys.readouterr()
    return json.loads(captured.out)["actors"][0], captured.err.splitlines()


NUMBERS_WANTED = "expected numbers separated by commas, found"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        # Shape and expression
        ("smpl.npz --shape fat", f'--shape: {NUMBERS_WANTED} "fat"'),
        ("smpl.npz --shape 1,,2", f'--shape: {NUMBERS_WANTED} "1,,2"'),
        ("smpl.npz --shape=", f'--shape: {NUMBERS_WANTED} ""'),
        ("smpl.npz --shape 1,nan", f'--shape: {NUMBERS_WANTED} "1,nan"'),
        ("smpl.npz --shape 1,inf", f'--shape: {NUMBERS_WANTED} "1,inf"'),
        ("smpl.npz --shape 1;2", f'--shape: {NUMBERS_WANTED} "1;2"'),
        (
            "smpl.npz --shape 0,0,0,0,0,0,0,0,0,0,1",
            "--shape: smpl has 10 shape coefficients, found 11",
        ),
        ("smpl.npz --expression 1", "--expression: smpl has 0 expression coefficients, found 1"),
        ("smpl.npz --expression smile", f'--expression: {NUMBERS_WANTED} "smile"'),
        ("arms.skel --shape 1", "--shape: arms has 0 shape coefficients, found 1"),
        ("twist.skin --shape 1", "--shape: no file has a skeleton"),
        # Poses
        ("smpl.npz --pose 1,2,3", "--pose: expected 72 pose values for smpl, found 3"),
        ("mano.npz --pose 1,2,3", "--pose: expected 48 pose values for mano, found 3"),
        ("pig --pose 1,2", "--pose: expected 22 pose values for pig, found 2"),
        ("arms.skel --pose 1", "--pose: expected 18 pose values for arms, found 1"),
        ("smpl.npz --pose 1,,2", f'--pose: {NUMBERS_WANTED} "1,,2"'),
        ("smpl.npz --pose 1-2", f'--pose: {NUMBERS_WANTED} "1-2"'),
        ("twist.skin --pose 1,2", "--pose: no file has a skeleton"),
        # DOFs
        (
            "arms.skel --dof knee.x=1",
            '--dof: no joint is called "knee"; there are 5: root, left, left_hand, right, '
            "right_hand",
        ),
        ("arms.skel --dof left.tx=1", "--dof: joint left has no DOF tx; it has x, y, z"),
        (
            "arms.skel --dof left_hnd.x=1",
            '--dof: no joint is called "left_hnd"; did you mean left_hand?',
        ),
        # The suggestion comes from the figure with a similar joint.
        (
            "smpl.npz arms.skel --dof left_hnad.x=1",
            '--dof: no joint is called "left_hnad"; did you mean left_hand?',
        ),
        ("arms.skel --dof left.x", '--dof: expected NAME.X=VALUE, found "left.x"'),
        ("arms.skel --dof left.x=far", '--dof: expected a number after "=", found "left.x=far"'),
        (
            "arms.skel --dof figure.scale=0",
            "--dof: scale: expected a positive number, found 0",
        ),
        ("arms.skel --dof figure.scale=-1", "--dof: scale: expected a positive number, found -1"),
        (
            "arms.skel --dof figure.scale=big",
            '--dof: expected a number after "=", found "figure.scale=big"',
        ),
        (
            "arms.skel --dof figure.rx=1",
            '--dof: "figure.rx": expected JOINT.KIND with KIND one of tx, ty, tz, x, y, z',
        ),
        # Clips
        ("arms.skel --frame 1", "--frame: no file has a motion"),
        ("twist.skel move.anim --frame -1", "--frame: expected 0 or more, found -1"),
        (
            "twist.skel move.anim --frame 1 --fps 0",
            "argument --fps: expected 0.001 to 100,000 frames per second, found 0 "
            "(viewer info --help lists the options)",
        ),
        (
            "twist.skel move.anim --frame 1 --time 1",
            "--frame and --time: expected one of them, found both",
        ),
        # Skinning
        ("smpl.npz --blend-factor -0.1", "--blend-factor: expected 0 to 1, found -0.1"),
        ("smpl.npz --blend-factor 1.5", "--blend-factor: expected 0 to 1, found 1.5"),
        ("smpl.npz --influences -1", "--influences: expected 0 or more, found -1"),
        # Hands, mirror
        ("smpl.npz --hands mean", "--hands: no file has hand components"),
        ("arms.skel --hands flat", "--hands: no file has hand components"),
        (
            "lopsided.skel --mirror",
            "--mirror: left has no mirror counterpart: the skeleton is not symmetric",
        ),
    ],
)
def test_invalid_value_is_refused_in_one_line(folder, capsys, arguments, message):
    assert refused(capsys, *arguments.split(" ")) == f"viewer: {message}"


@pytest.mark.parametrize(
    "arguments",
    [
        "--method cubic",
        "--hands fist",
        "--influences many",
        "--blend-factor half",
        "--blend-factor nan",
        "--frame 1.5",
        "--fps fast",
        "--time soon",
        "--pose",
        "--shape",
    ],
)
def test_value_of_the_wrong_type_refers_to_the_help(folder, capsys, arguments):
    line = refused(capsys, "smpl.npz", *arguments.split(" "))
    assert arguments.split(" ")[0] in line and "--help" in line


@pytest.mark.parametrize("command", ["render", "convert", "view"])
@pytest.mark.parametrize("options", ["--influences -1", "--shape fat", "--dof nose.x=1"])
def test_every_command_refuses_invalid_values_equally(
    folder, capsys, monkeypatch, command, options
):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    out = {"render": ["-o", "x.png"], "convert": ["-o", "x.obj"], "view": []}[command]
    before = sorted(folder.iterdir())
    assert run([command, "smpl.npz", *options.split(" "), *out]) == 2
    expected = capsys.readouterr().err
    assert expected == refused(capsys, "smpl.npz", *options.split(" ")) + "\n"
    assert sorted(folder.iterdir()) == before


def test_long_invalid_input_is_truncated(folder, capsys):
    assert len(refused(capsys, "smpl.npz", "--shape", "x" * 10_000)) < 200


def test_trailing_zero_coefficients_are_accepted(folder, capsys):
    actor, notes = described(capsys, "smpl.npz", "--shape", "1" + 15 * ",0")
    assert actor["model"]["shape_weights"] == [1, 0, 0, 0, 0, 0, 0, 0, 0, 0] and notes == []


@pytest.mark.parametrize("text", ["1,-2", "1 -2", " 1, -2 ", "1,-2,", "+1,-2e0"])
def test_numbers_may_use_any_notation(folder, capsys, text):
    actor, _ = described(capsys, "smpl.npz", f"--shape={text}")
    assert actor["model"]["shape_weights"][:3] == [1, -2, 0]


def test_leading_negative_number_is_not_an_option(folder, capsys):
    actor, _ = described(capsys, "smpl.npz", "--shape", "-1,2")
    assert actor["model"]["shape_weights"][:2] == [-1, 2]


def test_dofs_beyond_limits_are_clamped_with_a_note(folder, capsys):
    (folder / "hinge.skel").write_text("balljoint hinge { rotxlimit -1 0.5 rotylimit 0 0 }")
    actor, notes = described(capsys, "hinge.skel", "--dof", "hinge.x=2", "--dof", "hinge.y=1")
    assert notes == [
        "warning: hinge.x=2 is clamped to its limits -1 to 0.5 rad",
        "warning: hinge.y=1 is locked at 0 rad",
    ]
    assert actor["skeleton"]["dof_table"][3]["value"] == 0.5


def test_pose_values_beyond_limits_are_clamped_with_a_note(folder, capsys):
    (folder / "hinge.skel").write_text("balljoint hinge { rotxlimit -1 0.5 }")
    actor, notes = described(capsys, "hinge.skel", "--pose", "0,0,0,2,0,0")
    assert actor["skeleton"]["dof_table"][3]["value"] == 0.5
    assert notes == ["note: 1 DOF of the pose clamped to its limits"]


def test_figure_can_be_placed_by_dofs(folder, capsys):
    options = ["--dof", "figure.tx=1.5", "--dof", "FIGURE.tz=-2", "--dof", "figure.scale=0.5"]
    actor, _ = described(capsys, "smpl.npz", *options)
    assert actor["model"]["figure_translation"] == [1.5, 0, -2]
    assert actor["model"]["figure_scale"] == 0.5


def test_first_compatible_figure_is_posed(folder, capsys):
    assert run(["info", "arms.skel", "smpl.npz", "--shape", "1", "--json"]) == 0
    actors = json.loads(capsys.readouterr().out)["actors"]
    assert actors[1]["model"]["shape_weights"][0] == 1


# Display options


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            "pig --hide-part TAIL",
            '--hide-part: no part is called "TAIL"; there are 3: NOT_BODY, FEET, BACK',
        ),
        ("pig --hide-part FEAT", '--hide-part: no part is called "FEAT"; did you mean FEET?'),
        ("smpl.npz --hide-part HEAD", "--hide-part: no figure has parts"),
        ("arms.skel --hide-part HEAD", "--hide-part: no figure has parts"),
    ],
)
def test_unknown_part_is_refused_before_rendering(folder, capsys, arguments, message):
    assert run(["render", *arguments.split(" "), "-o", "x.png"]) == 2
    assert capsys.readouterr().err == f"viewer: {message}\n"
    assert not (folder / "x.png").exists()


@pytest.mark.parametrize(
    ("option", "known"), [("--scalar", SCALARS), ("--shading", ["phong", "parts", "scalar"])]
)
def test_unknown_view_lists_available_views(folder, capsys, option, known):
    assert run(["render", "pig", option, "beauty", "-o", "x.png"]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"viewer: argument {option}: ") and error.count("\n") == 1
    assert all(name in error for name in known)


# Pose files that are invalid or for another figure


POSES = {
    "unknown joint": (
        "arms.skel",
        "p.json",
        '{"dofs": {\n"left.x": 1,\n"left_hnd.y": 2}}',
        3,
        ('"left_hnd.y"', "left_hand"),
    ),
    "unknown DOF": ("arms.skel", "p.json", '{"dofs": {\n\n"left.tx": 1}}', 3, ("x, y, z",)),
    "too few numbers": ("smpl.npz", "p.json", '{\n"poses": [1,\n2]}', 2, ("72", "2")),
    "too long a part": ("smpl.npz", "p.json", '{"betas": [1],\n"body_pose": [1, 2]}', 2, ("2",)),
    "a huge coefficient": ("smpl.npz", "p.json", '{"betas":\n[1, 1e9]}', 2, ("1e+09",)),
    "a text for a number": ("smpl.npz", "p.json", '{"betas": [1,\n2,\n"3"]}', 3, ("'3'",)),
    "an infinite number": ("smpl.npz", "p.json", '{"betas": [1,\n1e999]}', 2, ("inf",)),
    "no number": ("smpl.npz", "p.json", '{"betas": [1,\n\nNaN]}', 3, ("NaN",)),
    "a key twice": ("smpl.npz", "p.json", '{"betas": [1],\n"betas": [2]}', 2, ('"betas"',)),
    "a mistyped key": ("smpl.npz", "p.json", '{"viewer_pose": 1,\n"beta": [1]}', 2, ("betas",)),
    "too few in a text": ("smpl.npz", "p.txt", "1 2 3\n4 5 6\n\n", 2, ("72", "6")),
    "no number in a text": ("smpl.npz", "p.txt", "1 2 3\n4 up 6\n", 2, ('"up"',)),
}


@pytest.mark.parametrize("case", POSES)
@pytest.mark.parametrize("option", [["--pose"], []], ids=["pose", "files"])
def test_pose_file_is_refused_with_its_line(folder, capsys, case, option):
    figure, name, text, line, words = POSES[case]
    (folder / name).write_text(text)
    said = refused(capsys, figure, *option, name)
    assert said.startswith(f"{name}:{line}: ") and "expected" in said and "found" in said
    assert all(word in said for word in words)


def test_pose_archive_is_refused_with_its_key(folder, capsys):
    np.savez(folder / "p.npz", dofs=np.ones(1), dof_names=np.array(["left_hnd.x"]))
    said = refused(capsys, "arms.skel", "--pose", "p.npz")
    assert said.startswith("p.npz: expected ") and "did you mean left_hand?" in said
    np.savez(folder / "q.npz", poses=np.ones(3))
    assert refused(capsys, "arms.skel", "--pose", "q.npz").startswith("q.npz: expected 18 ")


def test_mistyped_key_among_valid_ones_is_a_warning_with_its_line(folder, capsys):
    (folder / "p.json").write_text('{"betas": [1],\n"trnsl": [1, 2, 3]}')
    _, said = described(capsys, "smpl.npz", "--pose", "p.json")
    assert len(said) == 1 and said[0].startswith("note: p.json:2: ")
    assert "trnsl (did you mean transl?)" in said[0]


@pytest.mark.parametrize(
    ("text", "found"),
    [("[]", "an empty list"), ("[{}]", "a list of length 1"), ("[[1, 2]]", "a list of")],
)
def test_pose_file_with_a_list_is_refused_as_a_pose(folder, capsys, text, found):
    (folder / "list.json").write_text(text)
    message = refused(capsys, "smpl.npz", "--pose", "list.json")
    assert message.startswith(
        "list.json:1: expected a pose (an object with named values), found " + found
    )


@pytest.mark.parametrize(
    ("files", "warnings"),
    [
        ("arms.skel", ["warning: --method: no figure has a skin, so it has no effect"]),
        ("twist.skel twist.skin", []),
    ],
)
def test_method_without_a_skin_is_a_warning(folder, capsys, files, warnings):
    assert described(capsys, *files.split(), "--method", "dqs")[1] == warnings
