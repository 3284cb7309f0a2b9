"""Core members of toon and unlit materials of VRM 0.x, which ``materialProperties`` overrides.

::

    textureProperties  _MainTex, _BumpMap, _EmissionMap   textures, if the core material has none
    vectorProperties   _MainTex                           placement of all of these
    keywordMap         _ALPHATEST_ON, _ALPHABLEND_ON      alphaMode, if the core material has none
    floatProperties    _Cutoff, _CullMode, _BumpScale     alphaCutoff, doubleSided, normal scale
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from viewer.formats._vrm.json_parts import part
from viewer.formats._vrm.material_values import main_transform
from viewer.formats._vrm.numbers import value_of

__all__ = ["TEXTURE_TRANSFORM", "overridden", "placement"]

TEXTURE_TRANSFORM = "KHR_texture_transform"
_SURFACE = "pbrMetallicRoughness"
_TEXTURES = {
    "_MainTex": (_SURFACE, "baseColorTexture"),
    "_BumpMap": ("normalTexture",),
    "_EmissionMap": ("emissiveTexture",),
}
_CULL_OFF = 0.0


def placement(told: Any) -> dict[str, Any]:
    """Return the extensions of textures that are placed like the main texture.

    ``told``: a member of ``materialProperties``, as parsed from JSON.
    """
    values = main_transform(told).tolist()
    if values == [1.0, 1.0, 0.0, 0.0]:
        return {}
    return {"extensions": {TEXTURE_TRANSFORM: {"scale": values[:2], "offset": values[2:]}}}


def overridden(core: Mapping[str, Any], told: Any) -> dict[str, Any]:
    """Return the members of a core material with those that ``materialProperties`` adds.

    Parameters
    ----------
    core : mapping
        A member of ``materials``, as parsed from JSON.
    told : Any
        The member of ``materialProperties`` with the same index.
    """
    found = dict(core)
    surface = found.get(_SURFACE)
    if surface is None or isinstance(surface, dict):
        found[_SURFACE] = dict(surface or {})
    placed = placement(told)
    for name, (*outer, member) in _TEXTURES.items():
        owner = found[_SURFACE] if outer else found
        index = part(told, "textureProperties", name)
        if isinstance(owner, dict) and member not in owner and isinstance(index, int):
            owner[member] = {"index": index} | _scale(told, name)
        if isinstance(owner, dict) and isinstance(owner.get(member), dict):
            owner[member] = {**owner[member], **placed}
    return found | {name: value for name, value in _opacity(told).items() if name not in core}


def _scale(told: Any, name: str) -> dict[str, float]:
    """Return the scale of a texture of normals."""
    scale = value_of(part(told, "floatProperties", "_BumpScale"), 1.0)
    return {} if name != "_BumpMap" or scale is None else {"scale": scale}


def _opacity(told: Any) -> dict[str, Any]:
    """Return opacity and culling."""
    found: dict[str, Any] = {}
    if part(told, "keywordMap", "_ALPHABLEND_ON") is True:
        found["alphaMode"] = "BLEND"
    elif part(told, "keywordMap", "_ALPHATEST_ON") is True:
        found["alphaMode"] = "MASK"
        cutoff = value_of(part(told, "floatProperties", "_Cutoff"), 0.5)
        found |= {} if cutoff is None else {"alphaCutoff": cutoff}
    if part(told, "floatProperties", "_CullMode") == _CULL_OFF:
        found["doubleSided"] = True
    return found
