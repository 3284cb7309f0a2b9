"""Materials of a glTF document, in the metallic-roughness model of its section 3.9.

Supported are all properties of the core specification, ``KHR_texture_transform``,
``KHR_materials_unlit``, ``KHR_materials_emissive_strength`` and ``EXT_texture_webp``. The archived
model ``KHR_materials_pbrSpecularGlossiness`` and VRM's toon materials are approximated; see
``glossiness.py`` and ``toon.py``. Other extensions are not drawn. Invalid members are ignored with
a warning, because the shape can still be shown.
"""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

from viewer.data_classes import dataclass
from viewer.formats._gltf.document import Document
from viewer.formats._gltf.elements import Element
from viewer.formats._gltf_materials.glossiness import Glossiness, from_glossiness, read_glossiness
from viewer.formats._gltf_materials.images import DecodedImage, decoding_images
from viewer.formats._gltf_materials.lenient import bounded, bounded_rows, chosen, lenient
from viewer.formats._gltf_materials.textures import Slot, read_slot
from viewer.formats._gltf_materials.toon import MTOON, Toon, read_toon
from viewer.rig.material import ALPHA_MODES, Material

__all__ = ["DEFAULT_MATERIAL", "DRAWN_EXTENSIONS", "reading_materials"]

_GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"

DRAWN_EXTENSIONS = (
    *("KHR_texture_transform", "KHR_materials_unlit", "KHR_materials_emissive_strength"),
    *("EXT_texture_webp", _GLOSSINESS, MTOON),
)
"""Extensions of materials and textures that have an effect."""

_WHITE = (1.0, 1.0, 1.0, 1.0)
_LARGEST = 1e6  # maximum factor; larger ones look the same, but their products could overflow
_FACTORED = (("normalTexture", "normal_texture"), ("occlusionTexture", "occlusion_texture"))
_MODES = {mode.upper(): mode for mode in ALPHA_MODES}
_NEUTRAL: dict[str, dict[str, Any]] = {
    "KHR_materials_anisotropy": {"anisotropyStrength": 0.0},
    "KHR_materials_clearcoat": {"clearcoatFactor": 0.0},
    "KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 0.0},
    "KHR_materials_dispersion": {"dispersion": 0.0},
    "KHR_materials_ior": {"ior": 1.5},
    "KHR_materials_iridescence": {"iridescenceFactor": 0.0},
    "KHR_materials_sheen": {"sheenColorFactor": [0.0, 0.0, 0.0]},
    "KHR_materials_specular": {
        "specularFactor": 1.0,
        "specularColorFactor": [1.0, 1.0, 1.0],
        "specularTexture": None,
        "specularColorTexture": None,
    },
    "KHR_materials_transmission": {"transmissionFactor": 0.0},
    "KHR_materials_volume": {"thicknessFactor": 0.0},
}
"""Defaults of extensions, which many exporters write although they have no effect."""

DEFAULT_MATERIAL = Material(
    base_color=_WHITE, metallic=1.0, roughness=1.0, double_sided=False, is_physical=True
)
"""Material of primitives without a material."""


@dataclass(frozen=True, slots=True, eq=False)
class _Stated:
    """Properties of one material in a document: values, and textures by field of ``Material``."""

    values: dict[str, Any]
    slots: dict[str, Slot]
    glossiness: Glossiness | None


@contextlib.contextmanager
def reading_materials(document: Document) -> Iterator[Callable[[], tuple[Material, ...]]]:
    """Read all materials; their images are decoded while the body of the ``with`` statement runs.

    Parameters
    ----------
    document : Document
        The opened file, which records warnings about everything that is invalid or not drawn.

    Yields
    ------
    callable
        Waits for the images, and returns the materials in file order. Textures that share an image
        share its pixels.
    """
    table = document.table("materials")
    neutral = Element(document.source, {})
    elements = [
        lenient(document.source, partial(table.__getitem__, index), neutral)
        for index in range(len(table))
    ]
    toon = read_toon(document, elements)
    stated = [_stated(document, each, toon.get(index)) for index, each in enumerate(elements)]
    _report(document, elements, stated)
    used = [slot for one in stated for slot in _slots(one)]

    def finish() -> tuple[Material, ...]:
        images = images_of()
        return tuple(_material(one, images) for one in stated)

    with decoding_images(document, (slot.image for slot in used if slot.image >= 0)) as images_of:
        yield finish


def _slots(stated: _Stated) -> list[Slot]:
    """Return all texture references of a material."""
    gloss = stated.glossiness
    more = [] if gloss is None else [gloss.diffuse_slot, gloss.specular_slot]
    return [slot for slot in (*stated.slots.values(), *more) if slot is not None]


