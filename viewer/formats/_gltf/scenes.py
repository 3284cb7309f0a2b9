"""Scenes of a glTF document: the root nodes that are shown."""

from __future__ import annotations

from typing import Any

import numpy as np

from viewer.formats._gltf.document import Document
from viewer.formats._gltf.elements import Element
from viewer.formats._nodes.ancestors import roots_of
from viewer.formats._nodes.content import NodeTree

__all__ = ["shown_roots", "shown_scene"]


def shown_roots(document: Document, tree: NodeTree) -> tuple[int, ...]:
    """Return the root nodes of the default scene or the first one; all if there are no scenes.

    Raises
    ------
    FormatError
        If the scene does not exist, or its list of nodes is malformed.
    """
    scenes = document.table("scenes")
    default = document.root.index("scene", len(scenes), "scenes")
    every = tuple(np.nonzero(tree.parents < 0)[0].tolist())
    if not len(scenes):
        return every
    scene = scenes[max(default, 0)]
    roots = _roots(scene, tree)
    if len(scenes) > 1 and roots:
        name = scene.text("name") or str(max(default, 0))
        document.root.warn("F007.gltf-scenes", "scenes", n=len(scenes), found=name)
    if not roots and every:
        scene.warn("F007.gltf-empty-scene")
    return roots or every


def shown_scene(document: Document) -> dict[str, Any]:
    """Return the name and the application data of the default scene or the first one."""
    scenes = document.table("scenes")
    if not len(scenes):
        return {}
    scene = scenes[max(document.root.index("scene", len(scenes), "scenes"), 0)]
    name, extras = scene.text("name"), scene.values.get("extras")
    return ({"name": name} if name else {}) | ({} if extras is None else {"extras": extras})


def _roots(scene: Element, tree: NodeTree) -> tuple[int, ...]:
    nodes = scene.indices("nodes", tree.n_nodes, "nodes")
    children = [node for node in nodes if tree.parents[node] >= 0]
    if children:
        scene.warn("G003.scene-child", "nodes", n=len(children), found=children[0])
    # Transforms of the ancestors apply, so the tree is shown from its root.
    return tuple(dict.fromkeys(roots_of(tree.parents)[nodes].tolist()))
