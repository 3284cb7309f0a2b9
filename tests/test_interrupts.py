"""Signals at chosen moments: termination, late signals, and leftover files. Programs signal
themselves at the tested moment, so no test depends on their speed.
"""

import gc
import os
import signal
import subprocess
import sys
import threading
from itertools import cycle, product
from pathlib import Path

import pytest
from app.tiny import write_rig
from children import listening
from PIL import Image

from viewer.cli import run
from viewer.interrupts import Interrupted, deferred, hold, poll, raising, watched

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[1]
OLD = b"the old file"
INT, TERM = signal.SIGINT, signal.SIGTERM
ENDINGS = {INT: (130, b"viewer: interrupted\n"), TERM: (143, b"viewer: terminated\n")}
BOTH = pytest.mark.parametrize("number", [INT, TERM], ids=["int", "term"])


def in_turn(*factors):
    """Return all combinations, the first with SIGINT, the second with SIGTERM, and so on.

    Only the message and the exit code depend on the signal.
    """
    return [(number, *case) for number, case in zip(cycle((INT, TERM)), product(*factors))]


# The program of a child process. ``strike()`` signals it once, at a moment that the test's lines
# choose.
PROGRAM = """
import os, sys
from viewer.__main__ import main
done = []
def strike():
    if not done:
        done.append(True)
        os.kill(os.getpid(), {number})
def before(owner, name):
    old = getattr(owner, name)
    def new(*given, **named):
        strike()
        return old(*given, **named)
    setattr(owner, name, new)
def after(owner, name, skipped=0):
    old, left = getattr(owner, name), [skipped]
    def new(*given, **named):
        value = old(*given, **named)
        left[0] -= 1
        if left[0] < 0:
            strike()
        return value
    setattr(owner, name, new)
class At:
    def __init__(self, module):
        self.module = module
    def find_spec(self, name, path=None, target=None):
        if name == self.module:
            strike()
{moment}
code = main()
assert done or {is_late}, "nothing has been signalled"
sys.exit(code)
"""


CLIP = """animation {
range 0 0.2
numchannels 9
%s
}"""
CHANNEL = """channel {
extrapolate constant constant
keys 2 {
0 0 linear linear
0.2 %g linear linear
}
}"""


@pytest.fixture
def end(tmp_path, forker):
    """Return a function that runs a command and returns exit code, error stream and output."""
    files = [str(file) for file in write_rig(tmp_path)]
    clip = tmp_path / "walk.anim"
    # Three translations, then x, y, z of the root and of the arm.
    clip.write_text(CLIP % "\n".join(CHANNEL % end for end in (4, 0, 0, 0, 0, 0, 0, 0, 1.5)))
    folder = tmp_path / "out"
    folder.mkdir()

    def ends(moment, number, command, *options, name="", moves=False, is_late=False, imports=False):
        program = PROGRAM.format(number=int(number), moment=moment, is_late=is_late)
        inputs = [*files, *[str(clip)] * moves]
        if name:
            (folder / name).write_bytes(OLD)
            options = (*options, "-o", folder / name, "--force")
        arguments = [command, *inputs, *options]
        started = _started if imports else forker.run
        done = started(program, arguments, tmp_path)
        assert sorted(file.name for file in folder.iterdir()) == [name] * bool(name), done.stderr
        return done.returncode, done.stderr, (folder / name).read_bytes() if name else b""

    return ends


def _started(program, arguments, folder):
    """Run a program in a new interpreter, in which no module is imported yet."""
    return subprocess.run(
        listening("-c", program, *arguments),
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        cwd=folder, capture_output=True, timeout=100, check=False,
    )  # fmt: skip


DRAWN = ("render", "--quality", "draft", "--size")
PNG = (*DRAWN, "40x30"), {"name": "x.png"}
MP4 = (*DRAWN, "48x32", "--frames", "0:6"), {"name": "x.mp4", "moves": True}
OBJ = ("convert",), {"name": "x.ply"}
INFO = ("info",), {}


@pytest.mark.parametrize(
    "module",
    [
        "viewer.interrupts",
        "viewer.cli",
        "argparse",
        "viewer.commands.render",
        "numpy",
        "datetime",  # imported by numpy's own C code, which turns any exception into an ImportError
        "numpy.linalg",
        "viewer.formats",
        "viewer.formats.skin",
        "viewer.rendering.offscreen",
        "moderngl",
        "viewer.rendering.gpu.program",
    ],
)
def test_interrupted_import_prints_one_line(end, module):
    command, places = PNG
    moment = f"sys.meta_path.insert(0, At({module!r}))"
    assert end(moment, INT, *command, **places, imports=True) == (*ENDINGS[INT], OLD)


