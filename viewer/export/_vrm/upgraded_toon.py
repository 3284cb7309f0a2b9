"""Materials of VRM 0.x, ``materialProperties``, as extensions of materials of VRM 1.0.

Colours are sRGB, widths of outlines centimetres or hundredths of half the height of the picture,
and rotations of texture coordinates turns per second.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from viewer.formats._vrm.json_parts import part
from viewer.formats._vrm.numbers import rows_of, value_of
from viewer.formats._vrm.toon_ramp import modern_ramp
from viewer.rig.srgb import decode_srgb

__all__ = ["main_transform", "upgraded_toon"]

_TOON, _UNLIT = "VRMC_materials_mtoon", "KHR_materials_unlit"
_TRANSFORM = "KHR_texture_transform"
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
# Default of each number without a counterpart, and textures without one.
_LOST_NUMBERS = {"_ReceiveShadowRate": 1.0, "_ShadingGradeRate": 1.0, "_LightColorAttenuation": 0.0}
_LOST_TEXTURES = ("_ReceiveShadowTexture", "_ShadingGradeTexture")
_MODES = ("none", "worldCoordinates", "screenCoordinates")
_WIDTHS = (0.0, 0.01, 0.005)  # centimetres, and hundredths of half the height
_BLENDS, _WRITES_DEPTH = (2, 3), 3  # _BlendMode
_MOST_OFFSET = 9


def upgraded_toon(
    properties: list[Any], known: Mapping[int, Any], lost: list[str]
) -> dict[int, Any]:
    """Return the extensions of each material, by index.

    ``properties``: ``materialProperties``, parallel to the materials.
    ``known``: extensions that the materials already have.
    ``lost``: extended by the properties without a counterpart.
    """
    found: dict[int, Any] = {index: dict(each) for index, each in known.items()}
    offsets = _offsets(properties)
    for index, each in enumerate(properties):
        shader = part(each, "shader")
        if shader == "VRM/MToon":
            found[index] = {_TOON: _toon(each, offsets.get(index, 0), lost)}
        elif isinstance(shader, str) and shader.startswith("VRM/Unlit"):
            found[index] = {_UNLIT: {}}
    return found


def main_transform(properties: Any) -> dict[str, list[float]]:
    """Return scale and offset of the texture coordinates of a material, in glTF's axes."""
    value = rows_of(part(properties, "vectorProperties", "_MainTex"), (0.0, 0.0, 1.0, 1.0))
    x, y, width, height = (0.0, 0.0, 1.0, 1.0) if value is None else value.tolist()
    return {"scale": [width, height], "offset": [x, 1.0 - y - height]}


def _toon(told: Any, offset: int, lost: list[str]) -> dict[str, Any]:
    """Return the toon shading of a material."""

    def number(name: str, default: float) -> float:
        value = value_of(part(told, "floatProperties", name), default)
        return default if value is None else value

    toony, shift = modern_ramp(number("_ShadeToony", 0.9), number("_ShadeShift", 0.0))
    mode = int(number("_OutlineWidthMode", 0.0)) % len(_MODES)
    mixes = number("_OutlineColorMode", 0.0) == 1.0
    toon: dict[str, Any] = {
        "specVersion": "1.0",
        "transparentWithZWrite": number("_BlendMode", 0.0) == _WRITES_DEPTH,
        "renderQueueOffsetNumber": offset,
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
    lost += [
        f"{name} {each}" for each, value in _LOST_NUMBERS.items() if number(each, value) != value
    ]
    used = part(told, "textureProperties") or {}
    lost += [f"{name} {each}" for each in _LOST_TEXTURES if each in used]
    return toon


def _textures(told: Any) -> dict[str, Any]:
    """Return the textures, placed as the main texture except the sphere map."""
    found, place = dict[str, Any](), main_transform(told)
    is_moved = place != {"scale": [1.0, 1.0], "offset": [0.0, 0.0]}
    for old, new in _TEXTURES.items():
        index = part(told, "textureProperties", old)
        if isinstance(index, int):
            found[new] = {"index": index}
            if is_moved and old != "_SphereAdd":
                found[new]["extensions"] = {_TRANSFORM: place}
    return found


def _offsets(properties: list[Any]) -> dict[int, int]:
    """Return the order of transparent materials: 0 is last, or first if they write depth."""
    queues: dict[bool, dict[int, int]] = {False: {}, True: {}}
    for index, each in enumerate(properties):
        mode, queue = part(each, "floatProperties", "_BlendMode"), part(each, "renderQueue")
        if mode in _BLENDS and isinstance(queue, int):
            queues[mode == _WRITES_DEPTH][index] = queue
    found = {}
    for writes, own in queues.items():
        order = sorted(set(own.values()))
        for index, queue in own.items():
            place = order.index(queue) if writes else order.index(queue) - len(order) + 1
            found[index] = min(max(place, -_MOST_OFFSET), _MOST_OFFSET)
    return found
