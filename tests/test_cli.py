"""The command line as a program: exit codes, one-line messages, signals, pipes, imports."""

import gc
import io
import os
import signal
import stat
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest
from children import listening

import viewer
from viewer.cli import run

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[1]
QUICK = ("--size", "40x30", "--quality", "draft")
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "error"}
COMMAND = [sys.executable, "-m", "viewer"]


def call(*arguments, cwd=None, environment=None, **settings):
    settings = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "timeout": 60, **settings}
    variables = {**ENVIRONMENT, **(environment or {})}
    return subprocess.run([*COMMAND, *arguments], cwd=cwd, env=variables, check=False, **settings)


def _refused(done, code, *words):
    lines = done.stderr.decode("utf-8", "replace").splitlines()
    assert done.returncode == code, lines
    assert len(lines) == 1 and ": " in lines[0], lines
    assert all(word in lines[0] for word in words), lines


def test_garbage_collection_is_enabled_once_the_program_has_started(rig, capsys):
    frozen = gc.get_freeze_count()
    assert run(["info", str(rig[0])]) == 0
    assert gc.get_freeze_count() <= frozen  # collection was not suspended
    gc.disable()
    try:
        assert run(["info", str(rig[0])]) == 0
        assert gc.isenabled()
        assert gc.get_freeze_count() > frozen
    finally:
        gc.enable()


def test_help_and_version():
    done = call("--help")
    assert done.returncode == 0 and not done.stderr
    assert all(word in done.stdout.decode() for word in ("render", "info", "doctor", "exit codes"))
    assert call("--version").stdout.decode() == f"viewer {viewer.__version__}\n"


@pytest.mark.parametrize("command", ["view", "render", "info"])
def test_help_of_a_command(command, capsys):
    with pytest.raises(SystemExit) as stop:
        run([command, "--help"])
    assert stop.value.code == 0
    assert "--dof" in capsys.readouterr().out


