"""Specular-glossiness materials of glTF, approximated by metallic and roughness.

KHR_materials_pbrSpecularGlossiness describes a surface by its diffuse and its specular colour. A
metallic surface with the reflectance D = 0.04 of dielectrics has, for a base colour B and a
metallic value m, the diffuse colour (1 - m) B and the specular colour D + m (B - D). With the
brightness d of the diffuse colour and s of the specular colour, where the diffuse colour is
scaled by 1 - max(specular) as the extension does, m is the solution of

    D m² + (d (1 - max) / (1 - D) + s - 2 D) m + D - s = 0

and 0 for s below D. The base colour follows from the diffuse colour for dielectrics, and from the
specular colour for metals.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.formats._gltf.document import Document
from viewer.formats._gltf.elements import Element
from viewer.formats._gltf_materials.images import DecodedImage
from viewer.formats._gltf_materials.lenient import bounded, bounded_rows
from viewer.formats._gltf_materials.textures import Slot, read_slot
from viewer.rig.arrays import Bytes
from viewer.rig.srgb import decode_srgb, encode_srgb

__all__ = ["Glossiness", "from_glossiness", "read_glossiness"]

_DIELECTRIC = 0.04
_BRIGHTNESS = np.array([0.299, 0.587, 0.114], dtype=np.float32)
_ROWS = 256  # number of rows of an image that are converted together

Reals = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class Glossiness:
    """A specular-glossiness surface: factors, and textures that they multiply."""

    diffuse: tuple[float, ...]
    specular: tuple[float, ...]
    glossiness: float
    diffuse_slot: Slot | None
    specular_slot: Slot | None


def read_glossiness(document: Document, element: Element) -> Glossiness:
    """Return the factors and textures of the extension."""
    return Glossiness(
        bounded_rows(element, "diffuseFactor", (1.0, 1.0, 1.0, 1.0)),
        bounded_rows(element, "specularFactor", (1.0, 1.0, 1.0)),
        bounded(element, "glossinessFactor", 1.0),
        read_slot(document, element, "diffuseTexture"),
        read_slot(document, element, "specularGlossinessTexture"),
    )


def from_glossiness(stated: Glossiness, images: dict[int, DecodedImage]) -> dict[str, Any]:
    """Return the fields of ``Material`` that describe the surface.

    Parameters
    ----------
    stated : Glossiness
        Factors and textures.
    images : dict
        Images by index.
    """
    specular = None if stated.specular_slot is None else stated.specular_slot.texture(images)
    diffuse = None if stated.diffuse_slot is None else stated.diffuse_slot.texture(images)
    if specular is None or specular.image is None:
        color = np.array(stated.diffuse[:3], dtype=np.float32)
        base, metallic = _metallic(color, np.array(stated.specular, dtype=np.float32))
        found: dict[str, Any] = {
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
    """Return images of the base colour, and of roughness (green) and metallic (blue).

    Both have the size of the diffuse image or, if there is none, of the specular image.
    """
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


def _metallic(diffuse: Reals, specular: Reals) -> tuple[Reals, Reals]:
    """Return base colours, (..., 3), and metallic values, (...), of linear colours."""
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
