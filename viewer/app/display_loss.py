"""What happens when the X server goes away while a window is open.

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

__all__ = ["DisplayLoss"]

_LIBRARY = "libX11.so.6"  # the one that GLFW opens: both share its handlers
_Handler = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p)


class DisplayLoss:
    """Ends the process in the program's own way if the X server goes away.

    Parameters
    ----------
    has_display : bool
        Whether there is an X server; without one there is nothing to lose.
    """

    def __init__(self, has_display: bool) -> None:
        self._library = _library() if has_display else None
        # Xlib calls it as long as it has it: it lives as long as this object.
        self._handler = _Handler(_leave)
        if self._library is not None:
            self._before = self._library.XSetIOErrorHandler(self._handler)

    def release(self) -> None:
        """Give Xlib back the handler that it had."""
        if self._library is not None:
            self._library.XSetIOErrorHandler(self._before)


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


def _library() -> ctypes.CDLL | None:
    try:
        library = ctypes.CDLL(_LIBRARY)
    except OSError:  # GLFW was linked in another way
        return None
    library.XSetIOErrorHandler.argtypes = [_Handler]
    library.XSetIOErrorHandler.restype = _Handler
    return library
