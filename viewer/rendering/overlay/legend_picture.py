"""Legends as pixels, for images without a window; Pillow is imported on first use."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from viewer.phrases import printable
from viewer.rendering.overlay.legend import Legend
from viewer.rendering.overlay.legend_columns import legend_columns
from viewer.rendering.overlay.typeface import Typeface
from viewer.rig.arrays import Bytes

if TYPE_CHECKING:
    from PIL import ImageDraw

__all__ = ["legend_pixels"]

_SIZES = 9, 40  # minimum and maximum text height, pixels
_LETTERS_PER_HEIGHT, _LETTERS_PER_WIDTH = 40.0, 46.0
_SMALLER = 0.6  # factor to which the text height of many items may shrink
_MOST = 0.9  # maximum fraction of the image's width and height
# Fractions of the image's width for several columns. Figures are in the middle, so the text
# shrinks before the columns use more than the first fraction.
_WIDE, _WIDER = 0.3, 0.45
_LONGEST = 40  # maximum number of characters of a name
_BAR = 14.0  # width of the bar, in text heights
_LINE = (12, 12, 14)  # isolines, sRGB


class _Ink(NamedTuple):
    """Colours of the panel, of its text, and of less important text: sRGB and alpha."""

    panel: tuple[int, int, int, int]
    text: tuple[int, int, int]
    faint: tuple[int, int, int]


_ON_DARK = _Ink((20, 22, 26, 214), (240, 242, 245), (176, 182, 190))
_ON_LIGHT = _Ink((255, 255, 255, 214), (28, 30, 34), (92, 98, 106))


def legend_pixels(legend: Legend, size: tuple[int, int], is_light: bool = False) -> Bytes | None:
    """Return a legend's pixels, sized for an image.

    Many named items are set in several columns, then in smaller text, then in wider columns; items
    that still do not fit are counted.

    Parameters
    ----------
    legend : Legend
        The legend.
    size : (int, int)
        Width and height of the image that contains the legend, pixels.
    is_light : bool
        Whether the legend is dark text on a light panel, for light backgrounds.

    Returns
    -------
    (H, W, 4) uint8 or None
        sRGB with straight alpha, first row at the top; None if there is no room for it.
    """
    wanted = min(size[1] / _LETTERS_PER_HEIGHT, size[0] / _LETTERS_PER_WIDTH)
    letters = round(min(max(wanted, _SIZES[0]), _SIZES[1]))
    least = max(round(_SMALLER * letters), _SIZES[0])
    tries = [(height, _WIDE) for height in range(letters, least - 1, -1)] + [(least, _WIDER)]
    for height, fraction in tries:
        drawing = _Drawing(legend, height, size, fraction, _ON_LIGHT if is_light else _ON_DARK)
        if not drawing.columns.left_out:
            break
    return drawing.pixels()


class _Drawing:
    """Layout of a legend, from top to bottom: lines of text, then a bar or columns of swatches."""

    def __init__(
        self, legend: Legend, letters: int, size: tuple[int, int], fraction: float, ink: _Ink
    ) -> None:
        from PIL import Image, ImageDraw

        self.legend, self.letters, self.size, self.ink = legend, letters, size, ink
        self.font = Typeface(letters)
        self.gap = max(letters // 2, 3)
        self.line = round(1.35 * letters)
        self.new = Image.new
        self.draw_on = ImageDraw.Draw
        self.texts = [printable(entry.text, _LONGEST) for entry in legend.entries]
        self.bar_height = letters + self.gap + self.line if len(legend.colors) else 0
        rest = self.line * (2 if legend.note else 1) + self.bar_height + 2 * self.gap
        rows = max((int(_MOST * size[1]) - rest) // self.line, 1)
        widths = [self._width(text) + 2 * letters for text in self.texts]
        self.columns = legend_columns(widths, rows, fraction * size[0] - 2 * self.gap)

    def pixels(self) -> Bytes | None:
        """Return the pixels if they fit into nine tenths of the image."""
        legend, gap = self.legend, self.gap
        width = max(
            self._width(legend.heading),
            self._width(legend.note),
            round(_BAR * self.letters) + 2 * gap if self.bar_height else 0,
            self._columns_width(),
        )
        lines = 1 + self.columns.rows + (1 if legend.note else 0)
        height = lines * self.line + self.bar_height
        whole = width + 2 * gap, height + 2 * gap
        if whole[0] > _MOST * self.size[0] or whole[1] > _MOST * self.size[1]:
            return None
        image = self.new("RGBA", whole, self.ink.panel)
        draw = self.draw_on(image)
        y = gap
        self.font.draw(draw, (gap, y), legend.heading, self.ink.text)
        y += self.line
        if self.bar_height:
            self._draw_bar(draw, gap, y, width)
        y += self.bar_height
        self._draw_entries(draw, y)
        y += self.columns.rows * self.line
        if legend.note:
            self.font.draw(draw, (gap, y), legend.note, self.ink.faint)
        return np.array(image)

    def _columns_width(self) -> int:
        *others, last = self.columns.widths or (0.0,)
        more = self._width(self._more()) + 2 * self.letters if self.columns.left_out else 0
        return int(sum(others) + max(last, more))

    def _more(self) -> str:
        return f"and {self.columns.left_out} more"

    def _draw_entries(self, draw: ImageDraw.ImageDraw, top: int) -> None:
        """Draw the columns, and below the last one the number of omitted items."""
        left, first, y = float(self.gap), 0, top
        for count, width in zip(self.columns.counts, self.columns.widths, strict=True):
            y = top
            for row in range(first, first + count):
                self._draw_entry(draw, left, y, self.legend.entries[row].color, self.texts[row])
                y += self.line
            first, left = first + count, left + width
        if self.columns.left_out:
            self._draw_entry(draw, left - self.columns.widths[-1], y, None, self._more())

    def _draw_bar(self, draw: ImageDraw.ImageDraw, left: float, top: float, width: int) -> None:
        """Draw the colours, the isolines, and the numbers below, which stay within the panel."""
        colors, bottom = self.legend.colors, top + self.letters
        # Room for half a number on both sides.
        margin = max((self._width(tick.text) for tick in self.legend.ticks), default=0) // 2
        first, length = left + margin, width - 2 * margin
        for column in range(length):
            color = colors[column * len(colors) // length, :3]
            draw.line([(first + column, top), (first + column, bottom)], tuple(color.tolist()))
        for place in self.legend.lines:
            x = first + round(place * (length - 1))
            draw.line([(x, top), (x, bottom)], _LINE)
        for tick in self.legend.ticks:
            x = first + round(tick.place * (length - 1))
            draw.line([(x, bottom), (x, bottom + self.gap // 2)], self.ink.text)
            corner = (x - self._width(tick.text) / 2, bottom + self.gap // 2)
            self.font.draw(draw, corner, tick.text, self.ink.text)

    def _draw_entry(
        self,
        draw: ImageDraw.ImageDraw,
        left: float,
        top: float,
        color: tuple[int, int, int] | None,
        text: str,
    ) -> None:
        side = self.letters
        if color is not None:
            edge = top + 0.15 * side
            draw.rectangle([(left, edge), (left + side, edge + side)], color, self.ink.faint)
        self.font.draw(
            draw, (left + 1.6 * side, top), text, self.ink.text if color else self.ink.faint
        )

    def _width(self, text: str) -> int:
        return int(np.ceil(self.font.length(text)))
