"""Core members of toon and unlit materials of VRM 0.x, which ``materialProperties`` overrides.

::

    vectorProperties   _Color (sRGB), _EmissionColor (linear)   colours
                       _MainTex                                 placement of all textures
    textureProperties  _MainTex, _BumpMap, _EmissionMap         textures
    keywordMap         _ALPHATEST_ON, _ALPHABLEND_ON            alphaMode, if the core has none
    shader             VRM/UnlitCutout, VRM/UnlitTransparent…   alphaMode, if the core has none
    floatProperties    _Cutoff, _CullMode, _BumpScale           alphaCutoff, doubleSided, scale of
                                                                normals, if the core has none
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from viewer.formats._vrm.materials import main_transform
from viewer.formats._vrm.parts import part, rows_of, value_of
from viewer.rig.arrays import Floats
from viewer.rig.srgb import decode_srgb

_TEXTURE_TRANSFORM = "KHR_texture_transform"
_SURFACE = "pbrMetallicRoughness"
_TEXTURES = {
    "_MainTex": (_SURFACE, "baseColorTexture"),
    "_BumpMap": ("normalTexture",),
    "_EmissionMap": ("emissiveTexture",),
}
_CULL_OFF = 0.0
_BRIGHTEST = 1e6


def placement(told: Any) -> dict[str, Any]:
    """Return the extensions of textures that are placed like the main texture.

    ``told``: a member of ``materialProperties``, as parsed from JSON.
    """
    values = main_transform(told).tolist()
    if values == [1.0, 1.0, 0.0, 0.0]:
        return {}
    return {"extensions": {_TEXTURE_TRANSFORM: {"scale": values[:2], "offset": values[2:]}}}


def overridden(core: Mapping[str, Any], told: Any) -> dict[str, Any]:
    """Return the members of a core material with those that ``materialProperties`` replaces.

    Parameters
    ----------
    core : mapping
        A member of ``materials``, as parsed from JSON.
    told : Any
        The member of ``materialProperties`` with the same index.
    """
    found = _opacity(told) | dict(core)
    surface = found.get(_SURFACE)
    if surface is not None and not isinstance(surface, dict):
        return found
    found[_SURFACE] = dict(surface or {})
    color = _vector(told, "_Color")
    if color is not None:
        values = [*decode_srgb(color[:3].clip(0.0, 1.0)), color[3].clip(0.0, 1.0)]
        found[_SURFACE]["baseColorFactor"] = [float(value) for value in values]
    placed = placement(told)
    for name, (*outer, member) in _TEXTURES.items():
        owner = found[_SURFACE] if outer else found
        index = part(told, "textureProperties", name)
        if isinstance(index, int):
            given = owner.get(member)
            kept = given if isinstance(given, dict) else _scale(told, name)
            owner[member] = {**kept, "index": index}
        if isinstance(owner.get(member), dict):
            owner[member] = {**owner[member], **placed}
    return found | _emission(told, found.get("extensions"))


def _vector(told: Any, name: str) -> Floats | None:
    """Return four numbers; None if they are missing or invalid."""
    value = part(told, "vectorProperties", name)
    return None if value is None else rows_of(value, (0.0,) * 4)


def _emission(told: Any, extensions: Any) -> dict[str, Any]:
    """Return the emitted light: factors up to 1, and the strength in an extension."""
    color = _vector(told, "_EmissionColor")
    if color is None:
        return {}
    light = color[:3].clip(0.0, _BRIGHTEST)
    strength = max(1.0, float(light.max()))
    given = extensions if isinstance(extensions, dict) else {}
    strengths = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
    return {"emissiveFactor": (light / strength).tolist(), "extensions": {**given, **strengths}}


def _scale(told: Any, name: str) -> dict[str, float]:
    """Return the scale of a texture of normals."""
    scale = value_of(part(told, "floatProperties", "_BumpScale"), 1.0)
    return {} if name != "_BumpMap" or scale is None else {"scale": scale}


def _opacity(told: Any) -> dict[str, Any]:
    """Return opacity and culling."""
    found: dict[str, Any] = {}
    shader, keywords = str(part(told, "shader")), part(told, "keywordMap")
    if part(keywords, "_ALPHABLEND_ON") is True or "Transparent" in shader:
        found["alphaMode"] = "BLEND"
    elif part(keywords, "_ALPHATEST_ON") is True or "Cutout" in shader:
        found["alphaMode"] = "MASK"
        cutoff = value_of(part(told, "floatProperties", "_Cutoff"), 0.5)
        found |= {} if cutoff is None else {"alphaCutoff": cutoff}
    if part(told, "floatProperties", "_CullMode") == _CULL_OFF:
        found["doubleSided"] = True
    return found


# Toon materials of VRM 0.x, ``materialProperties``, in the terms of VRM 1.0.
#
# Colours are sRGB, widths of outlines are in centimetres or hundredths of half the image height,
# and rotations of texture coordinates are in revolutions per second.
_TOON_TEXTURES = {
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

    toony, shift = _modern_ramp(number("_ShadeToony", 0.9), number("_ShadeShift", 0.0))
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
    for old, new in _TOON_TEXTURES.items():
        index = part(told, "textureProperties", old)
        if isinstance(index, int):
            found[new] = {"index": index} | (placed if old != "_SphereAdd" else {})
    return found


def _modern_ramp(toony: float, shift: float) -> tuple[float, float]:
    """Return ``shadingToonyFactor`` and ``shadingShiftFactor`` with the same ramp.

    Version 0.x rises from ``shift`` to the interpolation from 1 to ``shift`` by ``toony``; version
    1.0 from toony' - 1 - shift' to 1 - toony' - shift'.

    >>> _modern_ramp(0.5, 0.0)
    (0.75, -0.25)
    """
    toony += (1.0 - toony) * (0.5 + 0.5 * shift)
    return toony, -shift - (1.0 - toony)
