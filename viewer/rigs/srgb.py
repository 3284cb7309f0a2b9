"""Conversion between linear light and sRGB (IEC 61966-2-1)."""

from __future__ import annotations

import numpy as np

from viewer.rigs.arrays import Floats

Color = tuple[float, float, float]


def encode_srgb(linear: Floats) -> Floats:
    """Return linear light as sRGB, clamped to 0..1."""
    linear = np.clip(linear, 0.0, 1.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def decode_srgb(colors: Floats) -> Floats:
    """Return sRGB, 0 to 1, as linear light."""
    return np.where(colors <= 0.04045, colors / 12.92, ((colors + 0.055) / 1.055) ** 2.4)


def encode_color(color: Color) -> Color:
    """Return a linear colour of the scene as sRGB, as in colour pickers."""
    r, g, b = encode_srgb(np.array(color)).tolist()
    return r, g, b


def decode_color(color: Color) -> Color:
    """Return an sRGB colour of a colour picker as a linear colour of the scene."""
    r, g, b = decode_srgb(np.array(color)).tolist()
    return r, g, b
