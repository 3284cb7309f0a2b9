"""Number and angle formatting for display."""

from __future__ import annotations

import math

from viewer.phrases import rounded

_NOT_ZERO = set("123456789n")  # "inf" and "nan" contain an n


def number_text(value: float, spec: str = "g") -> str:
    """Format a number, without a minus sign if it rounds to 0."""
    text = format(value, spec)
    return text if _NOT_ZERO.intersection(text) else format(0.0, spec)


def short_number(value: float) -> str:
    """Format a number with three significant digits, see ``viewer.phrases.rounded``."""
    text = rounded(value)
    return text if _NOT_ZERO.intersection(text) else "0"


def angle_text(radians: float, in_degrees: bool, sign: str = "") -> str:
    """Format an angle in the unit of the display: "28.6°" or "0.500 rad"; "+" shows all signs."""
    if in_degrees:
        return f"{number_text(math.degrees(radians), f'{sign}.1f')}\N{DEGREE SIGN}"
    return f"{number_text(radians, f'{sign}.3f')} rad"
