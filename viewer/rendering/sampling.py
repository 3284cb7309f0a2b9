"""Passes of an image, whose results are averaged, and the small offsets between them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.rendering.options import DisplayOptions
from viewer.rendering.view import View
from viewer.rig.arrays import Floats

__all__ = ["Sample", "jittered", "n_passes", "sample", "tilted"]

_LIGHT_RADIUS = math.tan(math.radians(1.7))  # radius of the key light's disc, at distance 1
_GOLDEN = math.pi * (3.0 - math.sqrt(5.0))


@dataclass(frozen=True, slots=True)
class Sample:
    """One pass of an image.

    Attributes
    ----------
    shift : (float, float)
        Shift of the image, pixels: -0.5 to 0.5.
    light : (float, float)
        A point on the key light's disc, which has radius 1.
    phase : float
        Phase of the pattern of directions in which occluders are searched for, 0 to 1.
    threshold : float
        Opacity above which actors cast shadows, 0 to 1.
    """

    shift: tuple[float, float] = (0.0, 0.0)
    light: tuple[float, float] = (0.0, 0.0)
    phase: float = 0.0
    threshold: float = 0.5


def n_passes(options: DisplayOptions) -> int:
    """Return the number of passes that are averaged in an image."""
    return max(options.passes, 1) if options.quality == "final" else 1


def sample(index: int, count: int) -> Sample:
    """Return one of ``count`` passes, with Halton points in the pixel and a spiral over the light.

    >>> sample(0, 1)
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


def jittered(view: View, shift: tuple[float, float], size: tuple[int, int]) -> View:
    """Return a view whose image is shifted by fractions of pixels."""
    moved = np.eye(4)
    moved[:2, 3] = 2.0 * shift[0] / size[0], 2.0 * shift[1] / size[1]
    return replace(view, projection=moved @ view.projection)


def tilted(direction: Floats, light: tuple[float, float]) -> Floats:
    """Return the unit vector towards a point of a light's disc: (3,)."""
    aside = np.eye(3)[np.argmin(np.abs(direction))]
    right = np.cross(aside, direction)
    right /= np.linalg.norm(right)
    above = np.cross(direction, right)
    found = direction + _LIGHT_RADIUS * (light[0] * right + light[1] * above)
    return np.asarray(found / np.linalg.norm(found))


def _radical_inverse(number: int, base: int) -> float:
    """Return the radical inverse: a number's digits mirrored at the point (van der Corput 1935)."""
    found, scale = 0.0, 1.0
    while number:
        scale /= base
        number, digit = divmod(number, base)
        found += digit * scale
    return found
