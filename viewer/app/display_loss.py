"""Orderly end of the program when the X server goes away.

Xlib then leaves the process from within whatever called it, with a line of its own and exit code 1.
It lets a program have a handler instead, which must not return: OpenGL's drivers go on with what an
X server without a connection never answered, and crash. So the handler does all that is left to do.
"""

from __future__ import annotations

import ctypes
import os
import sys
from typing import Any

from viewer.errors import RenderError
from viewer.media.unfinished import remove_unfinished

__all__ = ["stop_watching", "watch_display"]

_LIBRARY = "libX11.so.6"  # the one that GLFW opens: both share its handlers
_Handler = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p)


def watch_display() -> None:
    """End the process in the program's own way if the X server goes away, from now on.

    To be called before GLFW starts: the server may go while a window is being made. It may be
    called again.
    """
    global _library
    if _library is None:
        _library = _open_library()
        if _library is not None:
            _before.append(_library.XSetIOErrorHandler(_handler))


def stop_watching() -> None:
    """Give Xlib back the handler that it had."""
    global _library
    if _library is not None:
        _library.XSetIOErrorHandler(_before.pop())
        _library = None


def _leave(_: Any) -> int:
    """Remove what is half written, say what has happened, and end."""
    try:
        remove_unfinished()
        display = os.environ.get("DISPLAY", "")
        text = f"the display is lost: the X server closed the connection (DISPLAY={display})"
        if sys.stderr is not None:
            sys.stderr.write(f"viewer: {text}\n")
            sys.stderr.flush()
    finally:
        os._exit(RenderError.exit_code)


def _open_library() -> ctypes.CDLL | None:
    try:
        library = ctypes.CDLL(_LIBRARY)
    except OSError:  # GLFW was linked in another way
        return None
    library.XSetIOErrorHandler.argtypes = [_Handler]
    library.XSetIOErrorHandler.restype = _Handler
    return library


# Xlib has one handler for the process, and calls it as long as it has it.
_handler = _Handler(_leave)
_library: ctypes.CDLL | None = None
_before: list[Any] = []
