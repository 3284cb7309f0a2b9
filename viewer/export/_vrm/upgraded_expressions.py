"""Expressions of VRM 0.x as those of VRM 1.0.

::

    blendShapeGroups  name, presetName, isBinary, binds (mesh, index, weight in percent),
                      materialValues (materialName, propertyName, targetValue of 4 numbers)

Colours are sRGB, except those of emission. ``_MainTex_ST`` has the scale and the offset of texture
coordinates whose origin is at the bottom; ``_MainTex_ST_S`` and ``_MainTex_ST_T`` change only one
axis.
"""

from __future__ import annotations

from typing import Any

from viewer.export._vrm.upgraded_toon import main_transform
from viewer.formats._vrm.json_parts import listed, part
from viewer.formats._vrm.material_values import COLORS, linear_color
from viewer.formats._vrm.numbers import rows_of
from viewer.rig.file_record import VrmRecord

__all__ = ["upgraded_expressions"]

_PERCENT = 100.0
_PRESETS = {
    **{"neutral": "neutral", "joy": "happy", "angry": "angry", "sorrow": "sad", "fun": "relaxed"},
    **{"a": "aa", "i": "ih", "u": "ou", "e": "ee", "o": "oh"},
    **{"blink": "blink", "blink_l": "blinkLeft", "blink_r": "blinkRight"},
    **{f"look{way.lower()}": f"look{way}" for way in ("Up", "Down", "Left", "Right")},
}
_AXES = {"_MainTex_ST": (0, 1), "_MainTex_ST_S": (0,), "_MainTex_ST_T": (1,)}


def upgraded_expressions(told: Any, record: VrmRecord, lost: list[str]) -> dict[str, Any]:
    """Return the preset and custom expressions; a further one of a preset becomes a custom one.

    ``told``: the extension ``VRM``.
    ``lost``: extended by the material values without a counterpart.
    """
    found: dict[str, dict[str, Any]] = {"preset": {}, "custom": {}}
    materials = listed(told, "materialProperties")
    for each in listed(told, "blendShapeMaster", "blendShapeGroups"):
        if not isinstance(each, dict):
            continue
        expression: dict[str, Any] = {"isBinary": each.get("isBinary") is True}
        binds = _binds(each, record)
        expression |= {"morphTargetBinds": binds} if binds else {}
        expression |= _material_binds(each, materials, lost)
        preset = _PRESETS.get(str(each.get("presetName", "")).lower(), "")
        if preset and preset not in found["preset"]:
            found["preset"][preset] = expression
        else:
            found["custom"][_free(str(each.get("name") or "unnamed"), found)] = expression
    return {kind: listed for kind, listed in found.items() if listed}


def _free(name: str, found: dict[str, dict[str, Any]]) -> str:
    """Return a name that no expression has."""
    taken, number, free = {*found["preset"], *found["custom"]}, 1, name
    while free in taken:
        number += 1
        free = f"{name} {number}"
    return free


def _binds(told: dict[str, Any], record: VrmRecord) -> list[Any]:
    """Return the binds of nodes from those of meshes."""
    return [
        {"node": node, "index": part(each, "index"), "weight": float(weight) / _PERCENT}
        for each in listed(told, "binds")
        if isinstance(weight := part(each, "weight"), int | float)
        for node, mesh in record.meshes.items()
        if mesh == part(each, "mesh")
    ]


def _material_binds(told: dict[str, Any], materials: list[Any], lost: list[str]) -> dict[str, Any]:
    """Return the binds of colours and of texture transforms."""
    colors, moves = list[Any](), dict[int, Any]()
    for each in listed(told, "materialValues"):
        name, value = part(each, "propertyName"), rows_of(part(each, "targetValue"), (0.0,) * 4)
        named = part(each, "materialName")
        owners = [n for n, material in enumerate(materials) if part(material, "name") == named]
        if value is None or not owners or (name not in COLORS and name not in _AXES):
            lost.append(f"materialValues {named} {name}")
            continue
        for owner in owners:
            if name in COLORS:
                target = linear_color(name, value).tolist()
                kind = COLORS[name]
                colors.append({"material": owner, "type": kind, "targetValue": target})
                continue
            move = moves.setdefault(owner, main_transform(materials[owner]))
            for axis in _AXES[name]:
                scale, offset = float(value[axis]), float(value[2 + axis])
                move["scale"][axis] = scale
                move["offset"][axis] = 1.0 - offset - scale if axis else offset
    found: dict[str, Any] = {"materialColorBinds": colors} if colors else {}
    if moves:
        found["textureTransformBinds"] = [{"material": n, **move} for n, move in moves.items()]
    return found
