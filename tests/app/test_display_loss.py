"""Loss of the X server while the window is open."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from app.tiny import write_rig

ROOT = Path(__file__).resolve().parents[2]
DRAFT = ("--quality", "draft")

# This program runs in a separate process; its window kills the server in a known frame.
PROGRAM = """
import os, signal, sys
from pathlib import Path
from viewer.app import window
from viewer.app.recording.record_dialog import RecordingState, RecordSettings
from viewer.cli import run

server, folder = int(sys.argv[1]), sys.argv[2]
draw, drawn = window._Window._draw, []

def watched(self):
    drawn.append(1)
    if len(drawn) == 3 and folder:
        settings = RecordSettings(kind=".gif", turntable=True, seconds=60.0)
        settings.size, settings.own_size = "own", (64, 48)
        self.state.of(RecordingState).settings = settings
        self.state.of(RecordingState).wanted = Path(folder, "turn.gif")
    if len(drawn) >= 3 and (not folder or os.listdir(folder)):
        os.kill(server, signal.SIGKILL)
    return draw(self)

window._Window._draw = watched
sys.exit(run(sys.argv[3:]))
"""


# This program loses its display at start-up: the server is killed before the given step.
START = """
import os, signal, sys
from viewer.app.display import import_glfw
from viewer.cli import run

server, step = int(sys.argv[1]), sys.argv[2]
glfw = import_glfw()
original = getattr(glfw, step)

def killed(*arguments):
    os.kill(server, signal.SIGKILL)
    return original(*arguments)

setattr(glfw, step, killed)
sys.exit(run(sys.argv[3:]))
"""


@pytest.fixture
def server():
    """The process and display name of a separate Xvfb."""
    if shutil.which("Xvfb") is None:
        text = "Xvfb not installed"
        pytest.fail(text) if os.environ.get("CI") == "true" else pytest.skip(text)
    reading, writing = os.pipe()
    command = ["Xvfb", "-displayfd", str(writing), "-screen", "0", "800x600x24", "-nolisten", "tcp"]
    process = subprocess.Popen(
        command, pass_fds=[writing], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    os.close(writing)
    with os.fdopen(reading) as stream:
        number = stream.readline().strip()
    yield process, f":{number}"
    process.kill()
    process.wait(10)


def ended(server, tmp_path, word="", program=PROGRAM):
    """Return how the viewer ended after losing its display."""
    process, display = server
    environment = {
        **os.environ,
        "DISPLAY": display,
        "LIBGL_ALWAYS_SOFTWARE": "1",
        "PYTHONPATH": str(ROOT),
        "XDG_STATE_HOME": str(tmp_path / "state"),
    }
    environment.pop("WAYLAND_DISPLAY", None)
    rig = write_rig(tmp_path)
    return subprocess.run(
        [sys.executable, "-c", program, str(process.pid), str(word), *map(str, rig), *DRAFT],
        env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip


def check_end(done, display):
    lines = done.stderr.splitlines()
    assert done.returncode == 4 and len(lines) == 1, done.stderr
    assert lines[0].startswith("viewer: ") and "X server" in lines[0] and display in lines[0]


def test_lost_display_prints_one_line_and_ends_with_exit_code_4(server, tmp_path):
    check_end(ended(server, tmp_path), server[1])


def test_lost_display_leaves_no_half_written_recording(server, tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    check_end(ended(server, tmp_path, folder), server[1])
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize("step", ["create_window", "make_context_current", "swap_interval"])
def test_display_lost_at_start_prints_the_same_message(server, tmp_path, step):
    check_end(ended(server, tmp_path, step, START), server[1])


def test_previous_handler_is_restored():
    """Run in a separate process, as Xlib has one global handler."""
    program = (
        "import ctypes\n"
        "from viewer.app.display import stop_watching, watch_display\n"
        "ask = ctypes.CDLL('libX11.so.6')['XSetIOErrorHandler']\n"
        "ask.restype = ctypes.c_void_p\n"
        "first = ask(None)\n"  # Xlib's default handler
        "ask(ctypes.c_void_p(first))\n"
        "watch_display()\n"
        "watch_display()\n"  # the second call has no effect
        "held = ask(None)\n"
        "ask(ctypes.c_void_p(held))\n"
        "stop_watching()\n"
        "assert held != first and ask(None) == first\n"
        "stop_watching()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, timeout=60,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
