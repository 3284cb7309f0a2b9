"""The real window under Xvfb, driven by xdotool; screenshots are compared."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from app.driver import Driver
from app.tiny import write_rig
from dragged_files import drag_and_vanish, drag_files
from driven_window import IMPORTED, PATIENCE, ROOT, Window, _ask_to_close, _wait_for
from forked_programs import VIEWER, Forker
from formats.pig_text import write as write_pig
from imgui_bundle import imgui
from PIL import Image, ImageGrab
from x11_clipboard import offer_clipboard, read_clipboard
from x_server import require, x_server

import viewer
from viewer.app.view.picks import vertex_at
from viewer.app.window import Rest
from viewer.errors import RenderError, ViewerError
from viewer.rendering.camera import facing_camera, fit
from viewer.rendering.options import DisplayOptions
from viewer.rigs.inspection.front import guess_front
from viewer.rigs.scene import scene_points

pytestmark = pytest.mark.slow
SHARED = ROOT.parent / "shared" / "data" / "cse169"
SIZE = (1280, 800)
DRAFT, FINAL = ("--quality", "draft"), ("--quality", "final")


@pytest.fixture(scope="module")
def display():
    """The name of an Xvfb display that only this module uses."""
    require("Xvfb", "xdotool")
    # A key that is released late, on a busy machine, must not repeat (-r). A server that resets
    # when its last client disconnects refuses the next one (-noreset).
    with x_server("1400x900", "-r", "-noreset") as (_, name):
        yield name


@pytest.fixture(scope="module")
def figure(tmp_path_factory):
    if SHARED.is_dir():
        return SHARED / "wasp.skel", SHARED / "wasp.skin"
    return write_rig(tmp_path_factory.mktemp("rig"))


@pytest.fixture(scope="module")
def forker(display):
    """A process that has imported the viewer: each window needs 0.8 s of processor time less."""
    kept = Forker(IMPORTED, DISPLAY=display, PYTHONWARNINGS="error")
    yield kept
    kept.close()


@pytest.fixture
def window(display, figure, forker, tmp_path):
    """Return a function that starts the viewer; windows left open are closed."""
    started = []

    def start(*options, **changes):
        arguments = [*(options or DRAFT), *figure]
        started.append(Window(display, tmp_path, arguments, **{"forker": forker, **changes}))
        return started[-1]

    yield start
    for one in started:
        if one.process.poll() is None:
            one.process.kill()
        one.process.communicate()


@pytest.fixture(scope="module")
def places(figure):
    """Positions of widgets, from a headless app of the window's size and layout."""
    driver = Driver(*figure, size=SIZE)
    rects, view = dict(driver.state.item_rects), driver.state.view_rect
    driver.close()
    return rects, view


# A viewer whose files can be read as soon as a file called "go" exists.
SLOW = """
import sys, time
from pathlib import Path
import viewer.app.opening, viewer.commands.view as view
from viewer.__main__ import main
from viewer.progress import report
viewer.app.opening._PATIENCE, start = 0.0, view._start
def slow(*given):
    while not Path("go").exists():
        report(1, 4, "MB")
        time.sleep(0.01)
    return start(*given)
view._start = slow
sys.exit(main())
"""


def test_window_shows_progress_until_the_files_are_open(window, tmp_path):
    usual = window()
    wanted = usual.wait_until_quiet()
    usual.key("ctrl+q")
    usual.finish()
    app = window(program=SLOW)
    assert (app.wait_until_quiet() != wanted).any()
    (tmp_path / "go").touch()
    app.wait_until_shown(wanted, np.s_[:])
    app.wait_until_quiet()
    app.key("ctrl+q")
    app.finish()


@pytest.mark.parametrize("key", ["Escape", ""])
def test_opening_is_cancelled_in_the_window(window, display, key):
    app = window(program=SLOW)
    app.key(key) if key else _ask_to_close(display, int(app.id))
    app.finish()


