"""Fixtures and paths shared by test files."""

import functools
import gc
import itertools
import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import moderngl
import pytest
from _pytest.runner import runtestprotocol
from hypothesis import settings
from hypothesis.internal.conjecture import providers
from run_time import RunTime

from viewer.diagnostics import Diagnostic

pytest_plugins = ["examples", "stored_pictures"]

ROOT = Path(__file__).resolve().parents[1]
# Folders and files in which every test and example draws, or depends on one that draws.
DRAWING = (
    "tests/app/",
    "tests/commands/test_pictures.py",
    "tests/exporters/html/test_page",
    "tests/rendering/",
    "viewer/__init__.py",
    "viewer/commands/_pictures.py",
    "viewer/rendering/",
)
# These tests mostly wait. If they started last, one worker would finish long after the others; if
# several workers waited at the same time, a core would be idle.
FIRST = ("tests/batching/engines/", "tests/test_interrupts.py", "tests/test_window.py")
SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
SHARED = SHARED_DATA / "cse169"

# Every run tries the same examples, without a time limit. Hypothesis would also choose from the
# constants of all modules that happen to be loaded: other examples in each process, after 4 s of
# reading sources.
settings.register_profile("fixed", derandomize=True, deadline=None, database=None)
settings.load_profile("fixed")
providers._get_local_constants = lambda: providers._local_constants


def pytest_configure(config: pytest.Config) -> None:
    # The controller measures for all workers.
    if not hasattr(config, "workerinput"):
        config.pluginmanager.register(RunTime())


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Ignore files whose tests all draw, if no test that draws is selected."""
    if config.option.markexpr != "not slow" or not collection_path.is_relative_to(ROOT):
        return None
    path = collection_path.relative_to(ROOT).as_posix()
    return f"{path}/".startswith(DRAWING) or path in DRAWING or None


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
    """Report a test that passes to the controller once, not for each of its phases."""
    if not hasattr(item.config, "workerinput"):
        return None
    reports = runtestprotocol(item, log=False, nextitem=nextitem)
    if len(reports) == 3 and all(report.passed for report in reports):
        call = reports[1]
        call.duration = sum(report.duration for report in reports)
        reports = [call]
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    return True


def pytest_collection() -> None:
    # Collecting creates few objects that are not kept until the end of the run. The controller of
    # several workers collects nothing: its own function ends the search for others.
    gc.disable()


def pytest_collection_finish() -> None:
    # Tests, modules and libraries live until the end of the run, so the garbage collector need not
    # scan them, repeatedly or even once: that would take a tenth of the time to collect.
    gc.freeze()
    gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.nodeid.startswith(DRAWING):
            item.add_marker("slow")
    items.sort(key=lambda item: not item.nodeid.startswith(FIRST))


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of real .skel and .skin files, if it is next to the checkout."""
    if not SHARED.is_dir():
        pytest.skip(f"no real files in {SHARED}")
    return SHARED


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of all real and large files, if it is next to the checkout."""
    if not SHARED_DATA.is_dir():
        pytest.skip(f"no real files in {SHARED_DATA}")
    return SHARED_DATA


@pytest.fixture
def tiny_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 64 KiB, 16 blocks, where one may be mounted."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(folder)]
    try:
        done = subprocess.run(mount, capture_output=True, check=False)
    except OSError:
        pytest.skip("no mount command")
    if done.returncode:
        pytest.skip("no file system may be mounted")
    try:
        yield folder
    finally:
        subprocess.run(["umount", str(folder)], check=True)


_NUMBERS = itertools.count()


@pytest.fixture(scope="session", autouse=True)
def no_disk_waits() -> Iterator[None]:
    """Leave written data in memory: waiting for the disk takes 5 to 40 ms per file."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("os.fsync", lambda handle: None)
        patch.setenv("VIEWER_CACHE", "off")
        yield


@pytest.fixture(scope="session", autouse=True)
def messages_can_be_shown() -> Iterator[None]:
    """Raise where a message is made whose sentence does not fit its values."""
    # Tests often compare the values of a message alone, and would not notice.
    made = Diagnostic.__post_init__

    def shown(self: Diagnostic) -> None:
        made(self)
        assert self.message

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Diagnostic, "__post_init__", shown)
        yield


