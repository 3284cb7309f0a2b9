"""Files dragged from another program onto a window: the source side of the XDND protocol."""

import ctypes
import time
from ctypes import POINTER, Structure, c_char_p, c_int, c_long, c_uint, c_ulong, c_void_p
from pathlib import Path

_CLIENT_MESSAGE, _SELECTION_REQUEST, _SELECTION_NOTIFY = 33, 30, 31
_VERSION = 5
_PATIENCE = 20.0


class _Message(Structure):
    """XClientMessageEvent, padded to the size of XEvent."""

    _fields_ = (
        ("type", c_int),
        ("serial", c_ulong),
        ("send_event", c_int),
        ("display", c_void_p),
        ("window", c_ulong),
        ("message_type", c_ulong),
        ("format", c_int),
        ("data", c_long * 5),
        ("padding", c_long * 24),
    )


class _Request(Structure):
    """XSelectionRequestEvent, padded."""

    _fields_ = (
        ("type", c_int),
        ("serial", c_ulong),
        ("send_event", c_int),
        ("display", c_void_p),
        ("owner", c_ulong),
        ("requestor", c_ulong),
        ("selection", c_ulong),
        ("target", c_ulong),
        ("property", c_ulong),
        ("time", c_ulong),
        ("padding", c_long * 24),
    )


class _Notice(Structure):
    """XSelectionEvent, padded."""

    _fields_ = (
        ("type", c_int),
        ("serial", c_ulong),
        ("send_event", c_int),
        ("display", c_void_p),
        ("requestor", c_ulong),
        ("selection", c_ulong),
        ("target", c_ulong),
        ("property", c_ulong),
        ("time", c_ulong),
        ("padding", c_long * 24),
    )


def _library():
    x11 = ctypes.CDLL("libX11.so.6")
    x11.XOpenDisplay.restype = c_void_p
    x11.XOpenDisplay.argtypes = [c_char_p]
    x11.XInternAtom.restype = x11.XDefaultRootWindow.restype = c_ulong
    x11.XCreateSimpleWindow.restype = c_ulong
    x11.XInternAtom.argtypes = [c_void_p, c_char_p, c_int]
    for name in ("XDefaultRootWindow", "XCloseDisplay", "XPending", "XFlush"):
        getattr(x11, name).argtypes = [c_void_p]
    x11.XCreateSimpleWindow.argtypes = [
        c_void_p, c_ulong, c_int, c_int, c_uint, c_uint, c_uint, c_ulong, c_ulong,
    ]  # fmt: skip
    x11.XSetSelectionOwner.argtypes = [c_void_p, c_ulong, c_ulong, c_ulong]
    x11.XSendEvent.argtypes = [c_void_p, c_ulong, c_int, c_long, c_void_p]
    x11.XNextEvent.argtypes = [c_void_p, c_void_p]
    x11.XChangeProperty.argtypes = [
        c_void_p, c_ulong, c_ulong, c_ulong, c_int, c_int, c_char_p, c_int,
    ]  # fmt: skip
    return x11


class _Source:
    """A program that offers files for dragging."""

    def __init__(self, display, window, paths):
        self.x11, self.window = _library(), int(window)
        self.display = self.x11.XOpenDisplay(display.encode())
        root = self.x11.XDefaultRootWindow(self.display)
        self.own = self.x11.XCreateSimpleWindow(self.display, root, 0, 0, 1, 1, 0, 0, 0)
        self.list = "".join(f"{Path(path).resolve().as_uri()}\r\n" for path in paths).encode()

    def atom(self, name):
        return self.x11.XInternAtom(self.display, name.encode(), 0)

    def send(self, name, *data):
        event = _Message(
            type=_CLIENT_MESSAGE, window=self.window, message_type=self.atom(name), format=32
        )
        for number, value in enumerate((self.own, *data)):
            event.data[number] = value
        self.x11.XSendEvent(self.display, self.window, 0, 0, ctypes.byref(event))
        self.x11.XFlush(self.display)

    def wait_for(self, name):
        """Return the data of a message from the window; send the file list when it is requested."""
        deadline, wanted = time.monotonic() + _PATIENCE, self.atom(name)
        while time.monotonic() < deadline:
            if not self.x11.XPending(self.display):
                time.sleep(0.01)
                continue
            event = _Message()
            self.x11.XNextEvent(self.display, ctypes.byref(event))
            if event.type == _SELECTION_REQUEST:
                self._hand_over(ctypes.cast(ctypes.byref(event), POINTER(_Request)).contents)
            elif event.type == _CLIENT_MESSAGE and event.message_type == wanted:
                return list(event.data)
        raise AssertionError(f"{name}: no answer within {_PATIENCE:g} s")

    def _hand_over(self, request):
        self.x11.XChangeProperty(
            self.display, request.requestor, request.property, request.target, 8, 0,
            self.list, len(self.list),
        )  # fmt: skip
        notice = _Notice(
            type=_SELECTION_NOTIFY,
            requestor=request.requestor,
            selection=request.selection,
            target=request.target,
            property=request.property,
            time=request.time,
        )
        self.x11.XSendEvent(self.display, request.requestor, 0, 0, ctypes.byref(notice))
        self.x11.XFlush(self.display)


def drag_and_vanish(display, window, paths, place=(400, 300)):
    """Drag files onto a window, and close the source's own window before it is answered."""
    source = _Source(display, window, paths)
    copy = source.atom("XdndActionCopy")
    source.send("XdndEnter", _VERSION << 24, source.atom("text/uri-list"), 0, 0)
    source.send("XdndPosition", 0, place[0] << 16 | place[1], 0, copy)
    source.x11.XCloseDisplay(source.display)


def drag_files(display, window, paths, place=(400, 300)):
    """Drag files onto a window and drop them there.

    Parameters
    ----------
    display : str
        Name of the X display.
    window : str or int
        The window's number.
    paths : sequence of Path
        Files and folders.
    place : (int, int)
        Drop position in screen pixels.
    """
    source = _Source(display, window, paths)
    try:
        kind, copy = source.atom("text/uri-list"), source.atom("XdndActionCopy")
        selection = source.atom("XdndSelection")
        source.x11.XSetSelectionOwner(source.display, selection, source.own, 0)
        source.send("XdndEnter", _VERSION << 24, kind, 0, 0)
        source.send("XdndPosition", 0, place[0] << 16 | place[1], 0, copy)
        assert source.wait_for("XdndStatus")[1] & 1, "the window does not accept files"
        source.send("XdndDrop", 0, 0, 0, 0)
        # GLFW answers with the number of bytes that it read.
        assert source.wait_for("XdndFinished")[1], "the window did not take the files"
    finally:
        source.x11.XCloseDisplay(source.display)