def test_error_while_the_window_shows_progress_ends_the_program(window, tmp_path):
    app = window("missing.bvh", program=SLOW)
    (tmp_path / "go").touch()
    out, err = app.process.communicate(timeout=PATIENCE)
    assert (app.process.returncode, out) == (2, b"")
    assert err.startswith(b"missing.bvh: ") and err.count(b"\n") == 1


def test_window_responds_to_mouse_and_keyboard(window, places, figure):
    rects, view = places
    app = window()
    before = app.wait_until_quiet()
    x, y, width, height = map(int, view)
    inside = (x, y, width, height - 90)  # the lowest part shows messages that disappear
    part = np.s_[y : y + inside[3], x : x + width]

    # A slider moves the figure, R restores it pixel by pixel.
    label = "root.y"
    x0, y0, x1, y1 = rects[label]
    middle = (y0 + y1) / 2
    app.drag(((x0 + x1) / 2, middle), (x0 + 0.9 * (x1 - x0), middle))
    moved = app.wait_until_changed(before, inside)
    app.key("r")
    app.wait_until_shown(before, part)
    app.key("ctrl+z")
    app.wait_until_shown(moved, part)
    app.key("r")
    app.wait_until_shown(before, part)

    # Skeleton and bind pose are toggled.
    for key in ("s", "k"):
        now = app.wait_until_quiet()
        app.key(key)
        changed = app.wait_until_changed(now, inside)
        assert (changed[part] != now[part]).mean() > 0.001
        app.key("s" if key == "s" else "k")
        app.wait_until_changed(changed, inside)

    # Tab hides everything except the figure.
    now = app.wait_until_quiet()
    app.key("Tab")
    wide = app.wait_until_changed(now, (0, 100, 200, 500))
    app.key("Tab")
    app.wait_until_changed(wide, (0, 100, 200, 500))

    # The window is made smaller, hidden, shown again, and made larger.
    app.tell("windowsize", app.id, 700, 500)
    _wait_for(lambda: app.screen()[600:, 900:].max() == 0, "the smaller window")
    app.wait_until_quiet()
    app.tell("windowunmap", app.id)
    _wait_for(lambda: app.screen().max() == 0, "an empty screen")
    app.tell("windowmap", "--sync", app.id)
    _wait_for(lambda: app.screen().max() > 0, "the window again")
    app.tell("windowsize", app.id, *SIZE)
    app.wait_until_quiet()
    assert app.process.poll() is None

    app.tell("windowfocus", "--sync", app.id)
    app.key("r")  # no unsaved pose
    app.wait_until_quiet(still=1.0)
    app.key("ctrl+q")
    app.finish()
    names = json.loads((app.folder / "state" / "viewer" / "recent.json").read_text())
    assert names[0] == [str(path.resolve()) for path in figure]


def test_screenshot_equals_the_headless_image_in_every_pixel(window, places, figure):
    app = window(*FINAL, forker=None)
    app.key("F12")
    path = app.folder / f"{figure[1].stem}.png"
    _wait_for(path.is_file, "the screenshot")
    with Image.open(path) as picture:
        saved = np.array(picture.convert("RGBA"))
    height, width = saved.shape[:2]
    assert (width, height) == tuple(round(side) for side in places[1][2:])
    scene = viewer.load(*figure)
    camera = facing_camera(guess_front(scene), scene.up)
    fit(camera, scene_points(scene), width / height)
    options = DisplayOptions(quality="final")
    assert (saved == viewer.render(scene, (width, height), camera, options)).all()
    # The window shows these pixels, except for tools at the top and messages at the bottom, as soon
    # as it has drawn all passes.
    x, y = map(int, places[1][:2])
    rows = slice(120, height - 120)

    def agrees() -> bool:
        shown = app.screen()[y : y + height, x : x + width]
        return bool((shown[rows] == saved[rows, :, :3]).mean() > 0.999)

    _wait_for(agrees, "the same pixels in the window")
    app.key("ctrl+q")
    app.finish()