@pytest.mark.parametrize(
    ("number", "ending"),
    [(TERM, ENDINGS[TERM]), (signal.SIGHUP, (129, b"viewer: hung up\n"))],
    ids=["term", "hup"],
)
@pytest.mark.parametrize("module", ["viewer.interrupts", "enum"])
def test_signal_before_the_first_import_is_not_lost(end, number, ending, module):
    """``enum`` is imported by the module ``signal``, which installs handlers."""
    command, places = PNG
    moment = f"sys.modules.pop({module!r}, None)\nsys.meta_path.insert(0, At({module!r}))"
    assert end(moment, number, *command, **places, imports=True) == (*ending, OLD)


@pytest.mark.parametrize(
    ("number", "kind", "helper"),
    in_turn([PNG, MP4], ["make_attribute", "make_uniform", "make_varying"]),
)
def test_signal_while_moderngl_calls_python_does_not_crash(end, number, helper, kind):
    command, places = kind
    moment = f"import _moderngl\nbefore(_moderngl, {helper!r})"
    assert end(moment, number, *command, **places) == (*ENDINGS[number], OLD)


@BOTH
@pytest.mark.parametrize(
    "moment",
    [
        "import viewer.rendering.recorder as r\nafter(r._Drawer, '_draw', 2)",
        "import viewer.rendering.recorder as r\nbefore(r._Drawer, 'release')\n"
        "def fail(*_): strike()\nr.pose_scene = fail",
        "import viewer.media.video as v\nafter(v.VideoSink, 'write')",
        # The signal arrives in the encoder's thread; the handler runs in the main thread, which
        # must be scheduled first.
        "import viewer.media.video as v, viewer.interrupts as i\n"
        "old = v.VideoSink.close\n"
        "def close(sink):\n"
        "    strike()\n"
        "    while not i._current.number: pass\n"
        "    old(sink)\n"
        "v.VideoSink.close = close",
    ],
    ids=["frame", "pose", "encoding", "finishing"],
)
def test_interrupted_video_keeps_the_old_file(end, number, moment):
    command, places = MP4
    assert end(moment, number, *command, **places) == (*ENDINGS[number], OLD)


@pytest.mark.parametrize(
    ("number", "case"),
    in_turn([
        (INFO, "import viewer.formats.skin as m\nbefore(m, 'read')"),
        (INFO, "import viewer.commands._scene as m\nafter(m, 'begin')"),
        ((("lint",), {}), "import viewer.commands.lint as m\nbefore(m, 'lint_files')"),
        (OBJ, "import viewer.rigs.skinning as m\nbefore(m, 'deform')"),
        (PNG, "import viewer.rendering.renderer as m\nbefore(m.Renderer, 'draw')"),
        (PNG, "import os\nbefore(os, 'fsync')"),
        (OBJ, "import tempfile\nbefore(tempfile, 'mkstemp')"),
    ]),
)  # fmt: skip
def test_interrupted_command_keeps_the_old_file(end, number, case):
    (command, places), moment = case
    output = OLD if places else b""
    assert end(moment, number, *command, **places) == (*ENDINGS[number], output)


LATE = {
    "rename": "from pathlib import Path\nafter(Path, 'replace')",
    "summary": "import builtins\nbefore(builtins, 'print')",
    "result": "import viewer.cli as c\nafter(c, 'run')",
    "exit, noted before": "import atexit\natexit.register(strike)",
    "exit, noted after": "import atexit, viewer.cli as c\n"
    "before_run = c.run\n"
    "c.run = lambda given: (atexit.register(strike), before_run(given))[1]",
    "teardown": "class Last:\n"
    "    def __del__(self, kill=os.kill, pid=os.getpid()):\n"
    "        kill(pid, {number})\n"
    "sys.modules['last'] = Last()",
}


@pytest.mark.parametrize(("number", "moment", "kind"), in_turn(LATE, [PNG, MP4, OBJ]))
def test_signal_after_the_work_is_done_is_ignored(end, number, moment, kind, tmp_path):
    command, places = kind
    lines = LATE[moment].replace("{number}", str(int(number)))
    is_late = moment[:4] in ("exit", "tear")
    code, said, output = end(lines, number, *command, **places, is_late=is_late)
    assert (code, said) == (0, b"") and output not in (OLD, b"")
    if kind is PNG:
        with Image.open(tmp_path / "out" / "x.png") as picture:
            picture.load()
            assert picture.size == (40, 30)


