"""OpenGL states that are set for some draws and restored after them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import moderngl

__all__ = ["opacities", "without_colors", "without_depth_test", "without_depth_writes"]


@contextmanager
def without_depth_writes(context: moderngl.Context) -> Iterator[None]:
    """Draw without writing depths, so that later draws are not hidden."""
    target = context.fbo
    target.depth_mask = False
    target.use()  # moderngl hands masks to OpenGL only then
    try:
        yield
    finally:
        target.depth_mask = True
        target.use()


@contextmanager
def without_colors(context: moderngl.Context) -> Iterator[None]:
    """Draw depths only."""
    target = context.fbo
    target.color_mask = False, False, False, False
    target.use()  # moderngl hands masks to OpenGL only then
    try:
        yield
    finally:
        target.color_mask = True, True, True, True
        target.use()


@contextmanager
def without_depth_test(context: moderngl.Context) -> Iterator[None]:
    """Draw over or under everything else, whatever its depth."""
    context.disable(moderngl.DEPTH_TEST)
    try:
        yield
    finally:
        context.enable(moderngl.DEPTH_TEST)


def opacities(context: moderngl.Context, hidden: float | None) -> Iterator[float]:
    """Yield the opacity of each draw: first of hidden parts, then of visible ones.

    ``hidden`` is the opacity of the first; None draws once, over everything.
    """
    for order, opacity in (("1", 1.0),) if hidden is None else ((">", hidden), ("<=", 1.0)):
        context.depth_func = order
        yield opacity
    context.depth_func = "<"