def test_files_and_folders_dragged_onto_the_window_open(window, tmp_path):
    app = window()
    parts = tmp_path / "other figure"
    parts.mkdir()
    app.process.send_signal(signal.SIGSTOP)  # it answers when the source is gone
    drag_and_vanish(app.display, app.id, [parts])
    time.sleep(0.3)  # the server removes its window
    app.process.send_signal(signal.SIGCONT)
    # The next source would get the same window number.
    app.wait_until_quiet(still=1.0)
    drag_files(app.display, app.id, write_rig(parts))
    _wait_for(lambda: "tiny" in app.tell("getwindowname", app.id), "the figure that was dropped")
    folder = write_pig(tmp_path / "a pig")
    drag_files(app.display, app.id, [folder])
    _wait_for(lambda: "pig" in app.tell("getwindowname", app.id), "the folder that was dropped")
    app.wait_until_quiet()
    app.key("ctrl+q")
    app.finish()


def test_text_is_typed_copied_and_pasted_as_in_other_programs(window, places):
    app = window()
    x0, y0, x1, y1 = places[0]["Filter"]
    subprocess.run(["setxkbmap", "de"], env=app.environment, check=True)
    app.drag(((x0 + x1) / 2, (y0 + y1) / 2), ((x0 + x1) / 2, (y0 + y1) / 2))

    def copied():
        app.key("ctrl+a")
        app.key("ctrl+c")
        return read_clipboard(app.environment)

    for key in ("udiaeresis", "ssharp", "dead_acute", "e"):
        app.key(key)
    _wait_for(lambda: copied() == "\xfc\xdf\xe9", "letters that are not in ASCII")
    other = offer_clipboard(app.environment, "two\nlines")
    try:
        app.key("ctrl+a")
        app.key("ctrl+v")
        _wait_for(lambda: copied() == "two lines", "the text of another program in one line")
    finally:
        other.kill()
        other.communicate()
    app.key("ctrl+q")


def test_window_asks_before_edits_are_lost_however_often_it_is_closed(window):
    app = window()
    opened = app.wait_until_quiet()
    app.key("ctrl+p")
    app.tell("type", "New clip")
    app.key("Return")
    timeline = (0, 720, 200, 60)
    app.wait_until_changed(opened, timeline)
    edited = app.wait_until_quiet(still=1.0)
    for _ in range(3):
        _ask_to_close(app.display, int(app.id))
    app.wait_until_changed(edited, timeline)  # it is dimmed behind the question
    asked = app.wait_until_quiet(still=1.0)
    app.key("Escape")
    app.wait_until_changed(asked, timeline)
    kept = app.wait_until_quiet(still=1.0)
    app.key("ctrl+z")
    app.wait_until_changed(kept, timeline)
    app.wait_until_quiet(still=1.0)
    app.key("ctrl+q")
    app.finish()


@pytest.mark.parametrize(
    ("number", "code", "word"),
    [(signal.SIGINT, 130, b"interrupted"), (signal.SIGTERM, 143, b"terminated")],
)
def test_window_ends_at_a_signal_without_a_traceback(window, number, code, word):
    app = window()
    app.process.send_signal(number)
    out, err = app.process.communicate(timeout=PATIENCE)
    assert (app.process.returncode, out, err) == (code, b"", b"viewer: " + word + b"\n")


def test_layout_is_remembered_between_runs(window, places):
    _, (x, y, _, height) = places
    app = window()
    before = app.wait_until_quiet()
    app.drag((x - 1, y + height / 2), (x + 120, y + height / 2))
    app.wait_until_changed(before)
    wider = app.wait_until_quiet(still=1.0)
    app.tell("windowfocus", "--sync", app.id)
    app.key("ctrl+q")
    app.finish()
    assert (app.folder / "state" / "viewer" / "layout.ini").stat().st_size > 100
    strip = np.s_[200:700, int(x) + 20 : int(x) + 100]  # was in the view, is now in a panel
    assert (wider[strip] != before[strip]).mean() > 0.5
    again = window()
    _wait_for(lambda: (again.screen()[strip] == wider[strip]).mean() > 0.98, "the same layout")


