"""Colours as the interface shows and takes them, sRGB, and as scenes hold them, linear."""

from __future__ import annotations

from viewer.rendering.options import Color

__all__ = ["decode_srgb", "encode_srgb"]


def encode_srgb(color: Color) -> Color:
    """Return linear light as sRGB (IEC 61966-2-1): screens and colour pickers show that.

    >>> [round(part, 3) for part in encode_srgb((0.0, 0.001, 0.214))]
    [0.0, 0.013, 0.5]
    """
    r, g, b = (12.92 * c if c <= 0.0031308 else 1.055 * c ** (1 / 2.4) - 0.055 for c in color)
    return r, g, b


def decode_srgb(color: Color) -> Color:
    """Return sRGB as linear light."""
    r, g, b = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in color)
    return r, g, b
