"""Materials of a glTF document, in the metallic-roughness model of its section 3.9.

Supported are all properties of the core specification, ``KHR_texture_transform``,
``KHR_materials_unlit``, ``KHR_materials_emissive_strength`` and ``EXT_texture_webp``. The archived
model ``KHR_materials_pbrSpecularGlossiness`` is approximated, as derived below, and VRM's toon
materials by ``toon.py``. Other extensions are not drawn. Invalid members are ignored with a
warning, because the shape can still be shown.
"""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.formats.gltf.document import Document
from viewer.formats.gltf.elements import Element
from viewer.formats.gltf.textures import (
    DecodedImage,
    Slot,
    bounded,
    bounded_rows,
    chosen,
    decoding_images,
    lenient,
    read_slot,
)
from viewer.formats.gltf.toon import MTOON, Toon, read_toon
from viewer.phrases import counted
from viewer.rigs.arrays import Bytes
from viewer.rigs.file_record import Json
from viewer.rigs.material import ALPHA_MODES, Material
from viewer.rigs.srgb import decode_srgb, encode_srgb

_GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"
DRAWN_EXTENSIONS = (
    *("KHR_texture_transform", "KHR_materials_unlit", "KHR_materials_emissive_strength"),
    *("EXT_texture_webp", _GLOSSINESS, MTOON),
)
"""Extensions of materials and textures that have an effect."""
_WHITE = (1.0, 1.0, 1.0, 1.0)
_LARGEST = 1e6  # maximum factor; larger ones look the same, but their products could overflow

