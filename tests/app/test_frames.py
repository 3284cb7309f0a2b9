"""Frames of the window: their pace, what is computed for them, and a display that is lost."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from app.tiny import write_rig
from driven_window import IMPORTED
from forked_programs import Forker
from x_server import x_server

from viewer.app.actors.following import toggle_following
from viewer.app.pace import Pace
from viewer.app.posing.joint_tree import select_joint
from viewer.app.posing.toolbar import choose_tool
from viewer.app.weights.weights_panel import pin_vertex, show_scalar
from viewer.rendering.options import DisplayOptions
from viewer.rigs import kinematics

DRAFT, FINAL = DisplayOptions(), DisplayOptions(quality="final", passes=4)


def test_draft_quality_is_drawn_once_for_each_change():
    pace = Pace()
    assert pace.step("a", DRAFT, 0.0) is not None
    assert pace.step("a", DRAFT, 0.1) is None and not pace.is_unfinished
    assert pace.step("b", DRAFT, 0.2) is not None


def test_final_quality_adds_passes_while_nothing_changes():
    pace = Pace()
    steps = [pace.step("a", FINAL, 0.1 * frame) for frame in range(5)]
    assert [step.passes for step in steps[:4]] == [range(i, i + 1) for i in range(4)]
    assert steps[4] is None and not pace.is_unfinished
    assert pace.step("b", FINAL, 1.0).passes == range(1)
    assert pace.is_unfinished


@pytest.mark.parametrize("rate", [60, 3])
def test_slow_drivers_fade_shadows_out_during_motion_and_in_again_after_it(rate):
    pace, strengths, qualities = Pace(), [], []
    for frame in range(90):
        key = min(frame, 30)  # nothing moves from the 31st frame on
        step = pace.step(key, FINAL, frame / rate)
        if step is not None:
            pace.measured(step, 0.08 if rate == 60 else 0.3)
            strengths.append(step.strength)
            qualities.append(step.options.quality)
    assert "draft" in qualities and qualities[-1] == "final" and strengths[-1] == 1.0
    # Shadows do not jump: they fade out over a fifth of a second and at least two frames.
    assert np.abs(np.diff(strengths)).max() <= (1 / 12 if rate == 60 else 0.5) + 1e-9


def test_fast_drivers_keep_their_shadows():
    pace = Pace()
    for frame in range(60):
        step = pace.step(frame, FINAL, frame / 60)
        pace.measured(step, 0.004)
        assert step.strength == 1.0 and step.options.quality == "final"


def test_final_picture_is_the_average_of_all_passes(drive, rig):
    hand = drive(*rig, samples=1)
    hand.step(3)
    draft = hand.scene_picture()
    hand.state.options.quality, hand.state.options.passes = "final", 3
    hand.step()
    while hand.app.frame.pace.is_unfinished:
        hand.step()
    final = hand.scene_picture()
    assert (final != draft).any()
    hand.step(3)
    assert (hand.scene_picture() == final).all()


@pytest.fixture
def runs(monkeypatch):
    """The number of poses for which forward kinematics ran."""
    counted, run = [], kinematics.joint_worlds

    def count(parents, linear, offsets):
        counted.extend([1] * (len(linear) if linear.ndim == 4 else 1))
        return run(parents, linear, offsets)

    for module in list(sys.modules.values()):
        if getattr(module, "joint_worlds", None) is run:
            monkeypatch.setattr(module, "joint_worlds", count)
    return counted


def show_everything(state):
    """Show a pose as skin, boxes, bones, names, axes, rings, an explained vertex and numbers."""
    options = state.options
    options.show, options.xray, options.joint_names, options.joint_axes = "both", True, True, True
    options.keypoints = True
    choose_tool(state, "rotate")
    select_joint(state, 1)
    pin_vertex(state, 0, 0)
    show_scalar(state, "field" if state.actor.figure.fields else "weight")
    toggle_following(state, 0, 1)


def test_edited_pose_runs_kinematics_once(hand, runs):
    show_everything(hand.state)
    hand.step(4)
    runs.clear()
    hand.state.actor.pose.dofs[hand.dof_index("arm.x")] += 0.1
    hand.step(1)
    assert runs == [1]
    hand.step(2)
    assert runs == [1]


def test_edited_pose_of_a_body_model_runs_kinematics_once(box, runs):
    show_everything(box.state)
    box.step(4)
    runs.clear()
    box.state.actor.pose.dofs[-1] += 0.1
    box.step(1)
    assert runs == [1]


def test_moved_camera_runs_no_kinematics(hand, runs):
    show_everything(hand.state)
    hand.step(4)
    runs.clear()
    hand.state.camera.azimuth += 5.0
    hand.step(2)
    assert runs == []


ROOT = Path(__file__).resolve().parents[2]
DRAFT_WORDS = ("--quality", "draft")
# This program runs in a separate process; its window kills the server in a known frame.
PROGRAM = """
import os, signal, sys
from pathlib import Path
from viewer.app import window
from viewer.app.recording.recording import RecordingState, RecordSettings
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
    with x_server("800x600") as found:
        yield found


@pytest.fixture(scope="module")
def forker():
    """A process that has imported the viewer."""
    kept = Forker(IMPORTED)
    yield kept
    kept.close()


@pytest.fixture
def ended(server, forker, tmp_path):
    """A function that runs the viewer until it has lost its display."""
    process, display = server
    environment = {
        **os.environ,
        "DISPLAY": display,
        "LIBGL_ALWAYS_SOFTWARE": "1",
        "XDG_STATE_HOME": str(tmp_path / "state"),
    }
    environment.pop("WAYLAND_DISPLAY", None)
    rig = write_rig(tmp_path)

    def end(word="", program=PROGRAM):
        words = [process.pid, word, *rig, *DRAFT_WORDS]
        return forker.run(program, words, tmp_path, environment)

    return end


def check_end(done, display):
    lines = done.stderr.decode().splitlines()
    assert done.returncode == 4 and len(lines) == 1, lines
    assert lines[0].startswith("viewer: ") and "X server" in lines[0] and display in lines[0]


def test_lost_display_prints_one_line_and_ends_with_exit_code_4(server, ended):
    check_end(ended(), server[1])


def test_lost_display_leaves_no_half_written_recording(server, ended, tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    check_end(ended(folder), server[1])
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize("step", ["create_window", "make_context_current", "swap_interval"])
def test_display_lost_at_start_prints_the_same_message(server, ended, step):
    check_end(ended(step, START), server[1])


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
