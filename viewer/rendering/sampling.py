"""Passes of an image in final quality, whose results are averaged: their offsets and their number.

The number is limited by the work of software rendering and by graphics memory.
"""

from __future__ import annotations

import math
from dataclasses import replace

import moderngl
import numpy as np

from viewer.data_classes import dataclass
from viewer.phrases import file_size
from viewer.rendering.gpu.context import is_software
from viewer.rendering.options import DisplayOptions
from viewer.rendering.view import View, light_axes
from viewer.rigs.arrays import Floats
from viewer.rigs.scene import Scene

_LIGHT_RADIUS = math.tan(math.radians(1.7))  # radius of the key light's disc, at distance 1
_GOLDEN = math.pi * (3.0 - math.sqrt(5.0))

# Limits of final quality.
_MOST_WORK = 2.0  # maximum work for a still image
# Minimum number of passes, below which the image looks no better than in normal quality.
_FEWEST = 3
# Memory for the sum of passes and for occlusion at half resolution, and its limit.
_BYTES_PER_PIXEL, _MOST_BYTES = 25, 1e9
# Work per pass, pixel and triangle, in units of about a second on two cores.
_PER_PASS, _PER_PIXEL, _PER_TRIANGLE = 0.02, 1e-7, 1.5e-6
_PATIENCE = 5.0  # drawing time in seconds above which a message states it


@dataclass(frozen=True, slots=True)
class Sample:
    """One pass of an image."""

    shift: tuple[float, float] = (0.0, 0.0)
    """Shift of the image, pixels: -0.5 to 0.5."""
    light: tuple[float, float] = (0.0, 0.0)
    """A point on the key light's disc, which has radius 1."""
    phase: float = 0.0
    """Phase of the pattern of directions in which occluders are searched for, 0 to 1."""
    threshold: float = 0.5
    """Opacity above which actors cast shadows, 0 to 1."""


def n_passes(options: DisplayOptions) -> int:
    """Return the number of passes that are averaged in an image."""
    return max(options.passes, 1) if options.quality == "final" else 1


def pass_sample(index: int, count: int) -> Sample:
    """Return one of ``count`` passes, with Halton points in the pixel and a spiral over the light.

    >>> pass_sample(0, 1)
    Sample(shift=(0.0, 0.0), light=(0.0, 0.0), phase=0.0, threshold=0.5)
    """
    if count == 1:
        return Sample()
    radius, angle = math.sqrt((index + 0.5) / count), index * _GOLDEN
    return Sample(
        (_radical_inverse(index + 1, 2) - 0.5, _radical_inverse(index + 1, 3) - 0.5),
        (radius * math.cos(angle), radius * math.sin(angle)),
        index / count,
        (_radical_inverse(index, 2) + 0.5 / count) % 1.0,
    )


def _radical_inverse(number: int, base: int) -> float:
    """Return the radical inverse: a number's digits mirrored at the point (van der Corput 1935)."""
    found, scale = 0.0, 1.0
    while number:
        scale /= base
        number, digit = divmod(number, base)
        found += digit * scale
    return found


def jittered(view: View, shift: tuple[float, float], size: tuple[int, int]) -> View:
    """Return a view whose image is shifted by fractions of pixels."""
    if shift == (0.0, 0.0):
        return view
    moved = np.eye(4)
    moved[:2, 3] = 2.0 * shift[0] / size[0], 2.0 * shift[1] / size[1]
    return replace(view, projection=moved @ view.projection)


def tilted(direction: Floats, light: tuple[float, float]) -> Floats:
    """Return the unit vector towards a point of a light's disc: (3,)."""
    found = direction
    if light != (0.0, 0.0):
        right, above = light_axes(direction)
        found = direction + _LIGHT_RADIUS * (light[0] * right + light[1] * above)
    return np.asarray(found / np.linalg.norm(found))


def limit_passes(
    options: DisplayOptions, scene: Scene, size: tuple[int, int], context: moderngl.Context
) -> list[str]:
    """Lower the quality, in place, if it takes long in software or over 1 GB; return a message."""
    # The work is counted, not timed, so that an image does not depend on the machine or its load.
    if options.quality != "final":
        return []
    memory = _BYTES_PER_PIXEL * math.prod(size)
    if memory > _MOST_BYTES:
        options.quality = "normal"
        return [
            f"drawn with normal quality, as final needs {file_size(memory)} of graphics memory "
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
    """Return a message about the time of an image that takes long."""
    if seconds * count <= _PATIENCE:
        return []
    return [
        f"final quality takes about {seconds * count:.0f} s here: {count} passes of "
        f"{seconds:.1f} s; --quality normal draws one"
    ]
