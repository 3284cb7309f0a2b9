"""Mapping from the numbers of a scalar quantity to colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from viewer.rendering.colormap import colormap, diverging_map
from viewer.rendering.options import DisplayOptions
from viewer.rendering.palettes import NOTHING, count_palette, joint_palette, part_palette
from viewer.rendering.srgb import decode_srgb
from viewer.rig.arrays import Bytes, Floats
from viewer.rig.figure import Figure
from viewer.rig.scalars import categories, find_quantity, shown_unit, split_name

__all__ = ["TYPICAL", "ScalarLook", "is_whole", "look_of", "shown_ends", "typical_span"]

TYPICAL = 0.99
"""Fraction of the numbers other than 0 that a robust range contains at least."""

_NOTHING_LINEAR = tuple(float(channel) for channel in decode_srgb(np.array(NOTHING) / 255.0))


@dataclass(frozen=True, slots=True, eq=False)
class ScalarLook:
    """Parameters of the shader for a scalar quantity.

    Attributes
    ----------
    colors : (N, 4) uint8
        sRGB: 256 from the lowest to the highest number shown, or one for each whole number.
    ends : (float, float)
        What the first and the last colour stand for.
    is_whole : bool
        Whether each colour stands for one whole number, from 0.
    dark_zero : bool
        Whether 0 has a colour of its own, that of nothing.
    isolines : bool
        Whether there are lines at every tenth of the range.
    is_typical : bool
        Whether the ends leave out what is rare: larger numbers may look like the ends.
    """

    colors: Bytes
    ends: tuple[float, float]
    is_whole: bool = False
    dark_zero: bool = False
    isolines: bool = False
    is_typical: bool = False

    @property
    def uniforms(self) -> dict[str, object]:
        """What ``shaders/shade/scalar.glsl`` asks for."""
        return {
            "u_scalar_range": self.ends,
            "u_categories": self.is_whole,
            "u_dark_zero": self.dark_zero,
            "u_isolines": self.isolines,
            "u_nothing": _NOTHING_LINEAR,
        }


def is_whole(name: str) -> bool:
    """Return whether a view's numbers are counts or indices."""
    return find_quantity(name).kind in ("discrete", "categorical")


def typical_span(numbers: Floats) -> tuple[float, float]:
    """Return between which numbers nearly all lie that are not 0.

    Parameters
    ----------
    numbers : (V,)
        Of a view.

    Returns
    -------
    (float, float)
        Lowest and highest of the numbers whose amounts are not above that of the 99th of a
        hundred; the lowest and highest of all if there are fewer than a hundred.
    """
    amounts = np.abs(numbers[numbers != 0.0])
    if not len(amounts):
        return 0.0, 0.0
    most = float(np.quantile(amounts, TYPICAL, method="higher"))
    return max(float(numbers.min()), -most), min(float(numbers.max()), most)


def shown_ends(
    name: str,
    figure: Figure,
    ranges: Sequence[tuple[float, float]],
    options: DisplayOptions,
) -> tuple[float, float]:
    """Return the common range of the colour map for all figures.

    Parameters
    ----------
    name : str
        Of the view.
    figure : Figure
        Gives the unit of a range that was asked for.
    ranges : sequence of (float, float)
        Lowest and highest number of each figure, or those of its typical span.
    options : DisplayOptions
        The range that was asked for, if there is one.

    Returns
    -------
    (float, float)
        In the view's own numbers.
    """
    asked = options.scalar_range
    if asked is not None and not is_whole(name):
        factor, _ = shown_unit(name, figure)
        return asked[0] / factor, asked[1] / factor
    lows, highs = zip(*ranges, strict=True)
    return find_quantity(name).shown(min(lows), max(highs))


def look_of(
    name: str, figure: Figure, ends: tuple[float, float], options: DisplayOptions
) -> ScalarLook:
    """Return how a view of a figure is coloured.

    Parameters
    ----------
    name : str
        Of the view.
    figure : Figure
        Gives the colours of its joints or parts.
    ends : (float, float)
        As ``shown_ends`` gives them.
    options : DisplayOptions
        Whether there are isolines.
    """
    view = find_quantity(name)
    if view.kind == "categorical":
        return ScalarLook(_category_colors(name, figure), ends, is_whole=True)
    if view.kind == "discrete":
        return ScalarLook(count_palette(max(round(ends[1]), 1)), ends, is_whole=True)
    colors = diverging_map() if view.kind == "diverging" else colormap()
    isolines = view.isolines if options.isolines is None else options.isolines
    # No weight at all is another thing than a small one.
    is_typical = view.robust and options.scalar_range is None
    return ScalarLook(
        colors, ends, dark_zero=view.takes_joint, isolines=isolines, is_typical=is_typical
    )


def _category_colors(name: str, figure: Figure) -> Bytes:
    count = max(len(categories(name, figure)), 1)
    if split_name(name)[0] in ("parts", "class"):
        return part_palette(count)
    parents = np.full(count, -1, dtype=np.int32)
    return joint_palette(parents if figure.skeleton is None else figure.skeleton.parents)
