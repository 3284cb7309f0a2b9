"""Lengths as text: in millimetres or metres, or as a percentage of the figure's size."""

from __future__ import annotations

from viewer.phrases import rounded
from viewer.rig.figure import Figure
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.units import METRES

_METRE = 999.5  # millimetres that would be rounded to 1000 mm
_LEAST = (
    0.001  # smallest length that matters, in millimetres or percent; shorter ones are shown as it
)
_ZERO = 1e-6  # rounding errors below this are 0


def length_unit(figure: Figure) -> tuple[float, str]:
    """Return the factor and unit of small lengths: millimetres if the figure's unit is known."""
    if figure.unit in METRES:
        return 1000.0 * METRES[figure.unit], "mm"
    size = 0.0 if figure.mesh is None else box_size(bounding_box(figure.mesh.positions))
    return (100.0 / size, "% of the size") if size > 0.0 else (1.0, "units")


def length_text(figure: Figure, length: float) -> str:
    """Format a length with three digits: ``"12.3 mm"``, ``"2.31 m"`` or ``"1.5 % of the size"``.

    Rounding errors are 0, and other lengths are at least 0.001 mm, or 0.001 % of the size.
    """
    factor, unit = length_unit(figure)
    number = factor * length
    if unit == "mm" and number >= _METRE:
        number, unit = 0.001 * number, "m"
    elif unit != "units" and number < _LEAST:
        number = 0.0 if number < _ZERO else _LEAST
    return f"{rounded(number)} {unit}"
