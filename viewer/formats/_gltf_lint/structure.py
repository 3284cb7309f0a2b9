"""Nodes, skins, scenes, animations and extensions: members that depend on each other."""

from __future__ import annotations

from typing import Any

import numpy as np

from viewer.formats._gltf_lint.findings import Report, items_of
from viewer.formats._nodes.ancestors import roots_of
from viewer.formats._nodes.content import NodeSkin, NodeTree
from viewer.formats._vrm.json_parts import listed, part

__all__ = ["check_structure"]

_LISTS = (
    *("accessors", "animations", "buffers", "bufferViews", "cameras", "extensionsRequired"),
    *("extensionsUsed", "images", "materials", "meshes", "nodes", "samplers", "scenes", "skins"),
    "textures",
)
_SHEAR = 1e-4  # tolerance of the cosines of the angles between the axes of a matrix


def check_structure(
    root: dict[str, Any], tree: NodeTree, skins: tuple[NodeSkin, ...], report: Report
) -> None:
    """Check members that depend on each other.

    Parameters
    ----------
    root : dict
        The document, as parsed from JSON.
    tree, skins : NodeTree, tuple of NodeSkin
        Its nodes and skins.
    report : callable
        Records a warning.
    """
    for name in _LISTS:
        if root.get(name) == []:
            report("G001.structure", "at least one item", "none", (name,))
    for index, node in items_of(root, "nodes"):
        _check_node(node, index, report)
    _check_skinned(root, tree, skins, report)
    for index, scene in items_of(root, "scenes"):
        seen: set[int] = set()
        for place, root_node in enumerate(listed(scene, "nodes")):
            if isinstance(root_node, int) and root_node in seen:
                at = ("scenes", index, "nodes", place)
                report("G003.structure", "each node once", f"node {root_node} again", at)
            elif isinstance(root_node, int):
                seen.add(root_node)
    nodes = dict(items_of(root, "nodes"))
    for index, animation in items_of(root, "animations"):
        _check_animation(nodes, animation, index, report)
    _check_extensions(root, report)


def _check_node(node: dict[str, Any], index: int, report: Report) -> None:
    path = ("nodes", index)
    if node.get("children") == []:
        report("G003.structure", "at least one child", "none", (*path, "children"))
    for name in ("skin", "weights"):
        if name in node and "mesh" not in node:
            report("G003.structure", "a node with a mesh", "one without", (*path, name))
    matrix = node.get("matrix")
    if isinstance(matrix, list) and len(matrix) == 16 and _is_sheared(matrix):
        wanted = "a matrix of a translation, rotation and scale"
        report("G003.structure", wanted, "a sheared one", (*path, "matrix"))


def _is_sheared(matrix: list[Any]) -> bool:
    """Return whether the axes of a matrix are not perpendicular."""
    if not all(isinstance(each, int | float) and abs(each) < 1e30 for each in matrix):
        return False
    axes = np.array(matrix, dtype=np.float64).reshape(4, 4)[:3, :3]
    lengths = np.linalg.norm(axes, axis=1, keepdims=True)
    cosines = axes @ axes.T / np.maximum(lengths @ lengths.T, 1e-30)
    return bool((np.abs(cosines - np.diag(np.diag(cosines))) > _SHEAR).any())


def _check_skinned(
    root: dict[str, Any], tree: NodeTree, skins: tuple[NodeSkin, ...], report: Report
) -> None:
    """Check that skinned meshes are roots, in a scene with their joints."""
    parents, tops = tree.parents.tolist(), roots_of(tree.parents)
    scenes = [
        {node for node in listed(scene, "nodes") if isinstance(node, int)}
        for _, scene in items_of(root, "scenes")
    ]
    for node in np.flatnonzero(tree.skins >= 0).tolist():
        if parents[node] >= 0:
            found = f"a child of node {parents[node]}, whose transform has no effect"
            report("G007.skinned-child", "a root", found, ("nodes", node))
        joints = skins[int(tree.skins[node])].joints.tolist()
        top, roots = int(tops[node]), set(tops[joints].tolist())
        shown = [scene for scene in scenes if top in scene]
        if shown and not any(scene >= roots for scene in shown):
            wanted = "joints in the scene of the mesh"
            report("G004.structure", wanted, "joints outside it", ("nodes", node))


def _check_animation(
    nodes: dict[int, dict[str, Any]], animation: dict[str, Any], index: int, report: Report
) -> None:
    path = ("animations", index)
    for name in ("channels", "samplers"):
        if animation.get(name) == []:
            report("G005.structure", "at least one item", "none", (*path, name))
    for place, channel in items_of(animation, "channels"):
        moved, node = part(channel, "target", "path"), part(channel, "target", "node")
        owner = nodes.get(node, {}) if isinstance(node, int) else {}
        if "skin" in owner and moved in ("translation", "rotation", "scale"):
            found = f"a node with a skinned mesh, whose {moved} has no effect"
            at = (*path, "channels", place, "target", "path")
            report("G007.skinned-moved", "a node without a skinned mesh", found, at)


def _check_extensions(root: dict[str, Any], report: Report) -> None:
    """Check that all extensions are declared."""
    used = [name for name in listed(root, "extensionsUsed") if isinstance(name, str)]
    for place, name in enumerate(listed(root, "extensionsRequired")):
        if isinstance(name, str) and name not in used:
            at = ("extensionsRequired", place)
            report("G001.structure", "a name that extensionsUsed contains", name, at)
    told: set[str] = set()
    stack: list[tuple[Any, tuple[str | int, ...]]] = [(root, ())]
    while stack:
        value, path = stack.pop()
        if isinstance(value, list):
            stack += [(each, (*path, place)) for place, each in enumerate(value)]
        if not isinstance(value, dict):
            continue
        for name, each in value.items():
            if name == "extensions" and isinstance(each, dict):
                for extension in each:
                    if extension not in used and extension not in told:
                        told.add(extension)
                        at = (*path, name, extension)
                        report("G001.structure", "a name in extensionsUsed", extension, at)
            elif name != "extras" and isinstance(each, dict | list):
                stack.append((each, (*path, name)))
