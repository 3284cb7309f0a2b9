"""Parts that are drawn only from the character's eyes, or only from outside."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from viewer.formats._nodes.content import NodeFile
from viewer.formats._source import Source
from viewer.formats._vrm.json_parts import is_index, part
from viewer.rig.mesh import PartView

__all__ = ["read_part_views"]

_VIEWS: dict[str, PartView] = {
    "auto": "auto",
    "both": "both",
    "thirdpersononly": "third-person",
    "firstpersononly": "first-person",
}


def read_part_views(
    file: NodeFile, told: Mapping[str, Any], version: int, pointer: str, source: Source
) -> dict[int, PartView]:
    """Return the view in which each annotated node's mesh is drawn.

    Parameters
    ----------
    file : NodeFile
        Nodes and meshes.
    told : mapping
        The VRM extension.
    version : int
        0 annotates meshes (``firstPersonFlag: "FirstPersonOnly"``), 1 nodes
        (``type: "firstPersonOnly"``).
    pointer : str
        JSON pointer to the extension.
    source : Source
        Records messages about invalid annotations, which are ignored.
    """
    listed = part(told, "firstPerson", "meshAnnotations")
    found: dict[int, PartView] = {}
    for index, each in enumerate(listed if isinstance(listed, list) else ()):
        view = part(each, "firstPersonFlag" if version == 0 else "type")
        known = _VIEWS.get(view.lower()) if isinstance(view, str) else None
        nodes = _nodes(file, each, version)
        if known is None or not nodes:
            at = f"{pointer}/firstPerson/meshAnnotations/{index}"
            source.warn("G006.first-person", at, found=str(view))
            continue
        found.update(dict.fromkeys(nodes, known))
    return found


def _nodes(file: NodeFile, each: Any, version: int) -> list[int]:
    """Return the nodes whose mesh is annotated."""
    if version == 0:
        mesh = part(each, "mesh")
        has_mesh = is_index(mesh, len(file.meshes))
        return file.tree.with_mesh(mesh) if has_mesh else []
    node = part(each, "node")
    has_node = is_index(node, file.tree.n_nodes) and file.tree.meshes[node] >= 0
    return [node] if has_node else []
