"""Nodes of a glTF document: their tree, transforms and contents."""

from __future__ import annotations

from typing import Any

import numpy as np

from viewer.formats._gltf.document import Document
from viewer.formats._gltf.elements import Table
from viewer.formats._gltf.member_rows import member_indices
from viewer.formats._gltf.node_transforms import Transforms, node_transforms
from viewer.formats._nodes.content import NodeTree
from viewer.rig.arrays import Ints
from viewer.rig.hierarchy import cycle_members

__all__ = ["read_tree"]


def read_tree(document: Document) -> NodeTree:
    """Return all nodes of a document.

    Raises
    ------
    FormatError
        If a node is invalid, has two parents, or is its own ancestor.
    """
    table = document.table("nodes")
    for place in range(len(table)):
        if type(table.items[place]) is not dict:
            table[place]  # raises the error for an item that is not an object
    parents = _parents(table)
    transforms: Transforms = node_transforms(table)
    return NodeTree(
        names=tuple(_names(table)),
        parents=parents,
        translations=transforms.translations,
        rotations=transforms.rotations,
        scales=transforms.scales,
        matrices=transforms.matrices,
        meshes=_members(document, "mesh", "meshes"),
        skins=_members(document, "skin", "skins"),
        cameras=_members(document, "camera", "cameras"),
        shape_weights=_weights(table),
        extras=_kept(table, "extras"),
        extensions=_kept(table, "extensions"),
    )


def _names(table: Table) -> list[str]:
    names = [values.get("name", "") for values in table.items]
    if set(map(type, names)) - {str}:
        return [table[place].text("name") for place in range(len(names))]
    return names


def _members(document: Document, name: str, what: str) -> Ints:
    return member_indices(document.table("nodes"), name, len(document.table(what)), what)


def _weights(table: Table) -> dict[int, Any]:
    """Return the morph target weights of the nodes that have any."""
    places = [place for place, values in enumerate(table.items) if "weights" in values]
    return {place: table[place].numbers("weights") for place in places}


def _kept(table: Table, name: str) -> dict[int, Any]:
    """Return the parsed values of a member, for the nodes that have it."""
    return {place: values[name] for place, values in enumerate(table.items) if name in values}


def _parents(table: Table) -> Ints:
    """Return each node's parent: (N,) int32, -1 for a root."""
    count = len(table)
    parents = [-1] * count
    for place, values in enumerate(table.items):
        if "children" not in values:
            continue
        for index, child in enumerate(table[place].indices("children", count, "nodes")):
            if parents[child] == place:
                table[place].warn("G003.child-twice", "children", found=child)
            elif parents[child] >= 0:
                pointer = table[place].at("children", index)
                other = parents[child]
                table.source.refuse("F002.gltf-parents", pointer, found=child, other=other)
            else:
                parents[child] = place
    result = np.array(parents, dtype=np.int32)
    _check_cycles(table, result)
    return result


def _check_cycles(table: Table, parents: Ints) -> None:
    """Refuse nodes that are their own ancestors; if errors are only recorded, break the cycles."""
    members = cycle_members(parents)
    left = np.nonzero(members)[0].tolist()
    seen: set[int] = set()
    for first in left:
        if first in seen:
            continue
        cycle = [first]
        while (above := int(parents[cycle[-1]])) != first:
            cycle.append(above)
        seen.update(cycle)
        pointer = table[int(parents[first])].at("children")
        table.source.refuse("F002.gltf-cycle", pointer, nodes=[*reversed(cycle)])
        parents[first] = -1
