"""Waiting for the driver without holding Python's lock, so that other threads can run.

moderngl holds the global interpreter lock during every call. Reading an image that is still being
drawn blocks until the drawing is finished, and meanwhile no other thread can run Python: an encoder
thread that needs the lock five times per frame would be delayed by five frames. ``ctypes`` releases
the lock during a call, so two OpenGL functions are called through it.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import moderngl

__all__ = ["Waiter"]


class Waiter:
    """Submission of work to the driver, and waiting for its completion.

    Parameters
    ----------
    context : moderngl.Context
        The context in use; it must be current whenever a method is called.

    Attributes
    ----------
    is_free : bool
        Whether other threads can run during the wait. False with versions of moderngl that do not
        expose the functions' addresses; recording still works then, but more slowly.
    """

    def __init__(self, context: moderngl.Context) -> None:
        flush, finish = _function(context, "glFlush"), _function(context, "glFinish")
        self.is_free = finish is not None
        self._flush: Callable[[], None] = flush or _nothing
        self._finish: Callable[[], None] = finish or context.finish

    def begin(self) -> None:
        """Submit all queued work to the driver without waiting."""
        self._flush()

    def end(self) -> None:
        """Wait until the driver has finished all queued work."""
        self._finish()


def _function(context: moderngl.Context, name: str) -> Callable[[], None] | None:
    """Return an OpenGL function without arguments; None if its address is unknown."""
    loader = getattr(getattr(context.mglo, "_context", None), "load_opengl_function", None)
    address = loader(name) if loader is not None else 0
    return ctypes.CFUNCTYPE(None)(address) if address else None


def _nothing() -> None:
    pass
