"""Rasterised text, packed into one texture; Pillow is imported on first use."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from viewer.rendering.overlay.typeface import Typeface
from viewer.rig.arrays import Bytes, Ints

__all__ = ["Lettering", "shelves"]

_RIM = 2  # width of the outline, pixels
_WIDEST = 2048  # maximum width of a string, pixels; longer strings are truncated
_MOST = 4000  # maximum number of cached strings
_DARK = 205  # opacity of the outline, 0 to 255


class Lettering:
    """Rasteriser of text in one font size.

    Parameters
    ----------
    letters : int
        Height of the text, pixels.
    """

    def __init__(self, letters: int) -> None:
        self.letters = letters
        self._font = Typeface(letters)
        self._widths: dict[str, int] = {}
        self._pixels: dict[str, Bytes] = {}

    def sizes(self, texts: Sequence[str]) -> Ints:
        """Return the width and height of texts with their outlines: (N, 2), pixels."""
        if len(self._widths) > _MOST:
            self._widths.clear()
        for text in texts:
            if text not in self._widths:
                self._widths[text] = int(np.ceil(self._font.length(text))) + 2 * _RIM
        widths = [min(self._widths[text], _WIDEST) for text in texts]
        heights = [self._height] * len(texts)
        return np.array([widths, heights], dtype=np.int32).reshape(2, -1).T

    @property
    def _height(self) -> int:
        return round(1.25 * self.letters) + 2 * _RIM

    def pixels(self, text: str) -> Bytes:
        """Return white text with a dark outline: (H, W, 2) uint8, premultiplied grey and alpha."""
        from PIL import Image, ImageDraw

        if text not in self._pixels:
            if len(self._pixels) > _MOST:
                self._pixels.clear()
            width, height = self.sizes([text])[0].tolist()
            rim, inside = Image.new("L", (width, height)), Image.new("L", (width, height))
            place = _RIM, _RIM
            self._font.draw(ImageDraw.Draw(rim), place, text, _DARK, _RIM)
            self._font.draw(ImageDraw.Draw(inside), place, text, 255)
            white = np.array(inside)
            self._pixels[text] = np.dstack([white, np.maximum(white, np.array(rim))])
        return self._pixels[text]


def shelves(sizes: Ints, width: int, tallest: int) -> Ints:
    """Return positions of rectangles of equal height, packed in rows: (M, 2), M <= N.

    Parameters
    ----------
    sizes : (N, 2)
        Widths, at most ``width``, and heights, pixels.
    width, tallest : int
        Size of the image; rectangles that do not fit are omitted.
    """
    corners: list[tuple[int, int]] = []
    x = y = 0
    for across, down in sizes.tolist():
        if x + across > width:
            x, y = 0, y + down
        if y + down > tallest:
            break
        corners.append((x, y))
        x += across
    return np.array(corners, dtype=np.int32).reshape(-1, 2)
