"""Detection of a display on which a window can be opened, with the reason if there is none."""

from __future__ import annotations

import os
import sys
import warnings
from typing import Any

from viewer.app.display_loss import stop_watching, watch_display
from viewer.errors import RenderError, ViewerError
from viewer.rendering.gpu.context import explain_failure, offer_of, offer_text

__all__ = ["NoDisplay", "find_display", "import_glfw", "window_error"]


class NoDisplay(ViewerError):  # noqa: N818  a state of the machine, not a fault
    """Raised if there is no display on which a window can be opened."""


def import_glfw() -> Any:
    """Return the module glfw, bound to the library shipped with imgui-bundle.

    Two copies of GLFW in one process do not share windows. imgui-bundle tells glfw
    which one to load, so imgui-bundle must be imported first.
    """
    import imgui_bundle  # noqa: F401, I001

    import glfw

    # By default, errors become Python warnings; the viewer queries and raises them instead.
    glfw.ERROR_REPORTING = "ignore"
    return glfw


def window_error(message: str) -> RenderError:
    """Return an error with the OpenGL version of a display on which no window can be created.

    Parameters
    ----------
    message : str
        GLFW's message, used if the display has no OpenGL at all.
    """
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
    """Check that a window can be opened.

    Raises
    ------
    NoDisplay
        If no window can be opened; the message gives the reason in one line.
    """
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
