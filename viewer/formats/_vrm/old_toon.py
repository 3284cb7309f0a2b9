"""Toon materials of VRM 0.x, ``materialProperties``, in the terms of VRM 1.0.

Colours are sRGB, widths of outlines are in centimetres or hundredths of half the image height, and
rotations of texture coordinates are in revolutions per second.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from viewer.formats._vrm.json_parts import part
from viewer.formats._vrm.numbers import rows_of, value_of
from viewer.formats._vrm.old_core import placement
from viewer.formats._vrm.toon_ramp import modern_ramp
from viewer.rig.srgb import decode_srgb

__all__ = ["modern_toon"]

_TEXTURES = {
    "_ShadeTexture": "shadeMultiplyTexture",
    "_SphereAdd": "matcapTexture",
    "_RimTexture": "rimMultiplyTexture",
    "_OutlineWidthTexture": "outlineWidthMultiplyTexture",
    "_UvAnimMaskTexture": "uvAnimationMaskTexture",
}
_COLORS = {
    "_ShadeColor": ("shadeColorFactor", (0.97, 0.81, 0.86, 1.0)),
    "_RimColor": ("parametricRimColorFactor", (0.0, 0.0, 0.0, 1.0)),
    "_OutlineColor": ("outlineColorFactor", (0.0, 0.0, 0.0, 1.0)),
}
_NUMBERS = {
    "_RimLightingMix": ("rimLightingMixFactor", 0.0, 1.0),
    "_RimFresnelPower": ("parametricRimFresnelPowerFactor", 1.0, 1.0),
    "_RimLift": ("parametricRimLiftFactor", 0.0, 1.0),
    "_UvAnimScrollX": ("uvAnimationScrollXSpeedFactor", 0.0, 1.0),
    "_UvAnimScrollY": ("uvAnimationScrollYSpeedFactor", 0.0, -1.0),
    "_UvAnimRotation": ("uvAnimationRotationSpeedFactor", 0.0, 2.0 * np.pi),
}
# Default of each number without a counterpart, and textures without a counterpart.
_LOST_NUMBERS = {"_ReceiveShadowRate": 1.0, "_ShadingGradeRate": 1.0, "_LightColorAttenuation": 0.0}
_LOST_TEXTURES = ("_ReceiveShadowTexture", "_ShadingGradeTexture")
_MODES = ("none", "worldCoordinates", "screenCoordinates")
# Metres per centimetre, and image heights per hundredth of half the height.
_WIDTHS = (0.0, 0.01, 0.005)
_WRITES_DEPTH = 3  # value of _BlendMode


def modern_toon(told: Any) -> tuple[dict[str, Any], list[str]]:
    """Return the members of ``VRMC_materials_mtoon``, and the properties without a counterpart.

    ``told``: a member of ``materialProperties``, as parsed from JSON.
    """

    def number(name: str, default: float) -> float:
        value = value_of(part(told, "floatProperties", name), default)
        return default if value is None else value

    toony, shift = modern_ramp(number("_ShadeToony", 0.9), number("_ShadeShift", 0.0))
    mode = int(number("_OutlineWidthMode", 0.0)) % len(_MODES)
    mixes = number("_OutlineColorMode", 0.0) == 1.0
    toon: dict[str, Any] = {
        "specVersion": "1.0",
        "transparentWithZWrite": number("_BlendMode", 0.0) == _WRITES_DEPTH,
        "shadingToonyFactor": min(max(toony, 0.0), 1.0),
        "shadingShiftFactor": min(max(shift, -1.0), 1.0),
        "giEqualizationFactor": min(max(1.0 - number("_IndirectLightIntensity", 0.1), 0.0), 1.0),
        "outlineWidthMode": _MODES[mode],
        "outlineWidthFactor": _WIDTHS[mode] * number("_OutlineWidth", 0.5),
        "outlineLightingMixFactor": number("_OutlineLightingMix", 1.0) if mixes else 0.0,
    }
    for old, (new, usual) in _COLORS.items():
        value = rows_of(part(told, "vectorProperties", old), usual)
        color = np.array(usual) if value is None else value
        toon[new] = decode_srgb(color[:3].clip(0.0, 1.0)).tolist()
    for old, (new, default, factor) in _NUMBERS.items():
        toon[new] = 0.0 + factor * number(old, default)
    toon |= _textures(told)
    if "matcapTexture" in toon:
        toon["matcapFactor"] = [1.0, 1.0, 1.0]
    name = part(told, "name")
    used = [each for each in _LOST_TEXTURES if part(told, "textureProperties", each) is not None]
    used += [each for each, value in _LOST_NUMBERS.items() if number(each, value) != value]
    return toon, [f"{name} {each}" for each in used]


def _textures(told: Any) -> dict[str, Any]:
    """Return the textures, placed like the main texture, except for the sphere map."""
    found, placed = dict[str, Any](), placement(told)
    for old, new in _TEXTURES.items():
        index = part(told, "textureProperties", old)
        if isinstance(index, int):
            found[new] = {"index": index} | (placed if old != "_SphereAdd" else {})
    return found
