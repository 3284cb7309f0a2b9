"""Axes of the Curves panel's plot, with the scale and colours of its curves."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from imgui_bundle import imgui, implot

from viewer.app.core.ink import ink
from viewer.app.core.state import AppState
from viewer.app.curves.data import Curve
from viewer.app.curves.state import Curves
from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats

__all__ = [
    "Color",
    "Plot",
    "curve_color",
    "factor_of",
    "least_height",
    "measured",
    "ui_scale",
    "value_limits",
]

Color = tuple[float, float, float, float]

# Smallest value range that fitted axes magnify to the height of the plot. Rotations and
# positions in single precision, as files store them, are rounded to far smaller steps.
_LEAST_ANGLE = math.radians(0.1)
_LEAST_LENGTH = 5e-4  # lengths, relative to the size of the scene
_LEAST = 1e-3  # scale factors and weights
_LEAST_RELATIVE = 1e-5  # any value, relative to its magnitude
_CONSTANT = 0.02  # fraction of that range below which a change is drawn as a constant
_MARGIN = 0.16  # margin above and below the curves, relative to their height

_COLORS = ((0.95, 0.45, 0.42), (0.48, 0.85, 0.45), (0.45, 0.65, 1.0))
_SHADES = (1.0, 0.72, 1.25, 0.85, 1.12)  # brightness factors that distinguish the joints


@dataclass(frozen=True, slots=True)
class Plot:
    """State of the plot in this frame.

    Attributes
    ----------
    state : AppState
        State that is shown and changed.
    curves : tuple of Curve
        All curves of the motion.
    limits : (low, high, bottom, top)
        Ranges of clip time, in seconds, and of values, in the displayed unit.
    scale : (float, float)
        Pixels per second and per displayed unit.
    """

    state: AppState
    curves: tuple[Curve, ...]
    limits: tuple[float, float, float, float]
    scale: tuple[float, float]

    @property
    def view(self) -> Curves:
        """State of the Curves panel."""
        return self.state.of(Curves)

    def factor(self, row: int) -> float:
        """Return the factor from a curve's values to the displayed unit."""
        return factor_of(self.state, self.curves[row])

    def color(self, row: int) -> Color:
        """Return a curve's colour."""
        return curve_color(self.view, self.curves, row)

    def note(self, label: str, time: float, value: float, reach: float = 4.0) -> None:
        """Record the position of a point of the plot under a label, for tests."""
        place = implot.plot_to_pixels(time, value)
        rect = (place.x - reach, place.y - reach, place.x + reach, place.y + reach)
        self.state.item_rects[label] = rect


def measured(state: AppState, curves: tuple[Curve, ...]) -> Plot:
    """Return the current plot, after its axes have been set up."""
    box, place, size = implot.get_plot_limits(), implot.get_plot_pos(), implot.get_plot_size()
    limits = (box.x.min, box.x.max, box.y.min, box.y.max)
    state.item_rects["plot"] = (place.x, place.y, place.x + size.x, place.y + size.y)
    across, up = max(limits[1] - limits[0], 1e-12), max(limits[3] - limits[2], 1e-12)
    return Plot(state, curves, limits, (size.x / across, size.y / up))


def factor_of(state: AppState, curve: Curve) -> float:
    """Return the factor from a curve's values to the displayed unit: angles may be in degrees."""
    return math.degrees(1.0) if curve.is_angle and state.in_degrees else 1.0


def curve_color(view: Curves, curves: tuple[Curve, ...], row: int) -> Color:
    """Return a curve's colour: red, green or blue for x, y, z; each joint has its own shade."""
    groups = list(dict.fromkeys(curves[other].number for other in view.rows))
    number = curves[row].number
    shade = _SHADES[groups.index(number) % len(_SHADES)] if number in groups else 1.0
    red, green, blue = (min(part * shade, 1.0) for part in _COLORS[curves[row].axis])
    return ink((red, green, blue, 1.0))


def least_height(state: AppState, curves: Sequence[Curve]) -> float:
    """Return the minimum height of fitted axes for some curves, in the displayed units."""
    low, high = state.box
    length = _LEAST_LENGTH * float(np.linalg.norm(high - low))
    return max(
        (
            factor_of(state, curve)
            * (_LEAST_ANGLE if curve.is_angle else length if curve.is_length else _LEAST)
            for curve in curves
        ),
        default=_LEAST,
    )


def ui_scale() -> float:
    """Return the size of a point in window coordinates, which is the scale of the interface."""
    return float(imgui.get_style().font_scale_dpi)


def value_limits(values: Floats, least: float) -> tuple[float, float]:
    """Return the ends of an axis that shows some values, with a margin.

    Parameters
    ----------
    values : (N,)
        Values; those that are not finite are ignored.
    least : float
        Minimum height of the axis, so that rounding errors do not look like motion.

    >>> value_limits(np.array([0.0, 100.0]), 0.1), value_limits(np.array([30.0, 30.0]), 0.1)
    ((-16.0, 116.0), (15.0, 45.0))
    """
    values = values[np.isfinite(values)]
    bottom, top = (float(values.min()), float(values.max())) if len(values) else (-1.0, 1.0)
    height, largest = top - bottom, max(abs(top), abs(bottom))
    least = max(least, _LEAST_RELATIVE * largest)
    if height < _CONSTANT * least:
        middle = 0.5 * (bottom + top)
        pad = max(0.5 * abs(middle), 0.5)
        return middle - pad, middle + pad
    pad = max(_MARGIN * height, 0.5 * (least - height))
    return bottom - pad, top + pad
