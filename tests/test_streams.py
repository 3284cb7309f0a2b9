"""Standard streams that are closed, full, redirected or without a reader: one line at most."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from viewer.errors import OutputError
from viewer.formats import all_or_none, save_bytes
from viewer.media.saving import Replacement
from viewer.streams import is_stdout, standard_streams

ROOT = Path(__file__).resolve().parents[1]
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "error"}
FULL = Path("/dev/full")
SMALL = "--size 64x64 --quality draft"
NAMES = ["/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not Path(NAMES[0]).exists(), reason="no name for the output stream"),
]


def shell(line: str, *words: str, folder: Path | None = None) -> subprocess.CompletedProcess:
    """Run a line of bash in which ``viewer`` is the program and ``"$@"`` are given arguments."""
    line = line.replace("viewer", f'"{sys.executable}" -m viewer')
    return subprocess.run(
        ["bash", "-c", line, "bash", *words],
        env=ENVIRONMENT, cwd=folder, capture_output=True, timeout=120, check=False,
    )  # fmt: skip


def refused(done: subprocess.CompletedProcess, *words: str) -> None:
    """Assert that one line reports that the output cannot be written."""
    lines = done.stderr.decode().splitlines()
    assert done.returncode == 5 and len(lines) == 1, lines
    assert all(word in lines[0] for word in words), lines


@pytest.mark.parametrize("name", NAMES)
def test_image_to_a_closed_output_is_refused(rig, name):
    refused(shell(f'viewer render "$@" -o {name} {SMALL} >&-', *rig), name)


@pytest.mark.parametrize(
    "command",
    [
        'convert "$@" -o /dev/stdout',
        'convert "$@" -o link.obj',
        'convert "$@" -o link.json',
        'diff "$1" "$1" -o /dev/fd/1',
        'rig "$2" -o /dev/stdout',
        'rig "$2" -o link.npz',
        'render "$@" --turntable --contact-sheet 2 --quality draft -o link.png',
    ],
)
def test_every_command_refuses_a_closed_output(rig, tmp_path, command):
    for suffix in (".obj", ".json", ".npz", ".png"):
        (tmp_path / f"link{suffix}").symlink_to("/dev/stdout")
    done = shell(f"viewer {command} >&-", *rig, folder=tmp_path)
    refused(done, "link" if "link" in command else "/dev/", "closed")


@pytest.mark.skipif(not FULL.exists(), reason="only Linux has /dev/full")
@pytest.mark.parametrize(
    "command",
    [
        "--help",
        "--version",
        "render --help",
        "doctor --help",
        'info "$@"',
        'info "$@" --json',
        'lint "$@" --fail-on never',
        'diff "$1" "$1" --json',
        f'render "$@" {SMALL} -o /dev/stdout',
    ],
)
def test_full_output_is_refused(rig, command):
    refused(shell(f"viewer {command} >/dev/full", *rig), "No space left on device")


# Each command and each redirection once; all redirections for help, which argparse prints, and for
# a report, which the command prints.
@pytest.mark.parametrize("redirection", [">&-", "<&- >&-", "| true; exit ${PIPESTATUS[0]}"])
@pytest.mark.parametrize("command", ["--help", 'diff "$1" "$1" --json'])
def test_text_to_a_closed_stream_is_not_an_error(rig, command, redirection):
    done = shell(f"viewer {command} {redirection}", *rig)
    assert (done.returncode, done.stdout, done.stderr) == (0, b"", b"")


@pytest.mark.parametrize("command", ["--version", "render --help", 'info "$@"'])
def test_text_to_a_pipe_without_a_reader_is_not_an_error(rig, command):
    done = shell(f"viewer {command} | true; exit ${{PIPESTATUS[0]}}", *rig)
    assert (done.returncode, done.stdout, done.stderr) == (0, b"", b"")


@pytest.mark.parametrize("sink", ["&-", "/dev/full"])
def test_closed_error_stream_does_not_change_results(rig, tmp_path, sink):
    done = shell(f"viewer info missing.skel 2>{sink}", *rig)
    assert (done.returncode, done.stdout) == (2, b"")
    target = tmp_path / "x.bmp"
    # A warning states that BMP is opaque.
    line = f'viewer render "$@" -o "{target}" {SMALL} --background transparent'
    assert b"transparency" in shell(line, *rig).stderr
    done = shell(f"{line} --force 2>{sink}", *rig)
    assert done.returncode == 0 and done.stdout.startswith(os.fsencode(target))


def test_image_with_all_streams_closed_is_complete(rig, tmp_path):
    target = tmp_path / "x.png"
    done = shell(f'viewer render "$@" {SMALL} -o "{target}" <&- >&- 2>&-', *rig)
    assert done.returncode == 0 and target.read_bytes().endswith(b"IEND\xaeB`\x82")


@pytest.mark.parametrize(
    ("options", "name", "begin"),
    [
        ("", "/dev/stdout", b"\x89PNG"),
        ("--turntable --contact-sheet 2", "/dev/stdout", b"\x89PNG"),
        ("", "link.bmp", b"BM"),
    ],
)
def test_redirected_file_is_appended_to(rig, tmp_path, options, name, begin):
    """It must not be replaced by an image, as a file of that name would be."""
    (tmp_path / "link.bmp").symlink_to("/dev/stdout")
    log = tmp_path / "log"
    log.write_bytes(b"precious\n")
    line = f'viewer render "$@" {options} {SMALL} -o {name} >> log'
    done = shell(line, *rig, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert log.read_bytes().startswith(b"precious\n" + begin)
    # The message about the output is written to the stream without the image.
    assert done.stderr.startswith(os.fsencode(name)) and done.stderr.count(b"\n") == 1
    assert os.fsencode(name) not in log.read_bytes()


def test_mesh_to_a_pipe_is_the_only_output(rig, tmp_path):
    (tmp_path / "link.obj").symlink_to("/dev/stdout")
    done = shell('viewer convert "$@" -o link.obj | cat', *rig, folder=tmp_path)
    assert done.returncode == 0 and done.stdout.startswith(b"# ")
    kinds = {line.partition(b" ")[0] for line in done.stdout.splitlines()}
    assert kinds <= {b"#", b"o", b"v", b"vt", b"vn", b"f", b"mtllib", b"usemtl"}


def test_pipe_without_a_reader_is_not_an_error(rig):
    done = shell(
        'viewer render "$@" --turntable --contact-sheet 2 --quality draft -o /dev/stdout | true; '
        "exit ${PIPESTATUS[0]}",
        *rig,
    )
    assert done.returncode == 0 and b"Broken pipe" not in done.stderr


def test_names_of_the_output_stream(tmp_path):
    (tmp_path / "first").symlink_to("/dev/stdout")
    (tmp_path / "second").symlink_to("first")
    (tmp_path / "loop").symlink_to("loop")
    assert all(map(is_stdout, [*NAMES, tmp_path / "first", tmp_path / "second"]))
    others = ["/dev/null", "/dev/fd/2", tmp_path / "loop", tmp_path / "missing", "a\0b"]
    assert not any(map(is_stdout, others))


def test_output_stream_is_not_checked_for_replacement(tmp_path, capsysbinary):
    link = tmp_path / "x.mp4"
    link.symlink_to("/dev/stdout")
    with pytest.raises(OutputError, match="regular file"):
        Replacement(link)
    with pytest.raises(OutputError, match="full"), all_or_none([link]):
        save_bytes(link, b"data")
        raise OutputError("full")
    assert capsysbinary.readouterr().out == b"data"
    assert [path.name for path in tmp_path.iterdir()] == ["x.mp4"]


def test_streams_of_the_caller_are_restored(monkeypatch):
    before = sys.stderr
    with standard_streams():
        assert sys.stderr is not before
    assert sys.stderr is before
    monkeypatch.setattr(sys, "stderr", None)
    with standard_streams():
        print("dropped", file=sys.stderr)
    assert sys.stderr is None


def test_reserved_descriptors_are_released():
    program = (
        "import os\n"
        "from viewer.streams import standard_streams\n"
        "with standard_streams():\n"
        "    assert os.dup(0) > 2 and os.fstat(1) and os.fstat(2)\n"
        "free = os.open(os.devnull, os.O_RDONLY)\n"
        "os._exit(0 if free == 0 else 1)\n"
    )
    line = 'exec "$1" -c "$2" <&- >&- 2>&-'
    assert shell(line, sys.executable, program).returncode == 0


@pytest.mark.parametrize("suffix", [".anim", ".skel", ".bvh"])
def test_results_match_the_output_sent_to_a_pipe(rig, tmp_path, suffix):
    """A pipe cannot be reopened to be read back."""
    (tmp_path / f"link{suffix}").symlink_to("/dev/stdout")
    done = shell(
        f'set -o pipefail; viewer convert "$1" -o link{suffix} | cat', rig[0], folder=tmp_path
    )
    assert done.returncode == 0 and done.stdout
    assert b"expected a file" not in done.stderr and b"link" in done.stderr
