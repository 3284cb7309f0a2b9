"""Translucent surfaces, drawn as a single layer where they overlap."""

from __future__ import annotations

from collections.abc import Callable

import moderngl

from viewer.rendering.gpu.draw_state import without_colors
from viewer.rendering.options import DisplayOptions

__all__ = ["draw_layer", "draw_nearest", "surface_opacity"]

_XRAY_OPACITY = 0.4


def surface_opacity(options: DisplayOptions) -> float:
    """Return the opacity of surfaces, 0 to 1.

    Colours of scalar quantities must match the legend, so these surfaces stay opaque.
    """
    return _XRAY_OPACITY if options.xray and options.shading != "scalar" else 1.0


def draw_layer(
    context: moderngl.Context, options: DisplayOptions, draw: Callable[[], object]
) -> None:
    """Draw surfaces; only the nearest layer if they are translucent.

    Parameters
    ----------
    context : moderngl.Context
        The context in use.
    options : DisplayOptions
        Display options that determine the opacity of surfaces.
    draw : callable
        Draws the surfaces; called twice if they are translucent.
    """
    if surface_opacity(options) == 1.0:
        draw()
    else:
        draw_nearest(context, draw)


def draw_nearest(context: moderngl.Context, draw: Callable[[], object]) -> None:
    """Draw the nearest layer of a translucent object: first its depth, then its colours."""
    with without_colors(context):
        draw()
    context.depth_func = "<="
    draw()
    context.depth_func = "<"
