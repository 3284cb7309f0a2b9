"""Mapping from the values of a scalar quantity to colours."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from viewer.data_classes import dataclass
from viewer.rendering.colors import (
    NOTHING,
    colormap,
    count_palette,
    diverging_map,
    joint_palette,
    named_map,
    part_palette,
)
from viewer.rendering.options import DisplayOptions
from viewer.rigs.arrays import Bytes, Floats
from viewer.rigs.figure import Figure
from viewer.rigs.scalars import categories, find_quantity, shown_unit, split_name
from viewer.rigs.srgb import decode_srgb

TYPICAL = 0.99
"""Minimum fraction of the nonzero values that a robust range contains."""

_NOTHING_LINEAR = tuple(float(channel) for channel in decode_srgb(np.array(NOTHING) / 255.0))


@dataclass(frozen=True, slots=True, eq=False)
class ScalarLook:
    """Colours of a scalar quantity and parameters of its shader."""

    colors: Bytes
    """(N, 4) uint8. sRGB: 256 from the lowest to the highest value shown, or one per integer."""
    ends: tuple[float, float]
    """Values of the first and the last colour."""
    is_whole: bool = False
    """Whether each colour represents one integer, from 0."""
    dark_zero: bool = False
    """Whether 0 has a separate colour, ``NOTHING``."""
    isolines: bool = False
    """Whether lines are drawn at every tenth of the range."""
    is_typical: bool = False
    """Whether the range excludes outliers, which get the colours of its ends."""

    @property
    def uniforms(self) -> dict[str, object]:
        """Uniforms of ``shaders/shade/scalar.glsl``."""
        return {
            "u_scalar_range": self.ends,
            "u_categories": self.is_whole,
            "u_dark_zero": self.dark_zero,
            "u_isolines": self.isolines,
            "u_nothing": _NOTHING_LINEAR,
        }


def is_whole(name: str) -> bool:
    """Return whether the values of a quantity are counts or indices."""
    return find_quantity(name).kind in ("discrete", "categorical")


def typical_span(numbers: Floats) -> tuple[float, float]:
    """Return a range that contains nearly all nonzero values of a scalar quantity, (V,)."""
    # It is limited to the 99th percentile of their absolute values; with fewer than a hundred
    # nonzero values, it is the whole range.
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
    """Return the range of the colours, in the values' unit; a request is in that of ``figure``."""
    requested = options.scalar_range
    if requested is not None and not is_whole(name):
        factor, _ = shown_unit(name, figure)
        return requested[0] / factor, requested[1] / factor
    lows, highs = zip(*ranges, strict=True)
    return find_quantity(name).shown(min(lows), max(highs))


def look_of(
    name: str, figure: Figure, ends: tuple[float, float], options: DisplayOptions
) -> ScalarLook:
    """Return the colours of a quantity on a figure, between the results of ``shown_ends``."""
    quantity = find_quantity(name)
    if quantity.kind == "categorical":
        return ScalarLook(_category_colors(name, figure), ends, is_whole=True)
    if quantity.kind == "discrete":
        return ScalarLook(count_palette(max(round(ends[1]), 1)), ends, is_whole=True)
    if options.colormap != "auto":
        colors = named_map(options.colormap)
    else:
        colors = diverging_map() if quantity.kind == "diverging" else colormap()
    isolines = quantity.isolines if options.isolines is None else options.isolines
    # A weight of 0 must be distinguishable from a small weight.
    is_typical = quantity.robust and options.scalar_range is None
    return ScalarLook(
        colors, ends, dark_zero=quantity.takes_joint, isolines=isolines, is_typical=is_typical
    )


def _category_colors(name: str, figure: Figure) -> Bytes:
    count = max(len(categories(name, figure)), 1)
    if split_name(name)[0] in ("parts", "class"):
        return part_palette(count)
    parents = np.full(count, -1, dtype=np.int32)
    return joint_palette(parents if figure.skeleton is None else figure.skeleton.parents)