def test_closed_terminal_ends_a_run(end):
    command, places = PNG
    moment = "import viewer.rendering.renderer as m\nbefore(m.Renderer, 'draw')"
    wanted = (129, b"viewer: hung up\n", OLD)
    assert end(moment, signal.SIGHUP, *command, **places) == wanted


def test_signal_swallowed_by_python_is_raised_again(end):
    # Exceptions in destructors and weak reference callbacks are only reported.
    moment = (
        "import viewer.commands.info as m\n"
        "class Dropped:\n"
        "    def __del__(self): strike()\n"
        "old = m.run\n"
        "def run(arguments):\n"
        "    Dropped()\n"
        "    while True: pass\n"
        "m.run = run"
    )
    assert end(moment, INT, *INFO[0]) == (*ENDINGS[INT], b"")


def test_second_signal_ends_an_unresponsive_program(end):
    moment = (
        "import time, viewer.commands.info as m\n"
        "from viewer.interrupts import hold\n"
        "def run(arguments):\n"
        "    hold()\n"
        "    while True:\n"
        "        os.kill(os.getpid(), 2)\n"
        "        time.sleep(0.3)\n"
        "m.run = run"
    )
    assert end(moment, INT, *INFO[0], is_late=True) == (*ENDINGS[INT], b"")


def test_ignored_signal_stays_ignored(end):
    command, places = PNG
    ignores = "import signal\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n"
    moment = ignores + "import viewer.rendering.renderer as m\nbefore(m.Renderer, 'draw')"
    code, said, output = end(moment, INT, *command, **places)
    assert (code, said) == (0, b"") and output != OLD


@pytest.mark.parametrize("arguments", [["--version"], ["info", "/no/such.skel"], ["info", "-?"]])
def test_handlers_of_the_caller_are_restored(arguments, capsys):
    def mine(number, frame):
        """Ignore the signal."""

    kept = {number: signal.signal(number, mine) for number in (INT, TERM)}
    hook = sys.unraisablehook
    try:
        run(arguments)
        assert [signal.getsignal(number) for number in kept] == [mine, mine]
        assert sys.unraisablehook is hook
    finally:
        for number, handler in kept.items():
            signal.signal(number, handler)


def test_run_works_in_another_thread(tmp_path, capsys):
    codes = []
    files = [str(file) for file in write_rig(tmp_path)]
    thread = threading.Thread(target=lambda: codes.append(run(["info", *files])))
    thread.start()
    thread.join()
    assert codes == [0] and not capsys.readouterr().err


def test_signal_raises_an_exception_inside_watched(ctrl_c):
    reached = []
    with pytest.raises(Interrupted) as stop, watched():
        ctrl_c()
        reached.append(1)
    assert stop.value.exit_code == 130 and not reached


def test_deferred_signal_raises_an_exception_at_the_end_of_the_block(ctrl_c):
    reached = []
    with pytest.raises(Interrupted), watched():
        with deferred():
            with deferred():
                ctrl_c()
            reached.append("inner")
        reached.append("after")
    assert reached == ["inner"]


def test_signal_outside_watched_is_left_to_the_caller(ctrl_c):
    reached = []
    with pytest.raises(KeyboardInterrupt):
        with deferred(), deferred():
            ctrl_c()
            reached.append("inner")
        reached.append("after")
    assert reached == ["inner"]
    assert signal.getsignal(INT) is signal.default_int_handler


def test_held_signal_is_raised_by_a_poll(ctrl_c):
    reached = []
    with pytest.raises(Interrupted), watched():
        hold()
        with deferred():
            ctrl_c()
        reached.append("held")
        poll()
        reached.append("polled")
    assert reached == ["held"]


def test_held_signal_without_a_poll_is_dropped(ctrl_c):
    with watched():
        hold()
        ctrl_c()
    gc.collect()


def test_signal_is_held_until_the_end_of_the_block(ctrl_c):
    reached = []
    with pytest.raises(Interrupted), watched():
        with deferred():
            hold()
        hold()
        with raising():
            ctrl_c()
            reached.append(1)
    assert not reached


def test_clean_up_is_not_interrupted_twice(ctrl_c):
    reached = []
    with pytest.raises(Interrupted), watched():
        try:
            ctrl_c()
        finally:
            ctrl_c()
            poll()
            with deferred():
                reached.append("clean-up")
    assert reached == ["clean-up"]
