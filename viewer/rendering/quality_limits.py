"""Limits of final quality: the work of software rendering, and graphics memory."""

from __future__ import annotations

import math

import moderngl

from viewer.rendering.gpu.context import is_software
from viewer.rendering.options import DisplayOptions
from viewer.rig.scene import Scene

__all__ = ["limit_passes", "time_note"]

_MOST_WORK = 2.0  # maximum work for a still image
# Minimum number of passes, below which the image looks no better than in normal quality.
_FEWEST = 3
# Memory for the sum of passes and for occlusion at half resolution, and its limit.
_BYTES_PER_PIXEL, _MOST_BYTES = 25, 1e9
# Work per pass, pixel and triangle, in units of about a second on two cores.
_PER_PASS, _PER_PIXEL, _PER_TRIANGLE = 0.02, 1e-7, 1.5e-6
_PATIENCE = 5.0  # drawing time in seconds above which a message states it


def limit_passes(
    options: DisplayOptions, scene: Scene, size: tuple[int, int], context: moderngl.Context
) -> list[str]:
    """Lower the quality if it would take a long time in software, or need over 1 GB of memory.

    The work is counted, not timed, so that an image does not depend on the machine or its load.

    Parameters
    ----------
    options : DisplayOptions
        Display options; modified in place if necessary.
    scene : Scene
        The scene to draw.
    size : (int, int)
        Width and height in pixels.
    context : moderngl.Context
        Context, which determines whether rendering is done in software.

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
    n_triangles = sum(mesh.n_triangles for mesh in meshes if mesh)
    work = _PER_PASS + _PER_PIXEL * math.prod(size) + _PER_TRIANGLE * n_triangles
    passes, wanted = int(_MOST_WORK / work), options.passes
    if passes >= wanted:
        return []
    what = f"{passes} of {wanted} passes"
    if passes < _FEWEST:
        options.quality, what = "normal", "normal quality"
    else:
        options.passes = passes
    pixels = f"{math.prod(size) / 1e6:.1f} megapixels and {n_triangles} triangles"
    return [
        f"drawn with {what}, as {pixels} take a long time in software; "
        f"--quality final draws all {wanted}"
    ]


def time_note(seconds: float, count: int) -> list[str]:
    """Return a message about the time of an image that takes long.

    Parameters
    ----------
    seconds : float
        Measured time of one pass.
    count : int
        Number of passes.
    """
    if seconds * count <= _PATIENCE:
        return []
    return [
        f"final quality takes about {seconds * count:.0f} s here: {count} passes of "
        f"{seconds:.1f} s; --quality normal draws one"
    ]
