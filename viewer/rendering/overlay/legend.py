"""Legend of a scalar quantity, as data shared by images and panels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field

import numpy as np

from viewer.data_classes import dataclass
from viewer.rendering.colors import NOTHING
from viewer.rendering.scalar_look import TYPICAL, ScalarLook
from viewer.rig.arrays import Bytes, Floats
from viewer.rig.figure import Figure
from viewer.rig.memo import Memo
from viewer.rig.mesh import triangle_areas
from viewer.rig.number_text import short_number
from viewer.rig.scalars import (
    categories,
    find_quantity,
    menu_title,
    missing_part,
    quantity_title,
    shown_unit,
    split_name,
)
from viewer.rig.skinning import Skinning

__all__ = ["Entry", "Legend", "Shown", "Tick", "legend_of", "round_ticks"]

_MOST_TICKS = 6
_MOST_COUNTS = 10  # maximum number of labelled blocks of a bar
_SAME = 1e-9  # relative tolerance for equal numbers


@dataclass(frozen=True, slots=True)
class Tick:
    """A number next to the bar: position, from 0 at the left end to 1 at the right, and text."""

    place: float
    text: str


@dataclass(frozen=True, slots=True)
class Entry:
    """A named item: colour, sRGB 0 to 255, and name."""

    color: tuple[int, int, int]
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class Legend:
    """The legend of a scalar quantity.

    Attributes
    ----------
    title, unit : str
        Title and unit of the values; the unit may be empty.
    colors : (N, 4) uint8
        Colours of the bar from left to right, sRGB; empty for named items.
    ticks : tuple of Tick
        Round numbers along the bar.
    entries : tuple of Entry
        Named items, largest area first.
    lines : tuple of float
        Positions of isolines on the bar.
    note : str
        Line below the bar: the range of the values, or the reason why there is nothing to show.
    """

    title: str
    unit: str = ""
    colors: Bytes = field(default_factory=lambda: np.zeros((0, 4), dtype=np.uint8))
    ticks: tuple[Tick, ...] = ()
    entries: tuple[Entry, ...] = ()
    lines: tuple[float, ...] = ()
    note: str = ""

    @property
    def heading(self) -> str:
        """Title and unit: ``"Distance LBS to DQS, mm"``."""
        return f"{self.title}, {self.unit}" if self.unit else self.title


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """A figure with the values of a scalar quantity and their colours.

    Attributes
    ----------
    figure : Figure
        A figure with a mesh.
    numbers : (V,)
        Result of ``viewer.rig.scalars.compute``.
    look : ScalarLook
        Colours for this figure.
    """

    figure: Figure
    numbers: Floats
    look: ScalarLook


def legend_of(
    name: str, having: Sequence[Shown], skinning: Skinning, figures: Sequence[Figure]
) -> Legend:
    """Return the legend of a scalar quantity.

    Parameters
    ----------
    name : str
        Name of the quantity.
    having : sequence of Shown
        The drawn figures that have the quantity; the first figure provides title and unit.
    skinning : Skinning
        Skinning of the figures.
    figures : sequence of Figure
        All figures of the scene, including those not drawn; at least one.
    """
    if not having:
        return _empty(name, skinning, figures)
    title = quantity_title(name, having[0].figure, skinning)
    kind = find_quantity(name).kind
    if kind == "categorical":
        return Legend(title, entries=_entries(name, having))
    if kind == "discrete":
        return _counts(title, having)
    return _bar(name, title, having)


def _empty(name: str, skinning: Skinning, figures: Sequence[Figure]) -> Legend:
    """Return the legend of a quantity that no drawn figure has, with the reason."""
    missing = [missing_part(name, figure) for figure in figures]
    hidden = [figure for figure, lacks in zip(figures, missing, strict=True) if not lacks]
    if hidden:
        return Legend(
            quantity_title(name, hidden[0], skinning), note="not available for the visible figures"
        )
    if missing[0] == "a selected joint":
        return Legend(find_quantity(name).title, note="no joint is selected")
    return Legend(menu_title(split_name(name)[0], skinning), note=f"no figure has {missing[0]}")


def round_ticks(low: float, high: float, signed: bool = False) -> tuple[Tick, ...]:
    """Return at most six round numbers within a range: multiples of 1, 2 or 5 times 10 to the n.

    Parameters
    ----------
    low, high : float
        Ends of the range, low < high.
    signed : bool
        Whether numbers above 0 have a plus sign.

    >>> [tick.text for tick in round_ticks(0.0, 12.3)]
    ['0', '5', '10']
    """
    least = (high - low) / (_MOST_TICKS - 1)
    power = 10.0 ** math.floor(math.log10(least))
    step = power * next(factor for factor in (1, 2, 5, 10) if factor * power >= 0.999 * least)
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    numbers = range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)
    ticks = []
    for number in numbers:
        value = number * step
        is_plain = digits <= 4 and abs(value) < 1e6
        text = f"{value:+.{digits}f}" if is_plain else f"{value:+.3g}"
        text = text if (signed and number) or number < 0 else text[1:]
        ticks.append(Tick((value - low) / (high - low), text if number else "0"))
    return tuple(ticks)


def _bar(name: str, title: str, shown: Sequence[Shown]) -> Legend:
    factor, unit = shown_unit(name, shown[0].figure)
    look = shown[0].look
    low = factor * min(float(one.numbers.min()) for one in shown)
    high = factor * max(float(one.numbers.max()) for one in shown)
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
        (Entry(NOTHING, "no weight"),) if look.dark_zero else (),
        tuple(tenth / 10.0 for tenth in range(1, 10)) if look.isolines else (),
        "0 everywhere" if is_flat else span,
    )


def _counts(title: str, shown: Sequence[Shown]) -> Legend:
    """Return the legend of a count: one block per number, starting at the lowest number present."""
    first = min(int(one.numbers.min()) for one in shown)
    colors = shown[0].look.colors[first:]
    step = -(-len(colors) // _MOST_COUNTS)
    ticks = [
        Tick((block + 0.5) / len(colors), str(first + block))
        for block in range(len(colors))
        if (first + block) % step == 0 or len(colors) == 1
    ]
    return Legend(title, "", colors, tuple(ticks))


def _entries(name: str, shown: Sequence[Shown]) -> tuple[Entry, ...]:
    """Return the visible items, largest area first; equal items of several figures are merged."""
    areas: dict[Entry, float] = {}
    for one in shown:
        names = categories(name, one.figure)
        indices = one.numbers.astype(int)
        found = np.bincount(indices + 1, _vertex_areas(one.figure), len(names) + 1)
        for index in np.unique(indices).tolist():
            color = NOTHING if index < 0 else tuple(one.look.colors[index, :3].tolist())
            entry = Entry(color, "no influence" if index < 0 else names[index])
            areas[entry] = areas.get(entry, 0.0) + float(found[index + 1])
    return tuple(sorted(areas, key=lambda entry: -areas[entry]))


_areas: Memo[Figure, Floats] = Memo()


def _vertex_areas(figure: Figure) -> Floats:
    """Return the barycentric area of each vertex at rest, a third of its triangles' area: (V,)."""
    mesh = figure.require_mesh()

    def make() -> Floats:
        thirds = np.repeat(triangle_areas(mesh.positions, mesh.triangles) / 3.0, 3)
        found = np.bincount(mesh.triangles.ravel(), thirds, mesh.n_vertices)
        return found.astype(np.float64, copy=False)

    return _areas.get(figure, (), make)


def _text(number: float, signed: bool = False) -> str:
    """Return a number with three significant digits."""
    text = short_number(number)
    return f"+{text}" if signed and number > 0.0 else text
