"""The real window, driven by xdotool, and comparisons of its screenshots."""

import ctypes
import os
import subprocess
import time
from pathlib import Path

import numpy as np
from children import listening
from forked_programs import VIEWER
from PIL import ImageGrab

ROOT = Path(__file__).resolve().parents[1]
# These import nearly all that a window needs.
IMPORTED = (
    "PIL.Image",
    "viewer.app.opening",
    "viewer.app.window",
    "viewer.commands.view",
    "viewer.formats.skel",
    "viewer.formats.skin",
)
PATIENCE = 60.0  # timeout of an expected event in seconds
# A threshold of processor time in milliseconds. A frame drawn in software takes several times
# longer; waking up to check the clock takes a tenth of it.
A_FRAME = 8.0
LONGEST_SLEEP = 0.6  # seconds in which a window that is not asleep draws a frame


def _wait_for(condition, what):
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        found = condition()
        if found is not None and found is not False:
            return found
        time.sleep(0.1)  # a look at the screen takes a tenth of this
    raise AssertionError(f"not seen within {PATIENCE:g} s: {what}")


class _ClientMessage(ctypes.Structure):
    """XClientMessageEvent, padded to the size of XEvent."""

    _fields_ = (
        ("type", ctypes.c_int),
        ("serial", ctypes.c_ulong),
        ("send_event", ctypes.c_int),
        ("display", ctypes.c_void_p),
        ("window", ctypes.c_ulong),
        ("message_type", ctypes.c_ulong),
        ("format", ctypes.c_int),
        ("data", ctypes.c_long * 5),
        ("padding", ctypes.c_long * 24),
    )


def _ask_to_close(display, window):
    """Send WM_DELETE_WINDOW, as a window manager does when its close button is clicked."""
    x11 = ctypes.CDLL("libX11.so.6")
    x11.XOpenDisplay.restype = ctypes.c_void_p
    x11.XInternAtom.restype = ctypes.c_ulong
    connection = ctypes.c_void_p(x11.XOpenDisplay(display.encode()))
    protocols = x11.XInternAtom(connection, b"WM_PROTOCOLS", 0)
    delete = x11.XInternAtom(connection, b"WM_DELETE_WINDOW", 0)
    event = _ClientMessage(type=33, window=window, message_type=protocols, format=32)
    event.data[0] = delete
    x11.XSendEvent(connection, ctypes.c_ulong(window), 0, ctypes.c_long(0), ctypes.byref(event))
    x11.XCloseDisplay(connection)


class Window:
    """A running viewer, its window, mouse and keyboard."""

    def __init__(self, display, folder, arguments, forker=None, program=VIEWER):
        self.display, self.folder = display, folder
        self.environment = {
            **os.environ,
            "DISPLAY": display,
            "XDG_STATE_HOME": str(folder / "state"),
            "XDG_CONFIG_HOME": str(folder / "config"),
            "PYTHONPATH": str(ROOT),
            "PYTHONWARNINGS": "error",
        }
        self.environment.pop("WAYLAND_DISPLAY", None)
        if forker is None:
            self.process = subprocess.Popen(
                listening("-m", "viewer", *arguments),
                cwd=folder, env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            )  # fmt: skip
        else:
            self.process = forker.start(program, arguments, folder, self.environment)
        self.id = _wait_for(self._find, "the window")
        self.tell("windowfocus", "--sync", self.id)
        self.wait_until_quiet()

    def _find(self):
        assert self.process.poll() is None, self.process.communicate()
        pid = str(self.process.pid)
        found = self.tell("search", "--onlyvisible", "--pid", pid, "--class", "viewer", check=False)
        return found.split()[0] if found else None

    def tell(self, *words, check=True):
        done = subprocess.run(
            ["xdotool", *map(str, words)],
            env=self.environment, capture_output=True, text=True, timeout=PATIENCE, check=check,
        )  # fmt: skip
        return done.stdout.strip()

    def screen(self):
        # RGB, not copied: while a test waits, it looks ten times a second.
        return np.asarray(ImageGrab.grab(xdisplay=self.display))

    def wait_until_quiet(self, still=0.25):
        """Return the screen once it shows the figure and has not changed for ``still`` seconds.

        On a busy machine, a window may draw no frame for longer than that: half of these seconds
        must be its own processor time, unless it sleeps.
        """
        last, looks = None, []

        def is_quiet():
            nonlocal last
            screen, now, used = self.screen(), time.monotonic(), self.milliseconds_of_cpu()
            looks.append((now, used))
            if last is None or (screen != last[0]).any() or screen.max() == 0:
                last, looks[:-1] = (screen, now, used), []
            before = [each for when, each in looks if when <= now - LONGEST_SLEEP]
            is_drawn = used - last[2] > 500.0 * still
            is_asleep = bool(before) and used - before[-1] < A_FRAME
            return screen if now - last[1] > still and (is_drawn or is_asleep) else None

        return _wait_for(is_quiet, "a picture that stands still")

    def wait_until_changed(self, before, region=None):
        x, y, width, height = region or (0, 0, 1400, 900)
        part = np.s_[int(y) : int(y + height), int(x) : int(x + width)]

        def changed():
            # A change such as a highlight or a partly drawn frame may disappear before the picture
            # settles.
            still = self.wait_until_quiet()
            return still if (still[part] != before[part]).any() else None

        _wait_for(lambda: (self.screen()[part] != before[part]).any(), "a change")
        return _wait_for(changed, "a change that stays")

    def wait_until_shown(self, wanted, part):
        _wait_for(lambda: (self.screen()[part] == wanted[part]).all(), "an earlier picture")

    def key(self, name):
        # Without a window manager the focus may be lost; keys then go to the window under the
        # pointer.
        self.tell("windowfocus", "--sync", self.id)
        self.tell("key", "--clearmodifiers", name)

    def drag(self, start, end):
        self.tell("mousemove", round(start[0]), round(start[1]), "mousedown", 1)
        for k in (0.3, 0.7, 1.0):
            x, y = (round(a + k * (b - a)) for a, b in zip(start, end, strict=True))
            self.tell("mousemove", x, y)
            time.sleep(0.05)
        self.tell("mouseup", 1)
        self.tell("mousemove", 640, 870)  # off the window: nothing is hovered

    def finish(self):
        """Return the program's output after it has exited successfully."""
        out, err = self.process.communicate(timeout=PATIENCE)
        assert (self.process.returncode, out, err) == (0, b"", b"")

    def milliseconds_of_cpu(self):
        """Return the processor time of all threads, by the process's own clock."""
        # The clock's number as clock_getcpuclockid of the C library computes it (on Linux,
        # CPUCLOCK_SCHED is 2).
        return 1e3 * time.clock_gettime(~self.process.pid << 3 | 2)

    def is_asleep(self, seconds=LONGEST_SLEEP):
        """Return whether the window draws no frame for longer than its longest sleep."""
        before = self.milliseconds_of_cpu()
        time.sleep(seconds)
        return self.milliseconds_of_cpu() - before < A_FRAME
