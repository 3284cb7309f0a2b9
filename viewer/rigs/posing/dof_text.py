"""DOF values as text, with angles in degrees."""

from __future__ import annotations

import math

from viewer.diagnostics import Phrase
from viewer.rigs.number_text import number_text
from viewer.rigs.skeleton import FIRST_ROTATION, Skeleton, dof_label

_MOST_DIGITS = 9  # maximum number of decimals; more would show rounding errors of float64


def dof_value_text(skeleton: Skeleton, dof: int, value: float, digits: int = 1) -> str:
    """Return a DOF's radians or length as text: ``"28.6°"``, ``"0.25"``."""
    if skeleton.dof_kinds[dof] >= FIRST_ROTATION:
        return f"{number_text(math.degrees(value), f'.{digits}f')}\N{DEGREE SIGN}"
    return number_text(value, f".{digits + 3}g")


def beyond_text(skeleton: Skeleton, dof: int, value: float, when: Phrase | str = "") -> Phrase:
    """Return ``"a.x is 0.0° in frame 3; its limits are …"`` with " in frame 3" for ``when``."""
    low, high = (float(limit) for limit in skeleton.dof_limits[dof])
    limit = low if value < low else high
    digits = 1
    # Enough decimals to show that the value is outside the limits.
    while digits < _MOST_DIGITS and dof_value_text(skeleton, dof, value, digits) == dof_value_text(
        skeleton, dof, limit, digits
    ):
        digits += 1
    shown, least, most = (
        dof_value_text(skeleton, dof, number, digits) for number in (value, low, high)
    )
    label = dof_label(skeleton, dof)
    if math.isfinite(low) and math.isfinite(high):
        return Phrase(
            "{dof} is {value}{when}; its limits are {low} and {high}",
            dof=label,
            value=shown,
            when=when,
            low=least,
            high=most,
        )
    if value < low:
        return Phrase(
            "{dof} is {value}{when}; its minimum is {low}",
            dof=label,
            value=shown,
            when=when,
            low=least,
        )
    return Phrase(
        "{dof} is {value}{when}; its maximum is {high}",
        dof=label,
        value=shown,
        when=when,
        high=most,
    )
