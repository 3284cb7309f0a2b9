"""Toon materials of VRM characters: lit and shade colour, rim light, outline.

::

    VRM 1.0  materials[i].extensions.VRMC_materials_mtoon: shadeColorFactor, shadeMultiplyTexture,
             shadingToonyFactor, shadingShiftFactor; parametricRim…, rim…, matcap…; outline…
    VRM 0.x  extensions.VRM.materialProperties[i].shader: "VRM/MToon", "VRM/UnlitTexture", …;
             vectorProperties._ShadeColor (sRGB), textureProperties._ShadeTexture,
             floatProperties._ShadeToony, ._ShadeShift, …, which are translated to version 1.0

Exporters also write the lit side's base colour, texture and opacity to the core material; those of
version 0.x are replaced by ``_vrm/materials.py``. With the cosine c of the angle of incidence, the
fraction of the lit colour rises linearly from 0 to 1 between c = toony - 1 - shift and
c = 1 - toony - shift.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from typing import Any

from viewer.data_classes import dataclass
from viewer.errors import FormatError
from viewer.formats._vrm.materials import modern_toon, overridden
from viewer.formats._vrm.parts import list_in, part, rows_of, value_of
from viewer.formats.gltf.document import Document
from viewer.formats.gltf.elements import Element
from viewer.formats.gltf.textures import Slot, read_slot
from viewer.phrases import Shown, counted, listed
from viewer.rigs.file_record import Json, StoredImage, StoredTextures
from viewer.rigs.material import Outline, OutlineMode, Rim

MTOON = "VRMC_materials_mtoon"
_SHADER = "VRM/MToon"
_UNLIT = "VRM/Unlit"

_KEPT = (MTOON, "KHR_materials_unlit")
_TOONY = 0.9
_LARGEST = 1e4
_MODES: dict[str, OutlineMode] = {"worldCoordinates": "world", "screenCoordinates": "screen"}
_SLOTS = {
    "shade_texture": "shadeMultiplyTexture",
    "rim.texture": "rimMultiplyTexture",
    "rim.matcap": "matcapTexture",
    "outline.texture": "outlineWidthMultiplyTexture",
}

# Members that are not drawn, with the value that has no effect.
_NOT_DRAWN = {
    "uvAnimationScrollXSpeedFactor": 0.0,
    "uvAnimationScrollYSpeedFactor": 0.0,
    "uvAnimationRotationSpeedFactor": 0.0,
    "shadingShiftTexture": None,
    "transparentWithZWrite": False,
    "renderQueueOffsetNumber": 0,
}


@dataclass(frozen=True, slots=True, eq=False)
class Toon:
    """Shading of a material that VRM declares toon-shaded or unlit."""

    values: Json = field(default_factory=dict)
    """Fields of ``Material``."""
    slots: Mapping[str, Slot] = field(default_factory=dict)
    """Textures by field of ``Material``, or by fields of its rim light and outline:
    ``"rim.texture"``."""
    core: Element | None = None
    """The core material with the members that VRM 0.x adds; None if it adds none."""


def read_toon(document: Document, elements: list[Element]) -> dict[int, Toon]:
    """Return the shading of materials that VRM declares toon-shaded or unlit, by index."""
    found: dict[int, Toon] = {}
    omitted: dict[str, None] = {}
    upgraded = part(document.root.values, "extensions", "VRM", "materialProperties")
    for index, each in enumerate(upgraded[: len(elements)] if isinstance(upgraded, list) else ()):
        shader, pointer = part(each, "shader"), elements[index].pointer
        if shader != _SHADER and not (isinstance(shader, str) and shader.startswith(_UNLIT)):
            continue
        found[index] = Toon()
        if shader == _SHADER:
            told, lost = modern_toon(each)
            found[index] = _toon(document, Element(document.source, told, pointer))
            omitted |= dict.fromkeys([*lost, *_omitted(told)])
        core = overridden(elements[index].values, each)
        found[index] = replace(found[index], core=Element(document.source, core, pointer))
    for index, element in enumerate(elements):
        modern = part(element.values, "extensions", MTOON)
        if isinstance(modern, dict):
            pointer = element.at("extensions", MTOON)
            found[index] = _toon(document, Element(document.source, modern, pointer))
            omitted |= dict.fromkeys(_omitted(modern))
    count = sum(bool(toon.values) for toon in found.values())
    if count:
        document.source.warn(
            "F007.gltf-toon: {n} lit by the white key light only{names}",
            "/materials",
            n=counted(count, "toon material", "is", "are"),
            names=Shown(f"; not drawn: {listed([*omitted])}" if omitted else "", [*omitted]),
        )
    return found


def _omitted(told: Json) -> list[str]:
    """Return the members with an effect that is not drawn."""
    return [name for name, idle in _NOT_DRAWN.items() if told.get(name, idle) != idle]


def _toon(document: Document, element: Element) -> Toon:
    """Return the toon shading of version 1.0; an invalid shade colour means no shade."""
    told = element.values
    toony = value_of(told.get("shadingToonyFactor"), _TOONY)
    shift = value_of(told.get("shadingShiftFactor"), 0.0)
    toony = _TOONY if toony is None else min(max(toony, 0.0), 1.0)
    shift = 0.0 if shift is None else shift
    color = rows_of(told.get("shadeColorFactor"), (0.0, 0.0, 0.0))
    slots = {field: read_slot(document, element, name) for field, name in _SLOTS.items()}
    outline = _outline(told)
    values = {
        "shade_color": (1.0, 1.0, 1.0) if color is None else tuple(color.clip(0.0, 1.0).tolist()),
        "shade_range": (toony - 1.0 - shift, 1.0 - toony - shift),
        "rim": _rim(told),
        "outline": outline,
    }
    used = {name: slot for name, slot in slots.items() if slot is not None}
    if outline is None:
        used.pop("outline.texture", None)
    return Toon(values, used)


def _rim(told: Json) -> Rim:
    """Return the rim light; invalid values are replaced by the extension's defaults."""

    def color(name: str, default: tuple[float, float, float]) -> Any:
        value = rows_of(told.get(name), default)
        return default if value is None else tuple(value.clip(0.0, _LARGEST).tolist())

    def number(name: str, default: float, low: float, high: float) -> float:
        value = value_of(told.get(name), default)
        return default if value is None else min(max(value, low), high)

    return Rim(
        color=color("parametricRimColorFactor", (0.0, 0.0, 0.0)),
        power=number("parametricRimFresnelPowerFactor", 5.0, 0.0, _LARGEST),
        lift=number("parametricRimLiftFactor", 0.0, -_LARGEST, _LARGEST),
        mix=number("rimLightingMixFactor", 1.0, 0.0, 1.0),
        matcap_factor=color("matcapFactor", (1.0, 1.0, 1.0)),
    )


