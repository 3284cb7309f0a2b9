"""Products of integers or floats and powers of ten, to about 100 bits.

Powers of ten and products are represented as sums of two floats (Dekker 1971). The relative error
is below ``ERROR``, so a result farther than that from a tie is correctly rounded.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from viewer.rig.arrays import Floats

__all__ = ["ERROR", "FARTHEST", "times_power"]

FARTHEST = 100
"""Largest magnitude of an exponent."""

ERROR = 2.0**-99
"""Relative error of a product; its bound is 6 x 2^-106."""

_SPLIT = 134217729.0  # 2^27 + 1, which splits a float into two halves of 26 bits


def times_power(
    values: Floats, rests: Floats | None, exponents: np.ndarray
) -> tuple[Floats, Floats]:
    """Return (values + rests) * 10^exponents as a sum of two floats, the second below half an ulp.

    Parameters
    ----------
    values, rests : (N,)
        Numbers up to 2^64; rests are below half an ulp of the values, or None for 0.
    exponents : (N,) int
        From -FARTHEST to FARTHEST.
    """
    power, low, upper, lower = (table.take(exponents + FARTHEST) for table in _tables())
    product = values * power
    half = values * _SPLIT
    half -= half - values
    rest = values - half
    # This is the exact error of the product, because no product of two halves is rounded.
    error = half * upper - product
    error += half * lower
    error += rest * upper
    error += rest * lower
    error += values * low
    if rests is not None:
        error += rests * power
    total = product + error
    return total, (product - total) + error


@cache
def _tables() -> tuple[Floats, Floats, Floats, Floats]:
    """Return the powers of ten: nearest float, its error, and its upper and lower half."""
    # Imported late, as most files have no number that needs these tables.
    from fractions import Fraction

    exact = [Fraction(10) ** exponent for exponent in range(-FARTHEST, FARTHEST + 1)]
    power = np.array([float(value) for value in exact])
    low = [float(value - Fraction(near)) for value, near in zip(exact, power.tolist(), strict=True)]
    upper = power * _SPLIT
    upper -= upper - power
    return power, np.array(low), upper, power - upper