@pytest.fixture(scope="module")
def surface(figure):
    """Position of the Weights tab, and positions in the window on the figure's surface."""
    driver = Driver(*figure, size=SIZE, samples=1)
    tab = imgui.internal.find_window_by_name("Weights").dc.dock_tab_item_rect
    driver.key("f")
    driver.step(3)
    state, renderer = driver.state, driver.app.frame.renderer
    x, y, width, height = state.view_rect
    size = round(width), round(height)

    def is_inside(across, down):  # not at an edge, which different rounding would miss
        around = [(across + i, down + j) for i in (-3, 0, 3) for j in (-3, 0, 3)]
        return all(vertex_at(state, renderer, size, place) is not None for place in around)

    seen = [
        (round(x + across), round(y + down))
        for down in np.linspace(0.2, 0.8, 13) * height
        for across in np.linspace(0.2, 0.8, 13) * width
        if is_inside(across, down)
    ]
    driver.close()
    assert len(seen) >= 3
    middle = (tab.min.x + 0.3 * (tab.max.x - tab.min.x), (tab.min.y + tab.max.y) / 2)
    return middle, seen


def test_vertex_text_is_complete_wherever_the_mouse_is(window, places, surface):
    (x, y, width, height), (tab, seen) = places[1], surface
    part = np.s_[int(y) : int(y + height), int(x) : int(x + width)]
    app = window()
    opened = app.wait_until_quiet()
    app.tell("mousemove", *map(round, tab))
    # A tab is hovered, and drawn lighter, before it can be pressed.
    around = np.s_[round(tab[1]) - 8 : round(tab[1]) + 8, round(tab[0]) - 8 : round(tab[0]) + 8]
    _wait_for(lambda: (app.screen()[around] != opened[around]).any(), "a hovered tab")
    app.drag(tab, tab)
    app.wait_until_changed(opened, (x + width + 5, y + 50, SIZE[0] - x - width - 5, 200))
    beside = round(x + 15), round(y + 0.4 * height)
    app.tell("mousemove", *beside)
    _wait_for(app.is_asleep, "messages to go")
    empty = app.screen()
    for place in seen[:: max(len(seen) // 3, 1)][:3]:
        app.tell("mousemove", *beside)
        app.wait_until_shown(empty, part)
        app.tell("mousemove", place[0] - 3, place[1])
        app.tell("mousemove", *place)
        _wait_for(
            lambda: (app.screen()[part] != empty[part]).any(axis=-1).sum() > 5000,
            "a text of several lines",
        )
        _wait_for(app.is_asleep, "an idle processor")
        shown = app.screen()[part]
        assert (shown != empty[part]).any(axis=-1).sum() > 5000
        app.key("shift")  # has no effect, but triggers frames
        _wait_for(app.is_asleep, "an idle processor")
        assert (app.screen()[part] == shown).all()


def test_idle_window_uses_no_cpu(window):
    app = window(*FINAL)
    # Messages at the start disappear after some seconds; until then frames are drawn.
    time.sleep(0.5)
    app.tell("mousemove", 640, 870)

    _wait_for(lambda: app.is_asleep(1.5), "an idle processor")


def test_invalid_file_opens_no_window(display, tmp_path):
    bad = tmp_path / "bad.skel"
    bad.write_text("balljoint root {\n offset 1 2\n}\n")
    environment = {**os.environ, "DISPLAY": display, "PYTHONPATH": str(ROOT)}
    environment["XDG_STATE_HOME"] = str(tmp_path)
    done = subprocess.run(
        [sys.executable, "-m", "viewer", bad],
        env=environment, capture_output=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 2 and done.stdout == b""
    assert b"bad.skel:2: " in done.stderr and done.stderr.count(b"\n") == 1


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("MESA_GLSL_VERSION_OVERRIDE", "130", (b"GLSL 3.30 is needed", b"offers GLSL 1.30")),
        ("MESA_GL_VERSION_OVERRIDE", "3.1", (b"OpenGL 3.3 is needed", b"offers 3.1")),
    ],
)
def test_old_opengl_opens_no_window(display, forker, tmp_path, name, value, words):
    environment = {**os.environ, "DISPLAY": display, "PYTHONPATH": str(ROOT), name: value}
    environment |= {"XDG_STATE_HOME": str(tmp_path), "LIBGL_ALWAYS_SOFTWARE": "1"}
    done = forker.run(VIEWER, write_rig(tmp_path), tmp_path, environment)
    assert done.returncode == 4 and done.stdout == b"" and done.stderr.count(b"\n") == 1
    for word in (*words, b"renderer ", f"{name}={value}".encode()):
        assert word in done.stderr


def test_window_of_a_program_follows_it_and_closes_with_it(display, tmp_path, monkeypatch):
    for name in ("STATE", "CONFIG"):
        monkeypatch.setenv(f"XDG_{name}_HOME", str(tmp_path / name))
    monkeypatch.setenv("DISPLAY", display)
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    scene = viewer.load()
    settings = DisplayOptions(quality="draft", shading="normals")
    with viewer.show(scene, options=settings, block=False) as window:
        before = _wait_for(lambda: _screen_if_drawn(display), "the figure")
        scene[0].pose.figure_translation[:] = [0.0, 0.1, 0.0]
        window.update()
        _wait_for(lambda: (_screen_if_drawn(display) != before).any(), "another pose")
        assert window["fox"] is scene[0]
        other = viewer.connect(window._folder / "window.json")
        assert np.array_equal(other["fox"].pose.figure_translation, [0.0, 0.1, 0.0])
        other.close()
        process, folder = window._process, window._folder
    assert (process.returncode, folder.exists(), window.is_open) == (0, False, False)


def _screen_if_drawn(display):
    pixels = np.array(ImageGrab.grab(xdisplay=display).convert("RGB"))
    return pixels if pixels.max() > 0 else None


def test_window_of_a_program_without_a_display_is_an_error(monkeypatch):
    monkeypatch.setenv("DISPLAY", ":987")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(ViewerError, match="no display found"):
        viewer.show(viewer.load(), block=False)


def test_window_that_failed_says_why(display, tmp_path, monkeypatch, capsys):
    for name in ("STATE", "CONFIG"):
        monkeypatch.setenv(f"XDG_{name}_HOME", str(tmp_path / name))
    monkeypatch.setenv("DISPLAY", display)
    monkeypatch.setenv("MESA_GL_VERSION_OVERRIDE", "3.1")
    monkeypatch.setenv("LIBGL_ALWAYS_SOFTWARE", "1")
    with viewer.show(viewer.load(), block=False) as window:
        _wait_for(lambda: not window.is_open, "the end of the window")
        with pytest.raises(RenderError, match="OpenGL"):
            window.update()
        _wait_for(lambda: "OpenGL" in capsys.readouterr().err, "the message")


def test_awaited_event_is_followed_by_frames_showing_it():
    for at in range(1, 9):  # the frame that shows it, even the last before the window sleeps
        rest = Rest()
        for frame in range(at):
            rest.count(happened=frame % 4 == 0, awaits=True)
        drawn = 0
        for _ in range(12):
            rest.count(happened=False, awaits=False)
            drawn += rest.left >= 0
        # ImGui measures a window in its first frame, and shows it with its size in the second.
        assert drawn >= 2 and rest.left < 0


def test_waiting_times_out_when_nothing_happens():
    rest, drawn = Rest(), 0
    for _ in range(20):
        rest.count(happened=False, awaits=False)
        drawn += rest.left >= 0
    assert 0 < drawn < 5
