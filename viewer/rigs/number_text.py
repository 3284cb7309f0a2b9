"""Number and angle formatting for display, and round steps of scales."""

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


def round_step(least: float) -> float:
    """Return the smallest of 1, 2 and 5 times a power of ten that is not below a number.

    A step that is smaller by up to 0.1 % is taken, too.

    >>> [round_step(x) for x in (0.2, 0.21, 1.5, 3.0, 11.0, 60.0)]
    [0.2, 0.5, 2.0, 5.0, 20.0, 100.0]
    """
    power = 10.0 ** math.floor(math.log10(least))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= 0.999 * least)
    return float(f"{step:.6g}")  # powers below 1 are rounded


def angle_text(radians: float, in_degrees: bool, sign: str = "") -> str:
    """Format an angle in the unit of the display: "28.6°" or "0.500 rad"; "+" shows all signs."""
    if in_degrees:
        return f"{number_text(math.degrees(radians), f'{sign}.1f')}\N{DEGREE SIGN}"
    return f"{number_text(radians, f'{sign}.3f')} rad"
