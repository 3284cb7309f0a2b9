"""Changes of materials by expressions of VRM, in the terms of version 1.0.

::

    VRM 0.x  materialValues: materialName, propertyName, targetValue of 4 numbers
    VRM 1.0  materialColorBinds: material, type, targetValue of 4 numbers
             textureTransformBinds: material, scale, offset

Colours of version 0.x are sRGB, except those of emission. ``_MainTex_ST`` has the scale and the
offset of texture coordinates whose origin is at the bottom; ``_MainTex_ST_S`` and ``_MainTex_ST_T``
change only one axis.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from viewer.formats._vrm.parts import is_index, listed, part, rows_of
from viewer.rig.arrays import Floats
from viewer.rig.expressions import COLOR_KINDS, TRANSFORM
from viewer.rig.srgb import decode_srgb

Bind = tuple[int, str, Floats]
"""Material, kind and target (4,), as in ``viewer.rig.material_binds.MaterialBinds``."""
_COLORS = {
    "_Color": "color",
    "_EmissionColor": "emissionColor",
    "_ShadeColor": "shadeColor",
    "_RimColor": "rimColor",
    "_OutlineColor": "outlineColor",
}
_LINEAR = "_EmissionColor"
_AXES = {"_MainTex_ST": (0, 1), "_MainTex_ST_S": (0,), "_MainTex_ST_T": (1,)}


def old_binds(told: Any, materials: list[Any]) -> tuple[list[Bind], list[str]]:
    """Return the changes by an expression of version 0.x, and labels of changes without effect.

    Parameters
    ----------
    told : Any
        A member of ``blendShapeGroups``, as parsed from JSON.
    materials : list
        ``materialProperties``, whose names the expression uses.
    """
    found: list[Bind] = []
    moves: dict[int, Floats] = {}
    lost: list[str] = []
    for each in listed(told, "materialValues"):
        name, value = part(each, "propertyName"), rows_of(part(each, "targetValue"), (0.0,) * 4)
        named = part(each, "materialName")
        owners = [n for n, material in enumerate(materials) if part(material, "name") == named]
        is_known = isinstance(name, str) and (name in _COLORS or name in _AXES)
        if value is None or not owners or not is_known:
            lost.append(f"{named} {name}")
            continue
        for owner in owners:
            if name in _COLORS:
                found.append((owner, _COLORS[name], _linear(name, value)))
                continue
            move = moves.setdefault(owner, main_transform(materials[owner]))
            for axis in _AXES[name]:
                scale, offset = float(value[axis]), float(value[2 + axis])
                move[[axis, 2 + axis]] = scale, 1.0 - offset - scale if axis else offset
    return found + [(owner, TRANSFORM, move) for owner, move in moves.items()], lost


def _linear(name: str, value: Floats) -> Floats:
    """Return a colour as linear values; its opacity is unchanged."""
    if name == _LINEAR:
        return value
    return np.append(decode_srgb(value[:3].clip(0.0, 1.0)), value[3])


def main_transform(properties: Any) -> Floats:
    """Return scale and offset of the texture coordinates of a material, origin at the top: (4,).

    ``properties``: a member of ``materialProperties``, as parsed from JSON.
    """
    value = rows_of(part(properties, "vectorProperties", "_MainTex"), (0.0, 0.0, 1.0, 1.0))
    x, y, width, height = (0.0, 0.0, 1.0, 1.0) if value is None else value.tolist()
    return np.array([width, height, x, 1.0 - y - height])


def modern_binds(told: Any, n_materials: int) -> tuple[list[Bind], list[str]]:
    """Return the changes by an expression of version 1.0, and labels of changes without effect.

    ``told``: the expression, as parsed from JSON.
    """
    found: list[Bind] = []
    lost: list[str] = []
    for each in listed(told, "materialColorBinds"):
        index, kind = part(each, "material"), part(each, "type")
        value = _color(part(each, "targetValue"))
        if is_index(index, n_materials) and kind in COLOR_KINDS and value is not None:
            found.append((index, kind, value))
        else:
            lost.append(f"{kind} of material {index}")
    for each in listed(told, "textureTransformBinds"):
        index = part(each, "material")
        scale = rows_of(part(each, "scale"), (1.0, 1.0))
        offset = rows_of(part(each, "offset"), (0.0, 0.0))
        if is_index(index, n_materials) and scale is not None and offset is not None:
            found.append((index, TRANSFORM, np.append(scale, offset)))
        else:
            lost.append(f"textures of material {index}")
    return found, lost


def _color(told: Any) -> Floats | None:
    """Return a colour of three or four numbers with its opacity; None if it is invalid."""
    if isinstance(told, list) and len(told) == 3:
        told = [*told, 1.0]
    return None if told is None else rows_of(told, (0.0,) * 4)
