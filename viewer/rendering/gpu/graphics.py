"""A headless context with its compiled programs, shared by everything that draws in a thread."""

from __future__ import annotations

import sys
import threading

from viewer.rendering.gpu.context import headless_context
from viewer.rendering.gpu.program import Programs

__all__ = ["Graphics", "thread_graphics"]

_thread = threading.local()


class Graphics:
    """A headless context and its programs, which outlive the renderers that use them.

    In software, a context and its first image take ten times as long as the next image.

    Parameters
    ----------
    device : int, optional
        Index of the EGL device; if omitted, each one is tried in turn.

    Raises
    ------
    RenderError
        If there is no usable OpenGL, with the cause and a remedy.
    """

    def __init__(self, device: int | None = None) -> None:
        self.context = headless_context(device)
        self.programs = Programs(self.context)
        self._framebuffer = self.context.simple_framebuffer((1, 1))
        self.context.info  # noqa: B018 - cached, so that it is available without a current context

    def rest(self) -> None:
        """Bind a framebuffer that remains valid, before another one is released."""
        self._framebuffer.use()

    def release(self) -> None:
        """Free everything, including the context."""
        with self.context:
            self.programs.release()
            self._framebuffer.release()
        self.context.release()


class _OfThread:
    """Graphics of a thread for each requested device, freed when the thread ends."""

    def __init__(self) -> None:
        self.kept: dict[int | None, Graphics] = {}

    def __del__(self) -> None:
        # At interpreter exit, objects are freed in an undefined order.
        if not sys.is_finalizing():
            for graphics in self.kept.values():
                graphics.release()


def thread_graphics(device: int | None = None) -> Graphics:
    """Return the graphics of this thread on a device, created on first use and never released.

    Raises
    ------
    RenderError
        If there is no usable OpenGL, with the cause and a remedy.
    """
    if not hasattr(_thread, "graphics"):
        _thread.graphics = _OfThread()
    kept: dict[int | None, Graphics] = _thread.graphics.kept
    if device not in kept:
        kept[device] = Graphics(device)
    return kept[device]
