"""OpenGL state that is set for a block of draw calls and restored afterwards."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import moderngl

_FARTHER = 2.0, 8.0  # factor of the slope and units of the polygon offset


@contextmanager
def without_depth_writes(context: moderngl.Context) -> Iterator[None]:
    """Draw without writing depth, so that later draw calls are not hidden."""
    target = context.fbo
    target.depth_mask = False
    target.use()  # moderngl applies masks to OpenGL only when a framebuffer is bound
    try:
        yield
    finally:
        target.depth_mask = True
        target.use()


@contextmanager
def behind(context: moderngl.Context) -> Iterator[None]:
    """Draw slightly farther away, so that coincident surfaces hide what is drawn completely."""
    context.polygon_offset = _FARTHER
    try:
        yield
    finally:
        context.polygon_offset = 0.0, 0.0


@contextmanager
def without_colors(context: moderngl.Context) -> Iterator[None]:
    """Draw depth only."""
    target = context.fbo
    target.color_mask = False, False, False, False
    target.use()  # moderngl applies masks to OpenGL only when a framebuffer is bound
    try:
        yield
    finally:
        target.color_mask = True, True, True, True
        target.use()


@contextmanager
def without_depth_test(context: moderngl.Context) -> Iterator[None]:
    """Draw regardless of depth, over previous draw calls."""
    context.disable(moderngl.DEPTH_TEST)
    try:
        yield
    finally:
        context.enable(moderngl.DEPTH_TEST)


@contextmanager
def clipped(context: moderngl.Context, region: tuple[int, int, int, int]) -> Iterator[None]:
    """Draw only in a region: left, bottom, width and height in pixels."""
    context.scissor = region
    try:
        yield
    finally:
        context.scissor = None


@contextmanager
def sides(
    context: moderngl.Context,
    culled: bool,
    double_sided: bool,
    blended: bool,
    is_mirrored: bool = False,
) -> Iterator[tuple[str, ...]]:
    """Cull faces for several draw calls: yield the culled side of each."""
    both = double_sided and not culled
    if both and not blended:
        yield ("back",)
        return
    context.enable(moderngl.CULL_FACE)
    context.cull_face = "back"
    context.front_face = "cw" if is_mirrored else "ccw"
    try:
        yield ("front", "back") if both else ("back",)
    finally:
        context.front_face = "ccw"
        context.disable(moderngl.CULL_FACE)


def opacities(context: moderngl.Context, hidden: float | None) -> Iterator[float]:
    """Yield the opacity of each draw call, first for hidden parts, then for visible ones."""
    # Without an opacity of hidden parts there is one draw call, over everything.
    for order, opacity in (("1", 1.0),) if hidden is None else ((">", hidden), ("<=", 1.0)):
        context.depth_func = order
        yield opacity
    context.depth_func = "<"


def draw_nearest(context: moderngl.Context, draw: Callable[[], object]) -> None:
    """Draw the nearest layer of a translucent object: first its depth, then its colours."""
    with without_colors(context):
        draw()
    context.depth_func = "<="
    draw()
    context.depth_func = "<"
