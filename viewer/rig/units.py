"""Units of length that figures and files may be in: factors, words, and how to guess them."""

from __future__ import annotations

__all__ = ["METRES", "SIZES", "WORDS", "is_metres", "unit_of_scaled"]

_ALIKE = 2.5  # how much larger or smaller two of a kind may be, as a child and a giant

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
"""Metres in one of each unit that ``Figure.unit`` may be; an unknown unit is not among them.

>>> 70.0 * METRES["in"] / METRES["cm"]
177.8
"""

WORDS = {"m": "metres", "cm": "centimetres", "mm": "millimetres", "in": "inches"}
"""What messages call them."""

SIZES = {"m": (0.3, 3.5), "cm": (50.0, 350.0), "mm": (500.0, 3500.0)}
"""Smallest and largest number that the longest side of a body, small to giant, has in a unit.

Where two units overlap, the first counts.
"""


def is_metres(size: float) -> bool:
    """Return whether a figure of unknown unit may be in metres, judged by its longest side.

    >>> is_metres(1.7), is_metres(170.0)
    (True, False)
    """
    low, high = SIZES["m"]
    return low <= size <= high


def unit_of_scaled(unit: str, scale: float) -> str:
    """Return the unit of a figure that is of the same kind as another, judged by their sizes.

    Parameters
    ----------
    unit : str
        The other figure's.
    scale : float
        The figure's length over the other's, each in its own unit.

    Returns
    -------
    str
        "" if the other's unit is not known, or no unit makes both of about one size.

    >>> unit_of_scaled("m", 1.04), unit_of_scaled("m", 950.0), unit_of_scaled("m", 7.0)
    ('m', 'mm', '')
    """
    if unit not in METRES:
        return ""
    # Inches are too near to centimetres to be told from them by size.
    for known in dict.fromkeys((unit, "m", "cm", "mm")):
        ratio = scale * METRES[known] / METRES[unit]
        if 1.0 / _ALIKE <= ratio <= _ALIKE:
            return known
    return ""
