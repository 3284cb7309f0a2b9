"""Limits of final quality: the time of software rendering, and graphics memory."""

from __future__ import annotations

import math

import moderngl

from viewer.rendering.gpu.context import is_software
from viewer.rendering.options import DisplayOptions
from viewer.rig.scene import Scene

__all__ = ["limit_passes", "seconds_per_pass"]

_PATIENCE = 2.0  # seconds for a still image
_FEWEST = 3  # minimum number of passes; fewer look no better than normal quality
_BYTES_PER_PIXEL, _MOST_BYTES = 25, 1e9  # of the sum of passes, and occlusion at half resolution
_PER_PASS, _PER_PIXEL, _PER_TRIANGLE = 0.02, 1e-7, 1.5e-6  # seconds on two cores, measured


def seconds_per_pass(size: tuple[int, int], n_triangles: int) -> float:
    """Return roughly how long llvmpipe takes to draw a pass of final quality on two cores.

    >>> round(seconds_per_pass((1280, 720), 12000), 2)
    0.13
    """
    return _PER_PASS + _PER_PIXEL * math.prod(size) + _PER_TRIANGLE * n_triangles


def limit_passes(
    options: DisplayOptions, scene: Scene, size: tuple[int, int], context: moderngl.Context
) -> list[str]:
    """Lower a quality that would take more than two seconds in software, or 1 GB of memory.

    The time is estimated, not measured, so that the image does not depend on the machine's load.

    Parameters
    ----------
    options : DisplayOptions
        Display options; modified in place if necessary.
    scene : Scene
        The scene to draw.
    size : (int, int)
        Width and height in pixels.
    context : moderngl.Context
        Context, which tells whether rendering is done in software.

    Returns
    -------
    list of str
        A message if the quality was lowered.
    """
    if options.quality != "final":
        return []
    memory = _BYTES_PER_PIXEL * math.prod(size)
    if memory > _MOST_BYTES:
        options.quality = "normal"
        return [
            f"drawn with normal quality, as final needs {memory / 1e9:.1f} GB of graphics memory "
            "in addition to the image; --quality final draws it"
        ]
    if not is_software(context):
        return []
    meshes = [actor.figure.mesh for actor in scene.actors if actor.is_drawn]
    seconds = seconds_per_pass(size, sum(mesh.n_triangles for mesh in meshes if mesh))
    passes, wanted = int(_PATIENCE / seconds), options.passes
    if passes >= wanted:
        return []
    what = f"{passes} of {wanted} passes"
    if passes < _FEWEST:
        options.quality, what = "normal", "normal quality"
    else:
        options.passes = passes
    return [
        f"drawn with {what}, as software rendering takes about {seconds:.1f} s for each of "
        f"{wanted}; --quality final draws them all"
    ]
