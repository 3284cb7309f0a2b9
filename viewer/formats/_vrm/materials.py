"""Materials of VRM: the changes by expressions, and those of version 0.x in the terms of 1.0.

::

    changes   VRM 0.x  materialValues: materialName, propertyName, targetValue of 4 numbers
              VRM 1.0  materialColorBinds: material, type, targetValue of 4 numbers
                       textureTransformBinds: material, scale, offset

    materialProperties of VRM 0.x, which override the core members of toon and unlit materials
        vectorProperties   _Color (sRGB), _EmissionColor (linear)   colours
                           _MainTex                                 placement of all textures
        textureProperties  _MainTex, _BumpMap, _EmissionMap         textures
        keywordMap         _ALPHATEST_ON, _ALPHABLEND_ON            alphaMode, if the core has none
        shader             VRM/UnlitCutout, VRM/UnlitTransparent…   alphaMode, if the core has none
        floatProperties    _Cutoff, _CullMode, _BumpScale           alphaCutoff, doubleSided, scale
                                                                    of normals, if the core has none

Colours of version 0.x are sRGB, except those of emission. ``_MainTex_ST`` has the scale and the
offset of texture coordinates whose origin is at the bottom; ``_MainTex_ST_S`` and ``_MainTex_ST_T``
change only one axis. Widths of outlines are in centimetres or hundredths of half the image height,
and rotations of texture coordinates are in revolutions per second.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from viewer.formats._vrm.parts import is_index, list_in, part, rows_of, value_of
from viewer.rigs.arrays import Floats
from viewer.rigs.expressions import COLOR_KINDS, TRANSFORM
from viewer.rigs.file_record import Json
from viewer.rigs.srgb import decode_srgb

_Bind = tuple[int, str, Floats]
"""Material, kind and target (4,), as in ``viewer.rigs.expressions.MaterialBinds``."""
_COLORS = {
    "_Color": "color",
    "_EmissionColor": "emissionColor",
    "_ShadeColor": "shadeColor",
    "_RimColor": "rimColor",
    "_OutlineColor": "outlineColor",
}
_LINEAR = "_EmissionColor"
_AXES = {"_MainTex_ST": (0, 1), "_MainTex_ST_S": (0,), "_MainTex_ST_T": (1,)}

# Core members of version 0.x.
_TEXTURE_TRANSFORM = "KHR_texture_transform"
_SURFACE = "pbrMetallicRoughness"
_CORE_TEXTURES = {
    "_MainTex": (_SURFACE, "baseColorTexture"),
    "_BumpMap": ("normalTexture",),
    "_EmissionMap": ("emissiveTexture",),
}
_CULL_OFF = 0.0
_BRIGHTEST = 1e6  # maximum of emitted light

# Toon shading of version 0.x: members of version 1.0, defaults and factors.
_TOON_TEXTURES = {
    "_ShadeTexture": "shadeMultiplyTexture",
    "_SphereAdd": "matcapTexture",
    "_RimTexture": "rimMultiplyTexture",
    "_OutlineWidthTexture": "outlineWidthMultiplyTexture",
    "_UvAnimMaskTexture": "uvAnimationMaskTexture",
}
_TOON_COLORS = {
    "_ShadeColor": ("shadeColorFactor", (0.97, 0.81, 0.86, 1.0)),
    "_RimColor": ("parametricRimColorFactor", (0.0, 0.0, 0.0, 1.0)),
    "_OutlineColor": ("outlineColorFactor", (0.0, 0.0, 0.0, 1.0)),
}
_TOON_NUMBERS = {
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
_OUTLINE_MODES = ("none", "worldCoordinates", "screenCoordinates")

# Metres per centimetre, and image heights per hundredth of half the height.
_OUTLINE_WIDTHS = (0.0, 0.01, 0.005)
_WRITES_DEPTH = 3  # value of _BlendMode


def upgraded_binds(
    told: object, materials: list[object]
) -> tuple[dict[str, list[Json]], list[str]]:
    """Return an expression's changes in the terms of 1.0, and labels of those without effect."""
    colors: list[Json] = []
    moves: dict[int, Floats] = {}
    lost: list[str] = []
    for each in list_in(told, "materialValues"):
        name, value = part(each, "propertyName"), rows_of(part(each, "targetValue"), (0.0,) * 4)
        named = part(each, "materialName")
        owners = [n for n, material in enumerate(materials) if part(material, "name") == named]
        is_known = isinstance(name, str) and (name in _COLORS or name in _AXES)
        if value is None or not owners or not is_known:
            lost.append(f"{named} {name}")
            continue
        for owner in owners:
            if name in _COLORS:
                # Emission is linear in the file, other colours are sRGB.
                color = value[:3] if name == _LINEAR else decode_srgb(value[:3].clip(0.0, 1.0))
                target = [*color.tolist(), float(value[3])]
                colors.append({"material": owner, "type": _COLORS[name], "targetValue": target})
                continue
            move = moves.setdefault(owner, _main_transform(materials[owner]))
            for axis in _AXES[name]:
                scale, offset = float(value[axis]), float(value[2 + axis])
                # With v' = 1 - v, v scale + offset becomes v' scale + (1 - offset - scale).
                move[[axis, 2 + axis]] = scale, 1.0 - offset - scale if axis else offset
    moved = [
        {"material": owner, "scale": move[:2].tolist(), "offset": move[2:].tolist()}
        for owner, move in moves.items()
    ]
    named_rows = {"materialColorBinds": colors, "textureTransformBinds": moved}
    return {name: rows for name, rows in named_rows.items() if rows}, lost


