"""Expressions of VRM 0.x as those of VRM 1.0.

::

    blendShapeGroups  name, presetName, isBinary, binds (mesh, index, weight in percent),
                      materialValues, see ``viewer.formats._vrm.material_values``
"""

from __future__ import annotations

from typing import Any

from viewer.formats._vrm.json_parts import listed, part
from viewer.formats._vrm.material_values import old_binds
from viewer.formats._vrm.numbers import value_of
from viewer.rig.expressions import OLD_PRESETS
from viewer.rig.file_record import VrmRecord
from viewer.rig.material_binds import TRANSFORM

__all__ = ["upgraded_expressions"]

_PERCENT = 100.0


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
        preset = OLD_PRESETS.get(str(each.get("presetName", "")).lower(), "")
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
        {"node": node, "index": part(each, "index"), "weight": weight / _PERCENT}
        for each in listed(told, "binds")
        if (weight := value_of(part(each, "weight"), 0.0)) is not None
        for node, mesh in record.meshes.items()
        if mesh == part(each, "mesh")
    ]


def _material_binds(told: dict[str, Any], materials: list[Any], lost: list[str]) -> dict[str, Any]:
    """Return the binds of colours and of texture transforms."""
    binds, unknown = old_binds(told, materials)
    lost += [f"materialValues {each}" for each in unknown]
    colors = [
        {"material": owner, "type": kind, "targetValue": value.tolist()}
        for owner, kind, value in binds
        if kind != TRANSFORM
    ]
    moves = [
        {"material": owner, "scale": value[:2].tolist(), "offset": value[2:].tolist()}
        for owner, kind, value in binds
        if kind == TRANSFORM
    ]
    named = {"materialColorBinds": colors, "textureTransformBinds": moves}
    return {name: rows for name, rows in named.items() if rows}
