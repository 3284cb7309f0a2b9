"""Units of length of figures and files: factors, names, and estimates from sizes."""

from __future__ import annotations

_ALIKE = 2.5  # largest plausible ratio of the sizes of similar figures, such as adult and child

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
"""Metres per unit, for every known ``Figure.unit``.

>>> 70.0 * METRES["in"] / METRES["cm"]
177.8
"""

UNIT_NAMES = {"m": "metres", "cm": "centimetres", "mm": "millimetres", "in": "inches"}
"""Names of the units in messages."""

SIZES = {"m": (0.3, 3.5), "cm": (50.0, 350.0), "mm": (500.0, 3500.0)}
"""Plausible range of the longest side of a body in each unit.

Where two units overlap, the first takes precedence.
"""


def is_metres(size: float) -> bool:
    """Return whether a figure of unknown unit may be in metres, judged by its longest side."""
    low, high = SIZES["m"]
    return low <= size <= high


def unit_of_scaled(unit: str, scale: float) -> str:
    """Return the unit in which a figure is about as long as a similar one; empty if unclear.

    ``scale``: its length over that of the similar figure, which is in ``unit``, each in its own.
    """
    if unit not in METRES:
        return ""
    # Inches are too close to centimetres to be distinguished by size.
    for known in dict.fromkeys((unit, "m", "cm", "mm")):
        ratio = scale * METRES[known] / METRES[unit]
        if 1.0 / _ALIKE <= ratio <= _ALIKE:
            return known
    return ""