def _main_transform(told: object) -> Floats:
    """Return scale and offset of the texture coordinates of a material, origin at the top: (4,)."""
    value = rows_of(part(told, "vectorProperties", "_MainTex"), (0.0, 0.0, 1.0, 1.0))
    x, y, width, height = (0.0, 0.0, 1.0, 1.0) if value is None else value.tolist()
    return np.array([width, height, x, 1.0 - y - height])


def modern_binds(told: object, n_materials: int) -> tuple[list[_Bind], list[str]]:
    """Return the changes by an expression of version 1.0, and labels of changes without effect."""
    found: list[_Bind] = []
    lost: list[str] = []
    for each in list_in(told, "materialColorBinds"):
        index, kind = part(each, "material"), part(each, "type")
        value = _color(part(each, "targetValue"))
        if is_index(index, n_materials) and kind in COLOR_KINDS and value is not None:
            found.append((index, kind, value))
        else:
            lost.append(f"{kind} of material {index}")
    for each in list_in(told, "textureTransformBinds"):
        index = part(each, "material")
        scale = rows_of(part(each, "scale"), (1.0, 1.0))
        offset = rows_of(part(each, "offset"), (0.0, 0.0))
        if is_index(index, n_materials) and scale is not None and offset is not None:
            found.append((index, TRANSFORM, np.append(scale, offset)))
        else:
            lost.append(f"textures of material {index}")
    return found, lost


def _color(told: object) -> Floats | None:
    """Return a colour of three or four numbers with its opacity; None if it is invalid."""
    if isinstance(told, list) and len(told) == 3:
        told = [*told, 1.0]
    return None if told is None else rows_of(told, (0.0,) * 4)


def overridden(core: Mapping[str, object], told: object) -> Json:
    """Return a core material's members with those that its ``materialProperties`` replaces."""
    found = _opacity(told) | dict(core)
    surface = found.get(_SURFACE)
    if surface is not None and not isinstance(surface, dict):
        return found
    found[_SURFACE] = dict(surface or {})
    color = _vector(told, "_Color")
    if color is not None:
        values = [*decode_srgb(color[:3].clip(0.0, 1.0)), color[3].clip(0.0, 1.0)]
        found[_SURFACE]["baseColorFactor"] = [float(value) for value in values]
    placed = _placement(told)
    for name, (*outer, member) in _CORE_TEXTURES.items():
        owner = found[_SURFACE] if outer else found
        index = part(told, "textureProperties", name)
        if isinstance(index, int):
            given = owner.get(member)
            scale = value_of(part(told, "floatProperties", "_BumpScale"), 1.0)
            scaled = {} if name != "_BumpMap" or scale is None else {"scale": scale}
            kept = given if isinstance(given, dict) else scaled
            owner[member] = {**kept, "index": index}
        if isinstance(owner.get(member), dict):
            owner[member] = {**owner[member], **placed}
    return found | _emission(told, found.get("extensions"))


