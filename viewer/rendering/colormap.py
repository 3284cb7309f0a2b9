"""The colour map of scalar views: dark to bright, evenly as the eye sees it."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Bytes, Floats

__all__ = ["color_at", "colormap"]

# Anchors in OKLab (Ottosson 2020): lightness rises evenly from violet over red to yellow, so
# the map reads in grey and to colour-blind eyes, like matplotlib's "inferno".
_ANCHORS = np.array(
    [
        [0.24, 0.020, -0.075],
        [0.42, 0.100, -0.115],
        [0.60, 0.165, 0.020],
        [0.78, 0.085, 0.130],
        [0.96, -0.020, 0.130],
    ]
)
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
    places = np.linspace(0.0, len(_ANCHORS) - 1.0, count)
    channels = [np.interp(places, np.arange(len(_ANCHORS)), column) for column in _ANCHORS.T]
    rgb = _to_srgb(np.stack(channels, axis=1))
    pixels = np.full((count, 4), 255, dtype=np.uint8)
    pixels[:, :3] = np.round(255.0 * rgb)
    return pixels


def color_at(share: float) -> tuple[float, float, float]:
    """Return the sRGB colour, 0 to 1, at a place between lowest (0) and highest (1)."""
    pixels = colormap()
    index = round(min(max(share, 0.0), 1.0) * (len(pixels) - 1))
    r, g, b = (float(channel) / 255.0 for channel in pixels[index, :3])
    return r, g, b


def _to_srgb(lab: Floats) -> Floats:
    linear = np.clip((lab @ _FROM_OKLAB.T) ** 3 @ _TO_LINEAR_RGB.T, 0.0, 1.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
