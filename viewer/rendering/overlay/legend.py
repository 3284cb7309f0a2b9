"""Legend of a scalar quantity: its content, its items in columns, and its pixels.

Content and columns are shared by images and panels; pixels are for images without a window.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from viewer.data_classes import dataclass
from viewer.phrases import printable
from viewer.rendering.colors import NOTHING
from viewer.rendering.overlay.typeface import Typeface
from viewer.rendering.scalar_look import TYPICAL, ScalarLook
from viewer.rigs.arrays import Bytes, Floats
from viewer.rigs.figure import Figure
from viewer.rigs.memo import Memo
from viewer.rigs.mesh import triangle_areas
from viewer.rigs.number_text import round_step, short_number
from viewer.rigs.scalars import (
    categories,
    find_quantity,
    menu_title,
    missing_part,
    quantity_title,
    shown_unit,
    split_name,
)
from viewer.rigs.skinning import Skinning

if TYPE_CHECKING:
    from PIL import ImageDraw

_MOST_TICKS = 6
_MOST_COUNTS = 10  # maximum number of labelled blocks of a bar
_SAME = 1e-9  # relative tolerance for equal numbers

# Pixels.
_TEXT_HEIGHTS = 9, 40  # minimum and maximum text height, pixels
_LETTERS_PER_HEIGHT, _LETTERS_PER_WIDTH = 40.0, 46.0
_SMALLER = 0.6  # factor to which the text height of many items may shrink
_MOST_OF_IMAGE = 0.9  # maximum fraction of the image's width and height
# Fractions of the image's width for several columns. Figures are in the middle, so the text
# shrinks before the columns use more than the first fraction.
_WIDE, _WIDER = 0.3, 0.45
_LONGEST = 40  # maximum number of characters of a name
_BAR_WIDTH = 14.0  # width of the bar, in text heights
_ISOLINE_COLOR = (12, 12, 14)  # isolines, sRGB
_areas: Memo[Figure, Floats] = Memo()


@dataclass(frozen=True, slots=True, eq=False)
class Legend:
    """The legend of a scalar quantity."""

    title: str
    unit: str = ""
    """Title and unit of the values; the unit may be empty."""
    colors: Bytes = field(default_factory=lambda: np.zeros((0, 4), dtype=np.uint8))
    """(N, 4) uint8. Colours of the bar from left to right, sRGB; empty for named items."""
    ticks: tuple[LegendTick, ...] = ()
    """Round numbers along the bar."""
    entries: tuple[LegendEntry, ...] = ()
    """Named items, largest area first."""
    lines: tuple[float, ...] = ()
    """Positions of isolines on the bar."""
    note: str = ""
    """Line below the bar: the range of the values, or the reason why there is nothing to show."""

    @property
    def heading(self) -> str:
        """Title and unit: ``"Distance LBS to DQS, mm"``."""
        return f"{self.title}, {self.unit}" if self.unit else self.title


@dataclass(frozen=True, slots=True)
class LegendTick:
    """A number next to the bar: position, from 0 at the left end to 1 at the right, and text."""

    place: float
    text: str


@dataclass(frozen=True, slots=True)
class LegendEntry:
    """A named item: colour, sRGB 0 to 255, and name."""

    color: tuple[int, int, int]
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class ColoredFigure:
    """A figure with the values of a scalar quantity and their colours."""

    figure: Figure
    """A figure with a mesh."""
    numbers: Floats
    """(V,). Result of ``viewer.rigs.scalars.compute``."""
    look: ScalarLook
    """Colours for this figure."""


def legend_of(
    name: str, having: Sequence[ColoredFigure], skinning: Skinning, figures: Sequence[Figure]
) -> Legend:
    """Return a scalar quantity's legend, with title and unit from the first figure that has it."""
    if not having:
        # The legend of a quantity that no drawn figure has, with the reason.
        missing = [missing_part(name, figure) for figure in figures]
        hidden = [figure for figure, lacks in zip(figures, missing, strict=True) if not lacks]
        if hidden:
            return Legend(
                quantity_title(name, hidden[0], skinning),
                note="not available for the visible figures",
            )
        if missing[0] == "a selected joint":
            return Legend(find_quantity(name).title, note="no joint is selected")
        return Legend(menu_title(split_name(name)[0], skinning), note=f"no figure has {missing[0]}")
    title = quantity_title(name, having[0].figure, skinning)
    kind = find_quantity(name).kind
    if kind == "categorical":
        return Legend(title, entries=_entries(name, having))
    if kind == "discrete":
        # The legend of a count: one block per number, starting at the lowest number present.
        first = min(int(one.numbers.min()) for one in having)
        colors = having[0].look.colors[first:]
        step = -(-len(colors) // _MOST_COUNTS)
        ticks = [
            LegendTick((block + 0.5) / len(colors), str(first + block))
            for block in range(len(colors))
            if (first + block) % step == 0 or len(colors) == 1
        ]
        return Legend(title, "", colors, tuple(ticks))
    factor, unit = shown_unit(name, having[0].figure)
    look = having[0].look
    low = factor * min(float(one.numbers.min()) for one in having)
    high = factor * max(float(one.numbers.max()) for one in having)
    is_signed = find_quantity(name).kind == "diverging"
    ends = factor * look.ends[0], factor * look.ends[1]
    is_flat = low == high == 0.0
    span = f"from {_text(low, is_signed)} to {_text(high, is_signed)}"
    if look.is_typical and max(-low, high) > (1.0 + _SAME) * ends[1]:
        span = f"{100 * TYPICAL:.0f} %: up to ±{_text(ends[1])}; {span}"
    return Legend(
        title,
        unit,
        look.colors,
        () if is_flat else round_ticks(*ends, is_signed),
        (LegendEntry(NOTHING, "no weight"),) if look.dark_zero else (),
        tuple(tenth / 10.0 for tenth in range(1, 10)) if look.isolines else (),
        "0 everywhere" if is_flat else span,
    )


def _entries(name: str, shown: Sequence[ColoredFigure]) -> tuple[LegendEntry, ...]:
    """Return the visible items, largest area first; equal items of several figures are merged."""
    areas: dict[LegendEntry, float] = {}
    for one in shown:
        names = categories(name, one.figure)
        indices = one.numbers.astype(int)
        found = np.bincount(indices + 1, _vertex_areas(one.figure), len(names) + 1)
        for index in np.unique(indices).tolist():
            color = NOTHING if index < 0 else tuple(one.look.colors[index, :3].tolist())
            entry = LegendEntry(color, "no influence" if index < 0 else names[index])
            areas[entry] = areas.get(entry, 0.0) + float(found[index + 1])
    return tuple(sorted(areas, key=lambda entry: -areas[entry]))


def _vertex_areas(figure: Figure) -> Floats:
    """Return the barycentric area of each vertex at rest, a third of its triangles' area: (V,)."""
    mesh = figure.require_mesh()

    def make() -> Floats:
        thirds = np.repeat(triangle_areas(mesh.positions, mesh.triangles) / 3.0, 3)
        found = np.bincount(mesh.triangles.ravel(), thirds, mesh.n_vertices)
        return found.astype(np.float64, copy=False)

    return _areas.get(figure, (), make)


def round_ticks(low: float, high: float, signed: bool = False) -> tuple[LegendTick, ...]:
    """Return at most six round numbers within a range: multiples of 1, 2 or 5 times 10 to the n.

    >>> [tick.text for tick in round_ticks(0.0, 12.3)]
    ['0', '5', '10']
    """
    step = round_step((high - low) / (_MOST_TICKS - 1))
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    numbers = range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)
    ticks = []
    for number in numbers:
        value = number * step
        is_plain = digits <= 4 and abs(value) < 1e6
        text = f"{value:+.{digits}f}" if is_plain else f"{value:+.3g}"
        text = text if (signed and number) or number < 0 else text[1:]
        ticks.append(LegendTick((value - low) / (high - low), text if number else "0"))
    return tuple(ticks)