def _opacity(told: object) -> Json:
    """Return opacity and culling."""
    found: Json = {}
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


def _vector(told: object, name: str) -> Floats | None:
    """Return four numbers; None if they are missing or invalid."""
    value = part(told, "vectorProperties", name)
    return None if value is None else rows_of(value, (0.0,) * 4)


def _placement(told: object) -> Json:
    """Return the extensions of textures that are placed like the main texture."""
    values = _main_transform(told).tolist()
    if values == [1.0, 1.0, 0.0, 0.0]:
        return {}
    return {"extensions": {_TEXTURE_TRANSFORM: {"scale": values[:2], "offset": values[2:]}}}


def _emission(told: object, extensions: object) -> Json:
    """Return the emitted light: factors up to 1, and the strength in an extension."""
    color = _vector(told, "_EmissionColor")
    if color is None:
        return {}
    light = color[:3].clip(0.0, _BRIGHTEST)
    strength = max(1.0, float(light.max()))
    given = extensions if isinstance(extensions, dict) else {}
    strengths = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
    return {"emissiveFactor": (light / strength).tolist(), "extensions": {**given, **strengths}}


def modern_toon(told: object) -> tuple[Json, list[str]]:
    """Return the members of ``VRMC_materials_mtoon``, and the properties without a counterpart."""

    def number(name: str, default: float) -> float:
        value = value_of(part(told, "floatProperties", name), default)
        return default if value is None else value

    toony, shift = _modern_ramp(number("_ShadeToony", 0.9), number("_ShadeShift", 0.0))
    mode = int(number("_OutlineWidthMode", 0.0)) % len(_OUTLINE_MODES)
    mixes = number("_OutlineColorMode", 0.0) == 1.0
    toon: Json = {
        "specVersion": "1.0",
        "transparentWithZWrite": number("_BlendMode", 0.0) == _WRITES_DEPTH,
        "shadingToonyFactor": min(max(toony, 0.0), 1.0),
        "shadingShiftFactor": min(max(shift, -1.0), 1.0),
        "giEqualizationFactor": min(max(1.0 - number("_IndirectLightIntensity", 0.1), 0.0), 1.0),
        "outlineWidthMode": _OUTLINE_MODES[mode],
        "outlineWidthFactor": _OUTLINE_WIDTHS[mode] * number("_OutlineWidth", 0.5),
        "outlineLightingMixFactor": number("_OutlineLightingMix", 1.0) if mixes else 0.0,
    }
    for old, (new, usual) in _TOON_COLORS.items():
        value = rows_of(part(told, "vectorProperties", old), usual)
        color = np.array(usual) if value is None else value
        toon[new] = decode_srgb(color[:3].clip(0.0, 1.0)).tolist()
    for old, (new, default, factor) in _TOON_NUMBERS.items():
        toon[new] = 0.0 + factor * number(old, default)
    placed = _placement(told)
    for old, new in _TOON_TEXTURES.items():
        index = part(told, "textureProperties", old)
        if isinstance(index, int):
            # The sphere map is not placed like the main texture.
            toon[new] = {"index": index} | (placed if old != "_SphereAdd" else {})
    if "matcapTexture" in toon:
        toon["matcapFactor"] = [1.0, 1.0, 1.0]
    name = part(told, "name")
    used = [each for each in _LOST_TEXTURES if part(told, "textureProperties", each) is not None]
    used += [each for each, value in _LOST_NUMBERS.items() if number(each, value) != value]
    return toon, [f"{name} {each}" for each in used]


def _modern_ramp(toony: float, shift: float) -> tuple[float, float]:
    """Return ``shadingToonyFactor`` and ``shadingShiftFactor`` with the same ramp."""
    # Version 0.x rises from s = shift to e = t s + (1 - t) 1 with t = toony; version 1.0 from
    # t' - 1 - s' to 1 - t' - s'. The sum of both ends gives s' = -(s + e) / 2, the difference
    # t' = 1 - (e - s) / 2 = t + (1 - t) (1 + s) / 2, so s' = -s - (1 - t').
    toony += (1.0 - toony) * (0.5 + 0.5 * shift)
    return toony, -shift - (1.0 - toony)
