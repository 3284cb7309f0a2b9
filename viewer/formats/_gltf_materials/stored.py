"""Textures and toon shading as listed in a VRM file, for writing them back."""

from __future__ import annotations

from typing import Any

from viewer.errors import FormatError
from viewer.formats._gltf.document import Document
from viewer.formats._gltf_materials.toon import MTOON
from viewer.rig.file_record import StoredImage, StoredTextures

__all__ = ["stored_textures", "stored_toon"]

_KEPT = (MTOON, "KHR_materials_unlit")


def stored_toon(document: Document) -> dict[int, Any]:
    """Return the toon and unlit extensions of the materials, by index, as parsed from JSON."""
    found = {}
    for index, material in enumerate(_listed(document, "materials")):
        extensions = material.get("extensions") if isinstance(material, dict) else None
        given = extensions if isinstance(extensions, dict) else {}
        found[index] = {name: given[name] for name in _KEPT if isinstance(given.get(name), dict)}
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

    textures, samplers = (_listed(document, name) for name in ("textures", "samplers"))
    return StoredTextures(tuple(textures), tuple(samplers), image)


def _listed(document: Document, name: str) -> list[Any]:
    found = document.root.values.get(name)
    return found if isinstance(found, list) else []