_DIELECTRIC = 0.04  # reflectance of dielectrics, D
_BRIGHTNESS = np.array([0.299, 0.587, 0.114], dtype=np.float32)
_ROWS = 256  # number of rows of an image that are converted together
_FACTORED = (("normalTexture", "normal_texture"), ("occlusionTexture", "occlusion_texture"))
_MODES = {mode.upper(): mode for mode in ALPHA_MODES}
_NEUTRAL: dict[str, Json] = {
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
_Reals = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class _Stated:
    """Properties of one material in a document: values, and textures by field of ``Material``."""

    values: Json
    slots: dict[str, Slot]
    glossiness: Glossiness | None


@dataclass(frozen=True, slots=True, eq=False)
class Glossiness:
    """A specular-glossiness surface: factors, and textures that they multiply."""

    diffuse: tuple[float, ...]
    specular: tuple[float, ...]
    glossiness: float
    diffuse_slot: Slot | None
    specular_slot: Slot | None


@contextlib.contextmanager
def reading_materials(document: Document) -> Iterator[Callable[[], tuple[Material, ...]]]:
    """Read all materials; images are decoded while the body of the ``with`` statement runs."""
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
        if extension is not None:
            glossiness = Glossiness(
                bounded_rows(extension, "diffuseFactor", (1.0, 1.0, 1.0, 1.0)),
                bounded_rows(extension, "specularFactor", (1.0, 1.0, 1.0)),
                bounded(extension, "glossinessFactor", 1.0),
                read_slot(document, extension, "diffuseTexture"),
                read_slot(document, extension, "specularGlossinessTexture"),
            )
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
        source.warn(
            "F007.gltf-not-drawn: {extension} not drawn ({n})",
            "/materials",
            extension=name,
            n=counted(count, "material"),
        )
    approximated = sum(one.glossiness is not None for one in stated)
    if approximated:
        source.warn(
            "F007.gltf-glossiness: KHR_materials_pbrSpecularGlossiness is approximated by "
            "metallic and roughness ({n})",
            "/materials",
            n=counted(approximated, "material"),
        )


def _not_drawn(element: Element) -> list[str]:
    """Return the extensions of a material that are not drawn."""
    extensions = lenient(element.source, lambda: element.part("extensions"), None)
    found = {} if extensions is None else extensions.values
    return [
        name
        for name, values in found.items()
        if name not in DRAWN_EXTENSIONS and not _is_neutral(name, values)
    ]


def _is_neutral(name: str, values: object) -> bool:
    """Return whether the values of an extension have no effect."""
    if name not in _NEUTRAL or type(values) is not dict:
        return False
    return all(values.get(key, value) == value for key, value in _NEUTRAL[name].items())


def from_glossiness(stated: Glossiness, images: dict[int, DecodedImage]) -> Json:
    """Return the fields of ``Material`` that describe the surface, with images by index."""
    specular = None if stated.specular_slot is None else stated.specular_slot.texture(images)
    diffuse = None if stated.diffuse_slot is None else stated.diffuse_slot.texture(images)
    if specular is None or specular.image is None:
        color = np.array(stated.diffuse[:3], dtype=np.float32)
        base, metallic = _metallic(color, np.array(stated.specular, dtype=np.float32))
        found: Json = {
            "base_color": (*base.tolist(), stated.diffuse[3]),
            "metallic": float(metallic),
            "roughness": 1.0 - stated.glossiness,
        }
        if diffuse is not None:
            found |= {"base_texture": diffuse, "base_color": stated.diffuse}
        return found
    base_image = None if diffuse is None else diffuse.image
    colors, rough = _converted(stated, base_image, specular.image)
    whole = diffuse if base_image is not None and diffuse is not None else specular
    packed = replace(specular, image=rough, encoded=None)
    return {
        "base_color": (1.0, 1.0, 1.0, 1.0),
        "base_texture": replace(whole, image=colors, encoded=None),
        "metallic": 1.0,
        "roughness": 1.0,
        "metallic_texture": replace(packed, channel=2),
        "roughness_texture": replace(packed, channel=1),
    }


def _converted(stated: Glossiness, diffuse: Bytes | None, specular: Bytes) -> tuple[Bytes, Bytes]:
    """Return images of the base colour, and of roughness (green) and metallic (blue)."""
    whole = specular if diffuse is None else diffuse
    height, width = whole.shape[:2]
    colors, packed = np.empty_like(whole), np.full_like(whole, 255)
    columns = np.arange(width) * specular.shape[1] // width
    linear = decode_srgb(np.arange(256) / 255.0).astype(np.float32)
    encoded = np.rint(255.0 * encode_srgb(np.arange(4096) / 4095.0)).astype(np.uint8)
    for first in range(0, height, _ROWS):
        rows = slice(first, min(first + _ROWS, height))
        lines = np.arange(rows.start, rows.stop) * specular.shape[0] // height
        mirrored = specular[lines[:, None], columns]
        painted = np.full_like(mirrored, 255) if diffuse is None else diffuse[rows]
        base, metallic = _metallic(
            linear[painted[..., :3]] * np.array(stated.diffuse[:3], dtype=np.float32),
            linear[mirrored[..., :3]] * np.array(stated.specular, dtype=np.float32),
        )
        colors[rows, :, :3] = encoded[np.rint(4095.0 * base).astype(np.int16)]
        colors[rows, :, 3] = np.rint(painted[..., 3] * stated.diffuse[3])
        packed[rows, :, 1] = np.rint(255.0 - stated.glossiness * mirrored[..., 3])
        packed[rows, :, 2] = np.rint(255.0 * metallic)
    return colors, packed


def _metallic(diffuse: _Reals, specular: _Reals) -> tuple[_Reals, _Reals]:
    """Return base colours, (..., 3), and metallic values, (...), of linear colours.

    A metallic surface with the reflectance D = 0.04 of dielectrics has, for a base colour B and a
    metallic value m, the diffuse colour (1 - m) B and the specular colour D + m (B - D). With the
    brightness d of the diffuse colour and s of the specular colour, where the diffuse colour is
    scaled by 1 - max(specular) as the extension does, m is the solution of

        D m² + (d (1 - max) / (1 - D) + s - 2 D) m + D - s = 0

    and 0 for s below D. The base colour follows from the diffuse colour for dielectrics, and from
    the specular colour for metals.
    """
    strongest = specular.max(axis=-1)
    kept = (1.0 - strongest) / (1.0 - _DIELECTRIC)
    d, s = np.sqrt(diffuse**2 @ _BRIGHTNESS), np.sqrt(specular**2 @ _BRIGHTNESS)
    half = 0.5 * (d * kept + s - 2.0 * _DIELECTRIC)
    root = np.sqrt(np.maximum(half * half - _DIELECTRIC * (_DIELECTRIC - s), 0.0))
    metallic = np.where(s < _DIELECTRIC, 0.0, np.clip((root - half) / _DIELECTRIC, 0.0, 1.0))
    m = metallic[..., None]
    of_diffuse = diffuse * kept[..., None] / np.maximum(1.0 - m, 1e-6)
    of_specular = (specular - _DIELECTRIC * (1.0 - m)) / np.maximum(m, 1e-6)
    base = np.clip(of_diffuse + m * m * (of_specular - of_diffuse), 0.0, 1.0)
    return base.astype(np.float32), metallic.astype(np.float32)