def _stated(document: Document, element: Element, toon: Toon | None) -> _Stated:
    """Return the properties of a material; ``toon`` contains VRM's properties, if any."""
    source = document.source
    if toon is not None and toon.core is not None:
        element = toon.core
    surface = lenient(source, lambda: element.part("pbrMetallicRoughness"), None)
    glossiness = None
    if surface is None:
        # In files with both models, the core one has the same content and takes precedence.
        extension = lenient(source, lambda: element.extension(_GLOSSINESS), None)
        glossiness = None if extension is None else read_glossiness(document, extension)
        surface = Element(source, {}, element.at("pbrMetallicRoughness"))
    values = {
        "name": lenient(source, lambda: element.text("name"), ""),
        "base_color": bounded_rows(surface, "baseColorFactor", _WHITE),
        "metallic": bounded(surface, "metallicFactor", 1.0),
        "roughness": bounded(surface, "roughnessFactor", 1.0),
        "emissive": _emissive(element),
        "alpha_mode": _MODES[chosen(element, "alphaMode", tuple(_MODES), "OPAQUE")],
        "alpha_cutoff": bounded(element, "alphaCutoff", 0.5, 0.0, _LARGEST),
        "double_sided": lenient(source, lambda: element.flag("doubleSided"), False),
        "unlit": toon is not None
        or lenient(source, lambda: element.extension("KHR_materials_unlit"), None) is not None,
        "is_physical": True,
        "extras": element.values.get("extras"),
        **({} if toon is None else toon.values),
    }
    slots = {
        "base_texture": read_slot(document, surface, "baseColorTexture"),
        "metallic_texture": read_slot(document, surface, "metallicRoughnessTexture"),
        "normal_texture": read_slot(document, element, "normalTexture"),
        "occlusion_texture": read_slot(document, element, "occlusionTexture"),
        "emissive_texture": read_slot(document, element, "emissiveTexture"),
        **({} if toon is None else toon.slots),
    }
    normal, occlusion = (element.part(name) if slots[field] else None for name, field in _FACTORED)
    if normal is not None:
        values["normal_scale"] = bounded(normal, "scale", 1.0, -_LARGEST, _LARGEST)
    if occlusion is not None:
        values["occlusion_strength"] = bounded(occlusion, "strength", 1.0)
    return _Stated(values, {name: slot for name, slot in slots.items() if slot}, glossiness)


def _emissive(element: Element) -> tuple[float, ...]:
    """Return the emitted light: the factor times the strength."""
    extension = lenient(
        element.source, lambda: element.extension("KHR_materials_emissive_strength"), None
    )
    strength = 1.0
    if extension is not None:
        strength = bounded(extension, "emissiveStrength", 1.0, 0.0, _LARGEST)
    factor = bounded_rows(element, "emissiveFactor", (0.0, 0.0, 0.0))
    return tuple(strength * channel for channel in factor)


def _material(stated: _Stated, images: dict[int, DecodedImage]) -> Material:
    """Return a material with its textures: metallic in the blue channel, roughness in green."""
    textures = {name: slot.texture(images) for name, slot in stated.slots.items()}
    packed = textures.get("metallic_texture")
    if packed is not None:
        textures["metallic_texture"] = replace(packed, channel=2)
        textures["roughness_texture"] = replace(packed, channel=1)
    values = stated.values | {name: one for name, one in textures.items() if "." not in name}
    for name, texture in textures.items():
        owner, _, field = name.partition(".")
        if field:
            values[owner] = replace(values[owner], **{field: texture})
    if stated.glossiness is not None:
        values |= from_glossiness(stated.glossiness, images)
    return Material(**values)


def _report(document: Document, elements: list[Element], stated: list[_Stated]) -> None:
    """Report the extensions that are approximated or not drawn, each once."""
    source = document.source
    missing = Counter(name for element in elements for name in _not_drawn(element))
    for name, count in missing.items():
        source.warn("F007.gltf-not-drawn", "/materials", extension=name, n=count)
    approximated = sum(one.glossiness is not None for one in stated)
    if approximated:
        source.warn("F007.gltf-glossiness", "/materials", n=approximated)


def _not_drawn(element: Element) -> list[str]:
    """Return the extensions of a material that are not drawn."""
    extensions = lenient(element.source, lambda: element.part("extensions"), None)
    found = {} if extensions is None else extensions.values
    return [
        name
        for name, values in found.items()
        if name not in DRAWN_EXTENSIONS and not _is_neutral(name, values)
    ]


def _is_neutral(name: str, values: Any) -> bool:
    """Return whether the values of an extension have no effect."""
    if name not in _NEUTRAL or type(values) is not dict:
        return False
    return all(values.get(key, value) == value for key, value in _NEUTRAL[name].items())