def _outline(told: Json) -> Outline | None:
    """Return the outline; None if there is none."""
    mode = _MODES.get(str(told.get("outlineWidthMode")))
    width = value_of(told.get("outlineWidthFactor"), 0.0)
    if mode is None or width is None or width <= 0.0:
        return None
    color = rows_of(told.get("outlineColorFactor"), (0.0, 0.0, 0.0))
    mix = value_of(told.get("outlineLightingMixFactor"), 1.0)
    r, g, b = (0.0, 0.0, 0.0) if color is None else color.clip(0.0, 1.0).tolist()
    return Outline(width, mode, (r, g, b), 1.0 if mix is None else min(max(mix, 0.0), 1.0))


def stored_toon(document: Document) -> dict[int, Json]:
    """Return the toon and unlit extensions of the materials, by index, as parsed from JSON."""
    found = {}
    for index, material in enumerate(list_in(document.root.values, "materials")):
        given = part(material, "extensions")
        kept = {name: part(given, name) for name in _KEPT}
        found[index] = {name: told for name, told in kept.items() if isinstance(told, dict)}
    return found


def stored_textures(document: Document) -> StoredTextures:
    """Return the textures of a document; their images are read on demand."""

    def image(index: int) -> StoredImage | None:
        if not 0 <= index < document.buffers.n_images:
            return None
        try:
            found = document.buffers.image(index)
        except FormatError:
            return None
        return StoredImage(found.name, found.data)

    textures, samplers = (list_in(document.root.values, name) for name in ("textures", "samplers"))
    return StoredTextures(tuple(textures), tuple(samplers), image)
