"""Toon materials of VRM characters: the colours of the lit side and of the side in shade.

::

    VRM 1.0  materials[i].extensions.VRMC_materials_mtoon: shadeColorFactor, shadeMultiplyTexture,
             shadingToonyFactor, shadingShiftFactor
    VRM 0.x  extensions.VRM.materialProperties[i].shader: "VRM/MToon", "VRM/UnlitTexture", …;
             vectorProperties._ShadeColor (sRGB), textureProperties._ShadeTexture,
             floatProperties._ShadeToony, ._ShadeShift

Exporters also write the lit side's base colour, texture and opacity to the core material. With the
cosine c of the angle of incidence, the fraction of the lit colour rises linearly from 0 to 1
between c = toony - 1 - shift and c = 1 - toony - shift.
"""

from __future__ import annotations

from dataclasses import field
from typing import Any

from viewer.data_classes import dataclass
from viewer.formats._gltf.document import Document
from viewer.formats._gltf.elements import Element
from viewer.formats._gltf_materials.textures import Slot, read_slot
from viewer.formats._vrm.numbers import rows_of, value_of
from viewer.formats._vrm.toon_ramp import modern_ramp
from viewer.rig.srgb import decode_srgb

__all__ = ["MTOON", "Toon", "read_toon"]

MTOON = "VRMC_materials_mtoon"
_SHADER = "VRM/MToon"
_UNLIT = "VRM/Unlit"
_OLD_COLOR = (0.97, 0.81, 0.86, 1.0)
_TOONY = 0.9


@dataclass(frozen=True, slots=True, eq=False)
class Toon:
    """Shading of a material that VRM declares toon-shaded or unlit.

    Attributes
    ----------
    values : dict
        Fields of ``Material``.
    shade : Slot or None
        Texture that multiplies the colour in shade.
    """

    values: dict[str, Any] = field(default_factory=dict)
    shade: Slot | None = None


def read_toon(document: Document, elements: list[Element]) -> dict[int, Toon]:
    """Return the shading of materials that VRM declares toon-shaded or unlit, by index.

    Parameters
    ----------
    document : Document
        The opened file, which records a note.
    elements : list of Element
        Its materials.
    """
    found: dict[int, Toon] = {}
    told = _member(_member(document.root.values, "extensions"), "VRM")
    listed = _member(told, "materialProperties")
    for index, each in enumerate(listed[: len(elements)] if isinstance(listed, list) else ()):
        shader = _member(each, "shader")
        if shader == _SHADER:
            found[index] = _old_toon(document, each, elements[index])
        elif isinstance(shader, str) and shader.startswith(_UNLIT):
            found[index] = Toon()
    for index, element in enumerate(elements):
        modern = _member(_member(element.values, "extensions"), MTOON)
        if isinstance(modern, dict):
            pointer = element.at("extensions", MTOON)
            found[index] = _toon(document, Element(document.source, modern, pointer))
    count = sum(bool(toon.values) for toon in found.values())
    if count:
        document.source.warn("F007.gltf-toon", "/materials", n=count)
    return found


def _toon(document: Document, element: Element) -> Toon:
    """Return the toon shading of version 1.0."""
    told = element.values
    toony, shift = told.get("shadingToonyFactor"), told.get("shadingShiftFactor")
    color = rows_of(told.get("shadeColorFactor"), (0.0, 0.0, 0.0))
    values = _values(color, value_of(toony, _TOONY), value_of(shift, 0.0))
    return Toon(values, read_slot(document, element, "shadeMultiplyTexture"))


def _old_toon(document: Document, told: Any, element: Element) -> Toon:
    """Return the toon shading of version 0.x, whose thresholds are converted to version 1.0."""
    color = rows_of(_member(_member(told, "vectorProperties"), "_ShadeColor"), _OLD_COLOR)
    numbers = _member(told, "floatProperties")
    toony = value_of(_member(numbers, "_ShadeToony"), _TOONY)
    shift = value_of(_member(numbers, "_ShadeShift"), 0.0)
    texture = _member(_member(told, "textureProperties"), "_ShadeTexture")
    shade = None
    if isinstance(texture, int):
        named = Element(document.source, {"shade": {"index": texture}}, element.pointer)
        shade = read_slot(document, named, "shade")
    if color is not None:
        color = decode_srgb(color[:3].clip(0.0, 1.0))
    if toony is not None and shift is not None:
        toony, shift = modern_ramp(toony, shift)
    return Toon(_values(color, toony, shift), shade)


def _values(color: Any, toony: float | None, shift: float | None) -> dict[str, Any]:
    """Return the fields of a material; invalid values are replaced so that there is no shade."""
    toony = _TOONY if toony is None else min(max(toony, 0.0), 1.0)
    shift = 0.0 if shift is None else shift
    shade = (1.0, 1.0, 1.0) if color is None else tuple(min(max(c, 0.0), 1.0) for c in color)
    return {"shade_color": shade, "shade_range": (toony - 1.0 - shift, 1.0 - toony - shift)}


def _member(value: Any, name: str) -> Any:
    """Return a member of parsed JSON; None if it is missing or not in an object."""
    return value.get(name) if isinstance(value, dict) else None
