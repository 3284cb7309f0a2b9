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

from viewer.formats._vrm.json_parts import part
from viewer.formats._vrm.material_values import main_transform
from viewer.formats._vrm.numbers import rows_of, value_of
from viewer.rig.arrays import Floats
from viewer.rig.srgb import decode_srgb

__all__ = ["TEXTURE_TRANSFORM", "overridden", "placement"]

TEXTURE_TRANSFORM = "KHR_texture_transform"
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
    return {"extensions": {TEXTURE_TRANSFORM: {"scale": values[:2], "offset": values[2:]}}}


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
