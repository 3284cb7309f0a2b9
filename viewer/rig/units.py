"""Units of length that figures and files may be in: factors, words, and how to guess them."""

from __future__ import annotations

__all__ = ["METRES", "SIZES", "WORDS", "is_metres"]

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
