"""Toon materials of VRM characters, which are drawn unlit in the colour of their lit side.

::

    VRM 1.0  materials[i].extensions.VRMC_materials_mtoon
    VRM 0.x  extensions.VRM.materialProperties[i].shader: "VRM/MToon", "VRM/UnlitTexture", …

Exporters also write the lit side's base colour, texture and opacity to the core material.
"""

from __future__ import annotations

from typing import Any

from viewer.formats._gltf.document import Document
from viewer.formats._gltf.elements import Element

__all__ = ["MTOON", "unlit_by_vrm"]

MTOON = "VRMC_materials_mtoon"
_SHADER = "VRM/MToon"
_UNLIT = "VRM/Unlit"


def unlit_by_vrm(document: Document, elements: list[Element]) -> frozenset[int]:
    """Return the materials that VRM declares toon-shaded or unlit; report toon shading.

    Parameters
    ----------
    document : Document
        The opened file, which records a note.
    elements : list of Element
        Its materials.
    """
    told = _member(_member(document.root.values, "extensions"), "VRM")
    listed = _member(told, "materialProperties")
    shaders = [_member(each, "shader") for each in listed] if isinstance(listed, list) else []
    named = [shader if isinstance(shader, str) else "" for shader in shaders[: len(elements)]]
    toon = {index for index, shader in enumerate(named) if shader == _SHADER}
    for index, element in enumerate(elements):
        if isinstance(_member(_member(element.values, "extensions"), MTOON), dict):
            toon.add(index)
    if toon:
        document.source.warn("F007.gltf-toon", "/materials", n=len(toon))
    return frozenset(toon | {i for i, shader in enumerate(named) if shader.startswith(_UNLIT)})


def _member(value: Any, name: str) -> Any:
    """Return a member of parsed JSON; None if it is missing or not in an object."""
    return value.get(name) if isinstance(value, dict) else None
