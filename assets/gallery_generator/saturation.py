"""Fraction of overexposed and black areas in images."""

from __future__ import annotations

import numpy as np

from viewer.rigs.arrays import Bytes

__all__ = ["MOST", "saturated_fraction"]

MOST = 1e-3
"""Largest permitted fraction of saturated pixels."""

_BLACK = 2  # largest value of a black channel, out of 255


def saturated_fraction(
    pixels: Bytes, background: tuple[int, int, int] | None = None, has_data: bool = False
) -> float:
    """Return the fraction of pixels with an overexposed channel or with all channels black.

    Parameters
    ----------
    pixels : (H, W, 4) uint8
        sRGB.
    background : (int, int, int), optional
        Exact colour of pixels that are ignored.
    has_data : bool
        Whether colours show numbers: the last colour of the colour map has one full channel, so
        only two channels are tested.
    """
    white = (pixels[..., :3] == 255).all(axis=2)
    # Gutters of contact sheets are white from side to side.
    kept = pixels[~white.all(axis=1)][:, ~white.all(axis=0)]
    colors = kept[..., :3].reshape(-1, 3)
    if background is not None:
        colors = colors[(colors != np.array(background)).any(axis=1)]
    full = (colors == 255).sum(axis=1) > has_data
    burnt = full | (colors <= _BLACK).all(axis=1)
    return float(burnt.mean()) if len(burnt) else 0.0
