"""The display: whether a window can be opened on it, and what happens when it is lost.

Xlib exits the process after an error, and after the loss of the connection, with its own message
and exit code 1. It has one handler for each, which a program can replace.

A request about a window that no longer exists is an error. GLFW answers programs that drag files
onto the window, and that paste from it; if such a program ends before it is answered, the answer is
lost, and nothing else is wrong. So those errors are ignored, and all others are left to Xlib.

The handler of a lost connection must not return: OpenGL drivers would use replies that the X server
never sent, and crash. So it does all of the clean-up.
"""

from __future__ import annotations

import ctypes
import os
import sys
import warnings
from typing import Any

from viewer.errors import RenderError, ViewerError
from viewer.media.unfinished import remove_unfinished
from viewer.rendering.gpu.context import explain_failure, offer_of, offer_text


class NoDisplay(ViewerError):  # noqa: N818  a state of the machine, not a fault
    """Raised if there is no display on which a window can be opened."""


def import_glfw() -> Any:
    """Return the module glfw, bound to the library shipped with imgui-bundle."""
    # Two copies of GLFW in one process do not share windows. imgui-bundle tells glfw which one
    # to load, so it is imported first.
    import imgui_bundle  # noqa: F401, I001

    import glfw

    # By default, errors become Python warnings; the viewer queries and raises them instead.
    glfw.ERROR_REPORTING = "ignore"
    return glfw


def window_error(message: str) -> RenderError:
    """Return an error with the display's OpenGL version, or GLFW's message if it has none."""
    glfw = import_glfw()
    glfw.default_window_hints()
    glfw.window_hint(glfw.VISIBLE, False)
    # Without a requested version, GLFW creates the newest compatibility profile.
    handle = glfw.create_window(64, 64, "viewer", None, None)
    if not handle:
        return RenderError(explain_failure(message))
    try:
        glfw.make_context_current(handle)
        address = glfw.get_proc_address("glGetString")
        return RenderError(offer_text(offer_of(address)) if address else explain_failure(message))
    finally:
        glfw.destroy_window(handle)


def find_display() -> None:
    """Raise ``NoDisplay``, with the reason in one line, if no window can be opened."""
    if sys.platform.startswith("linux"):
        names = ("DISPLAY", "WAYLAND_DISPLAY")
        if not any(os.environ.get(name) for name in names):
            raise NoDisplay("no display found (DISPLAY is not set)")
        if not os.environ.get("DISPLAY"):
            raise NoDisplay("no X display found (DISPLAY is not set; Wayland needs XWayland)")
        watch_display()
    glfw = import_glfw()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        started = glfw.init()
    if not started:
        stop_watching()
        code, text = glfw.get_error()
        message = text.decode() if isinstance(text, bytes) else text or f"GLFW error {code}"
        display = os.environ.get("DISPLAY", "")
        raise NoDisplay(f"no display found (DISPLAY={display}: {message})")


_LIBRARY = "libX11.so.6"  # the library that GLFW loads, which shares the handlers


class _ErrorEvent(ctypes.Structure):
    """XErrorEvent of Xlib.h."""

    _fields_ = (
        ("type", ctypes.c_int),
        ("display", ctypes.c_void_p),
        ("resource", ctypes.c_ulong),
        ("serial", ctypes.c_ulong),
        ("error", ctypes.c_ubyte),
        ("request", ctypes.c_ubyte),
        ("minor", ctypes.c_ubyte),
    )


_LossHandler = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p)
_ErrorHandler = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.POINTER(_ErrorEvent))
_BAD_WINDOW = 3

# Requests of GLFW about the window of another program, by their numbers in Xproto.h.
_TO_OTHERS = {2, 18, 20, 24, 25}
"""ChangeWindowAttributes, ChangeProperty, GetProperty, ConvertSelection and SendEvent."""


def watch_display() -> None:
    """Install the handlers of lost windows and of a lost connection, once, before GLFW starts."""
    global _library
    if _library is None:
        _library = _open_library()
        if _library is not None:
            _before[:] = (
                _library.XSetIOErrorHandler(_loss_handler),
                _library.XSetErrorHandler(_error_handler),
            )


def stop_watching() -> None:
    """Restore Xlib's previous handlers."""
    global _library
    if _library is not None:
        _library.XSetIOErrorHandler(_before[0])
        _library.XSetErrorHandler(_before[1])
        _library = None


def _pass_over(display: int | None, event: ctypes._Pointer[_ErrorEvent]) -> int:
    """Ignore an answer to a window that is gone; leave any other error to the previous handler."""
    found = event.contents
    if found.error == _BAD_WINDOW and found.request in _TO_OTHERS:
        return 0
    return int(_before[1](display, event))


def _leave(_: object) -> int:
    """Remove partial files, print the reason, and exit."""
    try:
        remove_unfinished()
        display = os.environ.get("DISPLAY", "")
        text = f"lost the display: the X server closed the connection (DISPLAY={display})"
        if sys.stderr is not None:
            sys.stderr.write(f"viewer: {text}\n")
            sys.stderr.flush()
    finally:
        os._exit(RenderError.exit_code)


def _open_library() -> ctypes.CDLL | None:
    try:
        library = ctypes.CDLL(_LIBRARY)
    except OSError:  # GLFW is linked without Xlib
        return None
    library.XSetIOErrorHandler.argtypes = [_LossHandler]
    library.XSetIOErrorHandler.restype = _LossHandler
    library.XSetErrorHandler.argtypes = [_ErrorHandler]
    library.XSetErrorHandler.restype = _ErrorHandler
    return library


# Xlib has one handler of each kind per process and may call it at any time, so both must stay
# alive.
_loss_handler = _LossHandler(_leave)
_before: list[Any] = []
_error_handler = _ErrorHandler(_pass_over)
_library: ctypes.CDLL | None = None
