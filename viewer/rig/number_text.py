"""Number and angle formatting for display."""

from __future__ import annotations

import math

from viewer.phrases import rounded

_NOT_ZERO = set("123456789n")  # "inf" and "nan" contain an n


def number_text(value: float, spec: str = "g") -> str:
    """Format a number, without a minus sign if it rounds to 0.

    ``spec``: format specification, as for Python's ``format``.

    >>> number_text(-0.0), number_text(-0.04, ".1f"), number_text(-0.0, "+.1f")
    ('0', '0.0', '+0.0')
    >>> number_text(-0.06, ".1f"), number_text(-1e-9), number_text(-math.inf)
    ('-0.1', '-1e-09', '-inf')
    """
    text = format(value, spec)
    return text if _NOT_ZERO.intersection(text) else format(0.0, spec)


def short_number(value: float) -> str:
    """Format a number with three significant digits, see ``viewer.phrases.rounded``.

    >>> short_number(0.012345), short_number(1234.5), short_number(-0.0)
    ('0.0123', '1,234', '0')
    """
    text = rounded(value)
    return text if _NOT_ZERO.intersection(text) else "0"


def angle_text(radians: float, in_degrees: bool, sign: str = "") -> str:
    """Format an angle in the unit of the display: ``"28.6°"`` or ``"0.500 rad"``.

    ``in_degrees``: degrees rather than radians. ``sign``: ``"+"`` to show the sign of positive
    angles too.
    """
    if in_degrees:
        return f"{number_text(math.degrees(radians), f'{sign}.1f')}\N{DEGREE SIGN}"
    return f"{number_text(radians, f'{sign}.3f')} rad"
