"""Wait for the driver without keeping Python's lock, so that other threads go on meanwhile.

moderngl holds the lock in every call. Reading a picture that is still being drawn takes as long as
the drawing, and all that time no other thread may run Python: an encoder's thread that needs the
lock five times a frame would get through a frame in five of them. ``ctypes`` lets go of the lock
while it calls a function, so two functions of OpenGL are called through it.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import moderngl

__all__ = ["Waiter"]


class Waiter:
    """Starts what was asked of the driver, and waits for it.

    Parameters
    ----------
    context : moderngl.Context
        Current whenever a method is called.

    Attributes
    ----------
    is_free : bool
        Whether other threads run meanwhile; False with versions of moderngl that do not show
        where the functions are. Then everything works as well, but slower.
    """

    def __init__(self, context: moderngl.Context) -> None:
        flush, finish = _function(context, "glFlush"), _function(context, "glFinish")
        self.is_free = finish is not None
        self._flush: Callable[[], None] = flush or _nothing
        self._finish: Callable[[], None] = finish or context.finish

    def begin(self) -> None:
        """Have the driver begin with all that it was asked for, and do not wait."""
        self._flush()

    def end(self) -> None:
        """Wait until the driver is done with all that it was asked for."""
        self._finish()


def _function(context: moderngl.Context, name: str) -> Callable[[], None] | None:
    """Return a function of OpenGL without arguments, None if nobody tells where it is."""
    loader = getattr(getattr(context.mglo, "_context", None), "load_opengl_function", None)
    address = loader(name) if loader is not None else 0
    return ctypes.CFUNCTYPE(None)(address) if address else None


def _nothing() -> None:
    pass
