"""Draws integers into images without a font, with digits of 5 x 7 dots."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Bools, Bytes

__all__ = ["digits", "write_number"]

_ROWS = (
    " ###    #    ###  ##### #   # #####  ###  #####  ###   ### ",
    "#   #  ##   #   #     # #   # #     #   #     # #   # #   #",
    "#   #   #       #    #  #   # #     #        #  #   # #   #",
    "#   #   #      #    ##  ##### ####  ####    #    ###   ####",
    "#   #   #     #       #     #     # #   #   #   #   #     #",
    "#   #   #    #    #   #     # #   # #   #   #   #   # #   #",
    " ###   ###  #####  ###      #  ###   ###    #    ###   ### ",
)
_WIDTH, _HEIGHT, _STEP = 5, 7, 6
_INK, _PAPER = (255, 255, 255, 255), (0, 0, 0, 255)
_PAPER_OPACITY = 0.55  # opacity of the dark background behind a number


def digits(number: int) -> Bools:
    """Return the dots of a non-negative integer: (7, 6 n - 1), True for ink.

    >>> digits(17).shape
    (7, 11)
    """
    glyphs = []
    for digit in map(int, str(number)):
        start = digit * _STEP
        glyph = [[dot == "#" for dot in row[start : start + _WIDTH].ljust(_WIDTH)] for row in _ROWS]
        glyphs.append(np.pad(np.array(glyph), ((0, 0), (0, _STEP - _WIDTH))))
    return np.concatenate(glyphs, axis=1)[:, :-1]


def write_number(pixels: Bytes, number: int) -> None:
    """Draw a number into the lower left corner of an image, on a translucent dark background.

    Parameters
    ----------
    pixels : (H, W, 4) uint8
        Modified in place; unchanged if the number does not fit.
    number : int
        0 or more.
    """
    height, width = pixels.shape[:2]
    dots = np.pad(digits(number), 2)  # margin of the background, in dots
    scale = max(round(height / 100), 1)
    ink = np.kron(dots, np.ones((scale, scale), dtype=np.bool_)).astype(np.bool_)
    if ink.shape[0] > height or ink.shape[1] > width:
        return
    corner = pixels[height - ink.shape[0] :, : ink.shape[1]]
    # Over a transparent image the opacity of the background becomes its alpha.
    under = corner.astype(np.float64)
    opacity = _PAPER_OPACITY
    under[..., :3] *= under[..., 3:] / 255.0
    alpha = 255.0 * opacity + (1.0 - opacity) * under[..., 3]
    color = (1.0 - opacity) * under[..., :3] * 255.0 / alpha[..., None]
    corner[..., :3], corner[..., 3] = np.rint(color), np.rint(alpha)
    corner[ink] = _INK
