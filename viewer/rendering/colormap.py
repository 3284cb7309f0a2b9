"""Colour maps of scalar quantities: two of our own, and those that other programs name."""

from __future__ import annotations

from functools import cache

import numpy as np

from viewer.resources import resource
from viewer.rig.arrays import Bytes, Floats
from viewer.rig.srgb import encode_srgb

__all__ = ["colormap", "diverging_map", "named_map", "oklab"]

# Our own maps are perceptually uniform and colour-blind safe. The anchors are in OKLab (Ottosson
# 2020): lightness rises linearly from violet through red to yellow, so the map works in greyscale
# and for colour-blind people, like matplotlib's "inferno".
_ANCHORS = np.array(
    [
        [0.24, 0.020, -0.075],
        [0.42, 0.100, -0.115],
        [0.60, 0.165, 0.020],
        [0.78, 0.085, 0.130],
        [0.96, -0.020, 0.130],
    ]
)
# From blue through white to red: lightness falls symmetrically towards both ends, and the two hues
# remain distinguishable with red-green colour blindness.
_DIVERGING = np.array(
    [
        [0.36, -0.020, -0.130],
        [0.60, -0.035, -0.115],
        [0.97, 0.000, 0.000],
        [0.60, 0.140, 0.080],
        [0.36, 0.120, 0.070],
    ]
)
_DIVERGING_PLACES = np.array([0.0, 0.2, 0.5, 0.8, 1.0])
_FROM_OKLAB = np.array(
    [
        [1.0, 0.3963377774, 0.2158037573],
        [1.0, -0.1055613458, -0.0638541728],
        [1.0, -0.0894841775, -1.2914855480],
    ]
)
_TO_LINEAR_RGB = np.array(
    [
        [4.0767416621, -3.3077115913, 0.2309699292],
        [-1.2684380046, 2.6097574011, -0.3413193965],
        [-0.0041960863, -0.7034186147, 1.7076147010],
    ]
)


def colormap(count: int = 256) -> Bytes:
    """Return the map as pixels: (count, 4) sRGB with alpha, from lowest to highest.

    >>> colormap(2).shape
    (2, 4)
    """
    return _pixels(_ANCHORS, np.linspace(0.0, 1.0, len(_ANCHORS)), count)


def diverging_map(count: int = 256) -> Bytes:
    """Return the diverging map as pixels: (count, 4) sRGB with alpha, white in the middle.

    >>> diverging_map(3)[1].tolist()
    [245, 245, 245, 255]
    """
    return _pixels(_DIVERGING, _DIVERGING_PLACES, count)


@cache
def named_map(name: str) -> Bytes:
    """Return a map of ``assets/colormaps.txt`` as pixels: (256, 4) sRGB with alpha.

    >>> named_map("viridis")[[0, -1]].tolist()
    [[68, 1, 84, 255], [253, 231, 37, 255]]
    """
    lines = resource("assets", "colormaps.txt").read_text("ascii").splitlines()
    first = lines.index(name) + 1
    pixels = np.full((256, 4), 255, dtype=np.uint8)
    digits = bytes.fromhex("".join(lines[first : first + 16]))
    pixels[:, :3] = np.frombuffer(digits, dtype=np.uint8).reshape(256, 3)
    pixels.flags.writeable = False
    return pixels


def _pixels(anchors: Floats, places: Floats, count: int) -> Bytes:
    """Return ``count`` colours interpolated between anchors in OKLab."""
    wanted = np.linspace(0.0, 1.0, count)
    lab = np.stack([np.interp(wanted, places, column) for column in anchors.T], axis=1)
    pixels = np.full((count, 4), 255, dtype=np.uint8)
    pixels[:, :3] = np.round(255.0 * encode_srgb((lab @ _FROM_OKLAB.T) ** 3 @ _TO_LINEAR_RGB.T))
    return pixels


def oklab(colors: Floats) -> Floats:
    """Return linear colours, (..., 3), in OKLab, where distances are perceptually uniform."""
    cones = np.cbrt(np.maximum(colors @ np.linalg.inv(_TO_LINEAR_RGB).T, 0.0))
    return cones @ np.linalg.inv(_FROM_OKLAB).T
