"""Thresholds of toon shading of VRM 0.x in the terms of VRM 1.0."""

from __future__ import annotations

__all__ = ["modern_ramp"]


def modern_ramp(toony: float, shift: float) -> tuple[float, float]:
    """Return ``shadingToonyFactor`` and ``shadingShiftFactor`` with the same ramp.

    Version 0.x rises from ``shift`` to the interpolation from 1 to ``shift`` by ``toony``; version
    1.0 from toony' - 1 - shift' to 1 - toony' - shift'.

    >>> modern_ramp(0.5, 0.0)
    (0.75, -0.25)
    """
    toony += (1.0 - toony) * (0.5 + 0.5 * shift)
    return toony, -shift - (1.0 - toony)