@pytest.mark.parametrize(
    "arguments",
    [
        ["render"],
        ["render", "-o"],
        ["render", "-o", "x.png", "--nonsense"],
        ["render", "-o", "x.png", "--show", "bones"],
        ["render", "-o", "x.png", "--azimuth", "left"],
        ["render", "-o", "x.png", "--azimuth", "nan"],
        ["render", "-o", "x.png", "--samples", "many"],
        ["info", "--nonsense"],
        ["view", "--scale", "0"],
        ["view", "--scale", "nan"],
        ["view", "--scale", "-1"],
        ["view", "--scale", "9e9"],
    ],
)
def test_usage_error_is_one_line(arguments, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(arguments) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("viewer: ") and captured.err.count("\n") == 1
    assert "--help" in captured.err and not captured.out


@pytest.mark.parametrize("words", [["--up", "-z"], ["--up=-z"], ["--up", "-y"]])
def test_negative_axis_may_follow_a_space(words, rig, capsys):
    assert run(["info", *words, *map(str, rig)]) == 0
    # The axis has been understood, and no file of a rig needs one.
    axis = words[-1][-2:]
    told = "no effect: no file is a capture, BVH, OBJ or PLY"
    assert capsys.readouterr().err == f"note: --up {axis} has {told}\n"


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("rendr", "render"),
        ("infoo", "info"),
        ("Lint", "lint"),
        ("doctr", "doctor"),
        ("vew", "view"),
    ],
)
def test_mistyped_command_suggests_the_nearest_name(word, meant, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for rest in ([], ["x.skel"], ["x.skel", "-o", "y.png"]):
        assert run([word, *rest]) == 2
        said = capsys.readouterr().err
        assert f'"{word}"; did you mean {meant}?' in said and said.count("\n") == 1


def test_word_unlike_any_command_is_treated_as_a_file(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    # A word unlike any command, with a suffix, or in a folder; the last case below is an existing
    # file.
    for word in ("walk", "rendr.skel", "./rendr"):
        assert run([word]) == 2
        said = capsys.readouterr().err
        assert said.startswith(f"{word.removeprefix('./')}: ") and "command" not in said
    Path("infoo").write_text("")
    assert run(["infoo"]) == 2
    assert capsys.readouterr().err.startswith("infoo: expected a ")


@pytest.mark.parametrize(
    ("arguments", "unknown", "meant"),
    [
        (["render", "--sise", "4x4"], "--sise", "--size"),  # -o is missing too
        (["render", "--ouput=x.png"], "--ouput", "--output"),
        (["convert", "--frams", "0:2"], "--frams", "--frames"),
        (["rig", "--form", "fox"], "--form", "--from"),
        (["diff", "--toleranse", "1"], "--toleranse", "--tolerance"),
        (["lint", "--jsn"], "--jsn", "--json"),
        (["info", "--metod", "x"], "--metod", "--method"),
        (["--ply"], "--ply", "--play"),
        (["render", "--skeleton"], "--skeleton", "--show skeleton?"),
        (["doctor", "--hlp"], "--hlp", "--help"),
    ],
)
def test_unknown_option_is_reported_first_with_the_nearest_name(arguments, unknown, meant, capsys):
    assert run(arguments) == 2
    said = capsys.readouterr().err
    assert f"option {unknown}; did you mean {meant}" in said and "required" not in said


def test_unknown_option_names_the_commands_that_have_it(capsys):
    assert run(["lint", "wasp.skel", "--fix"]) == 2
    assert "option --fix; it is an option of viewer convert (" in capsys.readouterr().err


def test_unknown_short_options_are_refused_and_abbreviations_accepted(capsys, rig, tmp_path):
    assert run(["render", "-x"]) == 2
    assert "unknown option -x (" in capsys.readouterr().err
    picture = str(tmp_path / "x.png")
    for output in ([f"-o{picture}"], ["--outp", picture, "--force"]):
        assert run(["render", *map(str, rig), *output, "--size=8x8"]) == 0


@pytest.mark.parametrize(
    ("arguments", "choices", "meant"),
    [
        (["render", "--shading", "phonk"], "phong, pbr, matcap, normals, ", "phong"),
        (["info", "--method", "dbs"], "lbs, dqs, mix", "lbs or dqs"),
        (["lint", "--fail-on", "warn"], "error, warning, note, never", "warning"),
        (["rig", "--scale", "unifrom"], "uniform, ", "uniform"),
        (["convert", "--as", "gtlf"], "gltf", "gltf"),
    ],
)
def test_unknown_value_lists_choices_and_suggests_the_nearest(arguments, choices, meant, capsys):
    assert run(arguments) == 2
    said = capsys.readouterr().err
    assert choices in said and f'"{arguments[-1]}"; did you mean {meant}?' in said


def test_invalid_file_is_one_line_with_its_location(tmp_path):
    bad = tmp_path / "bad.skel"
    bad.write_text("balljoint root {\n offset 1 2\n}\n")
    for command in (["info"], ["render", "-o", str(tmp_path / "x.png")], ["view"]):
        _refused(call(*command, bad), 2, "bad.skel:")
    assert not (tmp_path / "x.png").exists()


def test_missing_opengl_is_exit_code_4(rig, tmp_path):
    done = call(
        "render", *rig, "-o", tmp_path / "x.png",
        environment={"__EGL_VENDOR_LIBRARY_FILENAMES": "/nonexistent"},
    )  # fmt: skip
    _refused(done, 4)


def test_info_into_a_closed_pipe_is_silent(rig):
    line = f"{sys.executable} -m viewer info {rig[0]} --json | head -1; echo ${{PIPESTATUS[0]}}"
    done = subprocess.run(
        ["bash", "-c", line], env=ENVIRONMENT, capture_output=True, timeout=60, check=False
    )
    assert done.stdout == b"{\n0\n" and done.stderr == b""


def test_pipe_closed_before_anything_is_written_is_silent(rig):
    process = subprocess.Popen(
        [*COMMAND, "info", *rig], env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    process.stdout.close()
    assert process.stderr.read() == b""
    process.stderr.close()
    assert process.wait(30) == 0


def test_terminal_without_unicode_is_not_an_error(tmp_path):
    path = tmp_path / "f.skel"
    path.write_text("balljoint Küken { pose 1 0 0 }")
    done = call("info", path, environment={"PYTHONIOENCODING": "ascii"})
    assert done.returncode == 0 and rb"K\xfcken" in done.stdout


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)], ids=["term", "int"]
)
def test_signal_while_writing_leaves_no_temporary_file(rig, tmp_path, number, code):
    # The program signals itself as soon as the temporary file is complete.
    program = (
        "import os, sys, viewer.media.saving, viewer.cli\n"
        f"os.fsync = lambda handle: os.kill(os.getpid(), {int(number)})\n"
        "sys.exit(viewer.cli.run(sys.argv[1:]))\n"
    )
    folder = tmp_path / "out"
    folder.mkdir()
    done = subprocess.run(
        listening("-c", program, "render", *rig, "-o", folder / "x.png", *QUICK),
        env=ENVIRONMENT, capture_output=True, timeout=60, check=False,
    )  # fmt: skip
    _refused(done, code)
    assert list(folder.iterdir()) == []


