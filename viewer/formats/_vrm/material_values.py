"""Colours that expressions of VRM change, by the names of both versions."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.srgb import decode_srgb

__all__ = ["COLORS", "linear_color"]

COLORS = {
    "_Color": "color",
    "_EmissionColor": "emissionColor",
    "_ShadeColor": "shadeColor",
    "_RimColor": "rimColor",
    "_OutlineColor": "outlineColor",
}
"""Type of ``materialColorBinds`` in VRM 1.0 by ``propertyName`` of ``materialValues`` in 0.x."""

_LINEAR = "_EmissionColor"


def linear_color(name: str, value: Floats) -> Floats:
    """Return a colour of VRM 0.x, (4,), as linear values; its opacity is unchanged.

    >>> linear_color("_Color", np.array([1.0, 0.0, 0.0, 0.5])).tolist()
    [1.0, 0.0, 0.0, 0.5]
    """
    if name == _LINEAR:
        return value
    return np.append(decode_srgb(value[:3].clip(0.0, 1.0)), value[3])