@pytest.fixture(scope="session")
def settings_folder(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The folder of the settings of all tests of a process."""
    return str(tmp_path_factory.mktemp("settings"))


@pytest.fixture(autouse=True)
def own_settings(settings_folder: str) -> None:
    """Keep tests from reading or changing the user's settings or those of another test.

    Every one of 16,000 tests pays for this fixture, so it creates no folder and undoes nothing.
    """
    folder = f"{settings_folder}/{next(_NUMBERS)}"
    for name in ("XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_STATE_HOME"):
        os.environ[name] = f"{folder}/{name}"


@pytest.fixture
def rig(tmp_path: Path) -> tuple[Path, Path]:
    """The paths of the tiny skeleton and its skin."""
    from app.tiny import write_rig

    return write_rig(tmp_path)


@pytest.fixture(scope="module")
def forker():
    """A process that forks the programs of a test file, which then need not import anything."""
    from forked_programs import Forker

    kept = Forker()
    yield kept
    kept.close()


@pytest.fixture(scope="module")
def opened():
    """Scenes by the options with which commands have opened them."""
    return {}


@pytest.fixture
def read_once(opened, monkeypatch):
    """Read the files of a command once, for tests that repeat it with other faults of outputs."""
    from viewer.commands import convert, render
    from viewer.commands._scene import open_scene
    from viewer.rendering.recorder import copied

    def open_copy(options):
        key = repr(options)
        if key not in opened:
            opened[key] = open_scene(options)
        return copied(opened[key])

    for command in (convert, render):
        monkeypatch.setattr(command, "open_scene", open_copy)


@pytest.fixture(scope="module")
def family(tmp_path_factory):
    """Figures of the SMPL family by kind, each read once."""
    from builders import family_figure

    folder = tmp_path_factory.mktemp("family")
    return functools.cache(lambda kind: family_figure(kind, folder))


@pytest.fixture
def quick_fits(monkeypatch) -> None:
    """Align figures with a sixteenth of the usual points: much faster, and nearly as good.

    A fit of the pose uses a sixth of the vertices, and has half of the iterations.
    """
    monkeypatch.setattr("viewer.autorig.alignment.surface_alignment.SAMPLES", 125)
    monkeypatch.setattr("viewer.autorig.alignment.pose_fit._VERTICES", 250)
    monkeypatch.setattr("viewer.autorig.alignment.pose_fit._ROUNDS", 16)
    monkeypatch.setattr("viewer.autorig.alignment.pose_fit._NEARING", 10)


@pytest.fixture(scope="session")
def gl_framebuffer() -> Iterator[moderngl.Framebuffer]:
    """A framebuffer of a windowless context, shared by all tests; use ``ctx``, which checks it."""
    from viewer.rendering.gpu.context import headless_context

    context = headless_context()
    framebuffer = context.simple_framebuffer((4, 4))
    yield framebuffer
    framebuffer.release()
    context.release()


@pytest.fixture
def ctx(gl_framebuffer: moderngl.Framebuffer) -> Iterator[moderngl.Context]:
    """A current context with a framebuffer bound; the test fails if it leaves a GL error."""
    context: moderngl.Context = gl_framebuffer.ctx
    with context:
        gl_framebuffer.use()
        assert context.error == "GL_NO_ERROR"
        yield context
        assert context.error == "GL_NO_ERROR"
        gl_framebuffer.use()  # the framebuffer bound by the test may have been released


@pytest.fixture
def mesa(ctx: moderngl.Context) -> None:
    """Skip unless Mesa draws: other drivers ignore its environment variables."""
    version = ctx.info["GL_VERSION"]
    if "Mesa" not in version:
        pytest.skip(f"needs Mesa; OpenGL {version} draws")


@pytest.fixture
def ctrl_c():
    """A function that interrupts a test, also if the tests were started with SIGINT ignored."""
    kept = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield lambda: signal.raise_signal(signal.SIGINT)
    signal.signal(signal.SIGINT, kept)
