"""Supported extensions of glTF, and messages about others."""

from __future__ import annotations

import re
from typing import Any

from viewer.formats._gltf.document import Document
from viewer.formats._gltf_materials.materials import DRAWN_EXTENSIONS

__all__ = ["KEPT_EXTENSIONS", "check_extensions"]

_GEOMETRY = (
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "EXT_meshopt_compression",
)
"""Extensions of geometry and animation."""

_CHARACTERS = (
    "VRM",
    "VRMC_node_constraint",
    "VRMC_springBone",
    "VRMC_vrm",
    "VRMC_vrm_animation",
)
# The readers of materials and textures list their own extensions.
_ABOUT = re.compile(r"[A-Z]+_(materials|texture)_")
_WITHOUT_EFFECT = ("KHR_lights_punctual", "KHR_xmp_json_ld")

KEPT_EXTENSIONS = frozenset((*_GEOMETRY, *DRAWN_EXTENSIONS, *_CHARACTERS))
"""Extensions whose effect is written back, although not always in the same form."""

_KNOWN = KEPT_EXTENSIONS | {*_WITHOUT_EFFECT}
"""Extensions that a file may require."""


def check_extensions(document: Document) -> None:
    """Refuse a document that requires an unknown extension; report unknown optional ones once.

    Raises
    ------
    FormatError
        If an unknown extension is required.
    """
    required = _names(document, "extensionsRequired")
    unknown = [name for name in required if name not in _KNOWN]
    if unknown:
        pointer = document.root.at("extensionsRequired")
        document.source.refuse("F002.gltf-extensions", pointer, names=unknown)
    optional = [name for name in _names(document, "extensionsUsed") if name not in _KNOWN]
    optional = [name for name in optional if name not in unknown and not _ABOUT.match(name)]
    if optional:
        document.root.warn("F007.gltf-extensions", "extensionsUsed", names=optional)
    lights = document.root.extension("KHR_lights_punctual")
    if lights is not None and len(lights.table("lights")):
        document.root.warn("F007.gltf-lights", "extensions", n=len(lights.table("lights")))


def _names(document: Document, member: str) -> list[str]:
    items: Any = document.root.values.get(member, [])
    if type(items) is not list or set(map(type, items)) - {str}:
        raise document.root.wrong(member, "a list of names")
    return list(dict.fromkeys(items))