def _text(number: float, signed: bool = False) -> str:
    """Return a number with three significant digits."""
    text = short_number(number)
    return f"+{text}" if signed and number > 0.0 else text


@dataclass(frozen=True, slots=True)
class LegendColumns:
    """The items of each column."""

    counts: tuple[int, ...]
    """Number of items per column, from left to right; the items fill the columns in order."""
    widths: tuple[float, ...]
    """Width of each column."""
    left_out: int = 0
    """Number of omitted items, which a line "and N more" below the last column mentions."""

    @property
    def rows(self) -> int:
        """Number of lines of the longest column, including the line about omitted items."""
        last = self.counts[-1] + (self.left_out > 0) if self.counts else 0
        return max((*self.counts, last), default=0)


def legend_columns(widths: Sequence[float], rows: int, width: float) -> LegendColumns:
    """Split items into as few columns as possible; omitted items are counted.

    ``widths``: width of each item's swatch and name, with the gap to the next column, in the unit
    of ``width``, the maximum of all columns. The first column is used even if it is wider. The
    columns are of about equal length if all items fit, otherwise full columns.

    >>> legend_columns([10.0] * 5, 4, 30.0).counts
    (3, 2)
    >>> legend_columns([10.0] * 5, 2, 20.0)
    LegendColumns(counts=(2, 1), widths=(10.0, 10.0), left_out=2)
    """
    if not widths:
        return LegendColumns((), ())
    n_columns = -(-len(widths) // rows)
    evenly = _split_items(widths, -(-len(widths) // n_columns))
    if n_columns == 1 or sum(evenly.widths) <= width:
        return evenly
    full = _split_items(widths, rows)
    if sum(full.widths) <= width:
        return full
    kept = 1
    while sum(full.widths[: kept + 1]) <= width:
        kept += 1
    counts = (*full.counts[: kept - 1], full.counts[kept - 1] - 1)
    return LegendColumns(counts, full.widths[:kept], len(widths) - sum(counts))


def _split_items(widths: Sequence[float], rows: int) -> LegendColumns:
    parts = [widths[first : first + rows] for first in range(0, len(widths), rows)]
    return LegendColumns(tuple(map(len, parts)), tuple(max(part) for part in parts))


class _Ink(NamedTuple):
    """Colours of the panel, of its text, and of less important text: sRGB and alpha."""

    panel: tuple[int, int, int, int]
    text: tuple[int, int, int]
    faint: tuple[int, int, int]


_ON_DARK = _Ink((20, 22, 26, 214), (240, 242, 245), (176, 182, 190))
_ON_LIGHT = _Ink((255, 255, 255, 214), (28, 30, 34), (92, 98, 106))


def legend_pixels(legend: Legend, size: tuple[int, int], is_light: bool = False) -> Bytes | None:
    """Return a legend's (H, W, 4) uint8 pixels, straight alpha, for an image; None without room."""
    # Many named items are set in several columns, then in smaller text, then in wider columns;
    # items that still do not fit are counted.
    wanted = min(size[1] / _LETTERS_PER_HEIGHT, size[0] / _LETTERS_PER_WIDTH)
    letters = round(min(max(wanted, _TEXT_HEIGHTS[0]), _TEXT_HEIGHTS[1]))
    least = max(round(_SMALLER * letters), _TEXT_HEIGHTS[0])
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
        rows = max((int(_MOST_OF_IMAGE * size[1]) - rest) // self.line, 1)
        widths = [self._width(text) + 2 * letters for text in self.texts]
        self.columns = legend_columns(widths, rows, fraction * size[0] - 2 * self.gap)

    def pixels(self) -> Bytes | None:
        """Return the pixels if they fit into nine tenths of the image."""
        legend, gap = self.legend, self.gap
        width = max(
            self._width(legend.heading),
            self._width(legend.note),
            round(_BAR_WIDTH * self.letters) + 2 * gap if self.bar_height else 0,
            self._columns_width(),
        )
        lines = 1 + self.columns.rows + (1 if legend.note else 0)
        height = lines * self.line + self.bar_height
        whole = width + 2 * gap, height + 2 * gap
        if whole[0] > _MOST_OF_IMAGE * self.size[0] or whole[1] > _MOST_OF_IMAGE * self.size[1]:
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
            draw.line([(x, top), (x, bottom)], _ISOLINE_COLOR)
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
