"""Clean exit of the program when the connection to the X server is lost.

By default Xlib then exits the process, with its own message and exit code 1. A program can install
its own handler, but the handler must not return: OpenGL drivers would use replies that the X server
never sent, and crash. So the handler does all of the clean-up.
"""

from __future__ import annotations

import ctypes
import os
import sys
from typing import Any

from viewer.errors import RenderError
from viewer.media.unfinished import remove_unfinished

__all__ = ["stop_watching", "watch_display"]

_LIBRARY = "libX11.so.6"  # the library that GLFW loads, which shares the handlers
_Handler = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p)


def watch_display() -> None:
    """Install the handler that exits cleanly if the connection to the X server is lost.

    Called before GLFW starts, because the connection may be lost while a window is created. Further
    calls have no effect.
    """
    global _library
    if _library is None:
        _library = _open_library()
        if _library is not None:
            _before.append(_library.XSetIOErrorHandler(_handler))


def stop_watching() -> None:
    """Restore Xlib's previous handler."""
    global _library
    if _library is not None:
        _library.XSetIOErrorHandler(_before.pop())
        _library = None


def _leave(_: Any) -> int:
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
    library.XSetIOErrorHandler.argtypes = [_Handler]
    library.XSetIOErrorHandler.restype = _Handler
    return library


# Xlib has one handler per process and may call it at any time, so it must stay alive.
_handler = _Handler(_leave)
_library: ctypes.CDLL | None = None
_before: list[Any] = []
