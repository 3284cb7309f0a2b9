"""A legend as pixels, for pictures without a window; Pillow is imported when one is drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from viewer.errors import printable
from viewer.rendering.legend import Legend
from viewer.rig.arrays import Bytes

if TYPE_CHECKING:
    from PIL import ImageDraw, ImageFont

    Font = ImageFont.ImageFont | ImageFont.FreeTypeFont

__all__ = ["legend_pixels"]

_SIZES = 9, 40  # height of letters, pixels: smallest and largest
_LETTERS_PER_HEIGHT, _LETTERS_PER_WIDTH = 40.0, 56.0
_MOST_ENTRIES = 14
_LONGEST = 40  # letters of a name
_BAR = 14.0  # width, in heights of letters
_PANEL, _TEXT, _FAINT, _LINE = (20, 22, 26, 214), (240, 242, 245), (176, 182, 190), (12, 12, 14)


def legend_pixels(legend: Legend, size: tuple[int, int]) -> Bytes | None:
    """Return a legend's picture, as large as suits a picture of some size.

    Parameters
    ----------
    legend : Legend
        What the colours stand for.
    size : (int, int)
        Width and height of the picture that it goes into, pixels.

    Returns
    -------
    (H, W, 4) uint8 or None
        sRGB, not multiplied by alpha, first row at the top; None if there is no room for it.
    """
    wanted = min(size[1] / _LETTERS_PER_HEIGHT, size[0] / _LETTERS_PER_WIDTH)
    letters = round(min(max(wanted, _SIZES[0]), _SIZES[1]))
    return _Drawing(legend, letters).pixels(size)


class _Drawing:
    """Lays a legend out: lines of text, a bar or swatches, from the top down."""

    def __init__(self, legend: Legend, letters: int) -> None:
        from PIL import Image, ImageDraw, ImageFont

        self.legend, self.letters = legend, letters
        self.font: Font = ImageFont.load_default(letters)
        self.gap = max(letters // 2, 3)
        self.line = round(1.35 * letters)
        self.new = Image.new
        self.draw_on = ImageDraw.Draw
        self._ruler = ImageDraw.Draw(Image.new("L", (1, 1)))

    def pixels(self, size: tuple[int, int]) -> Bytes | None:
        """Return the picture if it fits into nine tenths of another one."""
        legend, gap = self.legend, self.gap
        room = int(0.9 * size[1]) - 3 * self.line - 2 * gap
        entries = self._entries(max(room // self.line, 1))
        has_bar = len(legend.colors) > 0
        texts = [text for _, text in entries]
        widest = max((self._width(text) for text in texts), default=0)
        width = max(
            self._width(legend.heading),
            self._width(legend.note),
            round(_BAR * self.letters) + 2 * gap if has_bar else 0,
            widest + 2 * self.letters,
        )
        height = self.line + (self.letters + gap + self.line if has_bar else 0)
        height += len(entries) * self.line + (self.line if legend.note else 0)
        whole = width + 2 * gap, height + 2 * gap
        if whole[0] > 0.9 * size[0] or whole[1] > 0.9 * size[1]:
            return None
        image = self.new("RGBA", whole, _PANEL)
        draw = self.draw_on(image)
        y = float(gap)
        draw.text((gap, y), legend.heading, _TEXT, self.font)
        y += self.line
        if has_bar:
            self._draw_bar(draw, gap, y, width)
            y += self.letters + gap + self.line
        for color, text in entries:
            self._draw_entry(draw, y, color, text)
            y += self.line
        if legend.note:
            draw.text((gap, y), legend.note, _FAINT, self.font)
        return np.array(image)

    def _entries(self, room: int) -> list[tuple[tuple[int, int, int] | None, str]]:
        """Return colours and texts; what is too much becomes a line that says how many."""
        entries = self.legend.entries
        most = min(_MOST_ENTRIES, room)
        kept = entries if len(entries) <= most else entries[: max(most - 1, 0)]
        shown: list[tuple[tuple[int, int, int] | None, str]] = [
            (entry.color, printable(entry.text, _LONGEST)) for entry in kept
        ]
        if len(kept) < len(entries):
            shown.append((None, f"and {len(entries) - len(kept)} more"))
        return shown

    def _draw_bar(self, draw: ImageDraw.ImageDraw, left: float, top: float, width: int) -> None:
        """Draw the colours, the isolines, and the numbers beneath, which stay within the panel."""
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
            draw.line([(x, bottom), (x, bottom + self.gap // 2)], _TEXT)
            corner = (x - self._width(tick.text) / 2, bottom + self.gap // 2)
            draw.text(corner, tick.text, _TEXT, self.font)

    def _draw_entry(
        self,
        draw: ImageDraw.ImageDraw,
        top: float,
        color: tuple[int, int, int] | None,
        text: str,
    ) -> None:
        side = self.letters
        if color is not None:
            edge = top + 0.15 * side
            draw.rectangle([(self.gap, edge), (self.gap + side, edge + side)], color, _FAINT)
        draw.text((self.gap + 1.6 * side, top), text, _TEXT if color else _FAINT, self.font)

    def _width(self, text: str) -> int:
        return int(np.ceil(self._ruler.textlength(text, self.font)))