def test_sigterm_ends_a_waiting_program(rig, tmp_path):
    pipe = tmp_path / "pipe.png"
    os.mkfifo(pipe)
    # At this point the program is waiting for a reader of the pipe, or is about to wait.
    program = (
        "import os, sys, threading, viewer.media.saving as save, viewer.cli\n"
        "write = save.save_parts\n"
        "def waiting(*given, **named):\n"
        "    threading.Timer(0.5, os.kill, [os.getpid(), 15]).start()\n"
        "    write(*given, **named)\n"
        "save.save_parts = waiting\n"
        "sys.exit(viewer.cli.run(sys.argv[1:]))\n"
    )
    done = subprocess.run(
        listening("-c", program, "render", *rig, "-o", pipe, *QUICK),
        env=ENVIRONMENT, capture_output=True, timeout=100, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr, done.stdout) == (143, b"viewer: terminated\n", b"")
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def _asked(*arguments) -> tuple[int, str, str]:
    """Return exit code, output and errors of a command in this process."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        code = run(arguments)
    return code, out.getvalue(), err.getvalue()


def _asked_of_program(*arguments) -> tuple[int, str, str]:
    """Return the same of a program of its own, which decodes its arguments itself."""
    done = call(*map(os.fsencode, arguments))
    return done.returncode, os.fsdecode(done.stdout), os.fsdecode(done.stderr)


NAMES = ["with blank", "quo'te\"s", "{x} %s %(a)d", "new\nline", "-1", "umläut"]
UNDECODABLE = os.fsdecode(b"un\xffdecodable")


@pytest.mark.parametrize("name", [*NAMES, UNDECODABLE], ids=ascii)
def test_unusual_file_names_are_accepted(tmp_path, name):
    # Only the decoding of arguments and the encoding of output need a program.
    ask = _asked_of_program if name == UNDECODABLE else _asked
    path, out = tmp_path / f"{name}.skel", tmp_path / f"{name}.png"
    path.write_text("balljoint root { pose 1 0 0 }")
    code, _, problems = ask("info", str(path))
    assert code == 0 and not problems
    code, told, _ = ask("render", str(path), "--output", str(out), *QUICK)
    assert code == 0 and told.count("\n") == 1 and out.is_file()
    path.write_text("balljoint root { pose 1 0 }")
    code, _, problems = ask("info", str(path))
    assert code == 2 and problems.count("\n") == 1 and ": " in problems


def test_files_after_two_dashes_may_begin_with_a_dash(tmp_path):
    (tmp_path / "-1.skel").write_text("balljoint root { }")
    assert call("info", "--", "-1.skel", cwd=tmp_path).returncode == 0


@pytest.mark.parametrize("command", ["render", "info"])
def test_headless_commands_import_no_interface(rig, tmp_path, command):
    program = (
        "import sys, viewer.cli\n"
        "code = viewer.cli.run(sys.argv[1:])\n"
        "interface = {'imgui_bundle', 'glfw', 'scipy', 'hypothesis'}\n"
        "heavy = (interface | {'viewer.rendering.recorder'}) & set(sys.modules)\n"
        "assert not heavy, heavy\n"
        "sys.exit(code)\n"
    )
    extra = ["-o", tmp_path / "x.png", *QUICK] if command == "render" else []
    done = subprocess.run(
        [sys.executable, "-c", program, command, *rig, *extra],
        env=ENVIRONMENT, capture_output=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_program_runs_from_any_folder_without_files(tmp_path):
    done = call("render", "-o", "fox.png", *QUICK, cwd=tmp_path)
    assert done.returncode == 0 and done.stdout.startswith(b"fox.png: 40 x 30")


def test_info_needs_files(capsys):
    assert run(["info"]) == 2
    said = capsys.readouterr()
    assert "FILES" in said.err and said.err.count("\n") == 1 and not said.out
    assert run(["info", "--body"]) == 0


@pytest.mark.parametrize("command", ["diff", "rig"])
def test_other_commands_without_files_name_the_missing_argument(command, capsys):
    assert run([command]) == 2
    assert {"diff": "REFERENCE", "rig": "TARGET"}[command] in capsys.readouterr().err
