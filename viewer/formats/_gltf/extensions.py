"""Supported extensions of glTF, and messages about others."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from viewer.formats._gltf.document import Document
from viewer.formats._gltf_materials.materials import DRAWN_EXTENSIONS
from viewer.formats._nodes.ancestors import descendants
from viewer.formats._nodes.content import NodeTree

__all__ = ["KEPT_EXTENSIONS", "check_extensions", "hidden_nodes"]

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
    "VRMC_springBone_extended_collider",
    "VRMC_vrm",
    "VRMC_vrm_animation",
)
# The readers of materials and textures list their own extensions.
_ABOUT = re.compile(r"[A-Z]+_(materials|texture)_")
# Lights are counted below, and hidden nodes by ``hidden_nodes``.
_WITHOUT_EFFECT = ("KHR_lights_punctual", "KHR_xmp_json_ld")
VISIBILITY = "KHR_node_visibility"
"""Extension of nodes that are not drawn."""

# Without these, a file has the same surfaces and motions, although it may look or sound different.
_LOOK = re.compile(r"[A-Z]+_(materials|texture|lights|image)_")
_LOOKS = ("FB_ngon_encoding", "KHR_audio", "KHR_audio_emitter", "KHR_xmp", "MSFT_lod")

KEPT_EXTENSIONS = frozenset((*_GEOMETRY, *DRAWN_EXTENSIONS, *_CHARACTERS))
"""Extensions whose effect is written back, although not always in the same form."""

_KNOWN = KEPT_EXTENSIONS | {*_WITHOUT_EFFECT, VISIBILITY}
"""Extensions that are read, or have no visible effect."""


def check_extensions(document: Document) -> None:
    """Refuse a document that needs an unknown extension; report other unknown ones once.

    Raises
    ------
    FormatError
        If an unknown extension is required that may change surfaces or motions.
    """
    required = [name for name in _names(document, "extensionsRequired") if name not in _KNOWN]
    unknown = [name for name in required if not _changes_only_look(name)]
    pointer = document.root.at("extensionsRequired")
    if unknown:
        document.source.refuse("F002.gltf-extensions", pointer, names=unknown)
    looks = [name for name in required if name not in unknown]
    if looks:
        document.source.warn("F007.gltf-look", pointer, names=looks, n=len(looks))
    optional = [name for name in _names(document, "extensionsUsed") if name not in _KNOWN]
    optional = [name for name in optional if name not in required and not _ABOUT.match(name)]
    if optional:
        document.root.warn("F007.gltf-extensions", "extensionsUsed", names=optional)
    lights = document.root.extension("KHR_lights_punctual")
    if lights is not None and len(lights.table("lights")):
        document.root.warn("F007.gltf-lights", "extensions", n=len(lights.table("lights")))


def _changes_only_look(name: str) -> bool:
    return name in _LOOKS or _LOOK.match(name) is not None


def hidden_nodes(document: Document, tree: NodeTree) -> list[int]:
    """Return the nodes that ``KHR_node_visibility`` hides with everything below them."""
    extensions = tree.extensions
    stated = [
        node
        for node, told in extensions.items()
        if isinstance(told, dict)
        and isinstance(found := told.get(VISIBILITY), dict)
        and found.get("visible") is False
    ]
    if not stated:
        return []
    hidden = np.zeros(tree.n_nodes, dtype=np.bool_)
    for node in stated:
        hidden |= descendants(tree.parents, node)
    drawn = np.flatnonzero(hidden & (tree.meshes >= 0)).tolist()
    if drawn:
        names = [tree.names[node] or f"node {node}" for node in drawn]
        document.source.warn("F007.gltf-hidden", "/nodes", n=len(drawn), names=names)
    return drawn


def _names(document: Document, member: str) -> list[str]:
    items: Any = document.root.values.get(member, [])
    if type(items) is not list or set(map(type, items)) - {str}:
        raise document.root.wrong(member, "a list of names")
    return list(dict.fromkeys(items))
