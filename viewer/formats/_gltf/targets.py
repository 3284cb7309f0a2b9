"""Morph targets of meshes: offsets of positions and normals, names and default weights."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.formats._gltf.attributes import Attributes
from viewer.formats._gltf.document import Document
from viewer.formats._gltf.elements import Element, Table
from viewer.formats._nodes.content import NodeMesh, NodeTree
from viewer.formats._nodes.morph_targets import MorphTargets
from viewer.rig.arrays import Floats

__all__ = ["n_targets", "node_weights", "read_targets", "shape_weights", "target_names"]


def n_targets(mesh: Element, primitives: Table) -> int:
    """Return the number of morph targets of a mesh.

    Raises
    ------
    FormatError
        If its primitives have different numbers of targets.
    """
    counts = [len(primitives[place].table("targets")) for place in range(len(primitives))]
    for place, found in enumerate(counts):
        if found != counts[0]:
            raise primitives[place].fault(
                "F002.gltf-targets", "targets", expected=counts[0], found=found
            )
    return counts[0] if counts else 0


def read_targets(
    attributes: Attributes, targets: Table
) -> tuple[MorphTargets | None, MorphTargets | None]:
    """Return the offsets of positions and normals of a primitive, or None.

    Raises
    ------
    FormatError
        If the targets are malformed.
    """
    if not len(targets):
        return None, None
    offsets = _offsets(attributes, targets, "POSITION")
    if offsets is None:
        offsets = MorphTargets(attributes.n_rows, [None] * len(targets))
    return offsets, _offsets(attributes, targets, "NORMAL")


def _offsets(attributes: Attributes, targets: Table, name: str) -> MorphTargets | None:
    """Return the offsets of one attribute; None if no target has that attribute."""
    used = [place for place in range(len(targets)) if targets[place].has(name)]
    if not used:
        return None
    document, rows = attributes.document, attributes.rows
    # Limit the size as if all vertices moved: some uses need an offset for each vertex.
    document.spend(len(targets) * attributes.n_rows * 3 * 8, targets.pointer)
    found: list[NDArray[Any] | None] = [None] * len(targets)
    for place in used:
        target = Attributes(document, targets[place], attributes.n_vertices)
        values: NDArray[Any] | None = target.stored(name, "VEC3")
        if values is None:
            whole = target.floats(name, "VEC3")
            values = None if whole is None else target.finite(name, whole)
        found[place] = values
    return MorphTargets(attributes.n_rows, found, rows)


def shape_weights(mesh: Element, count: int) -> Floats:
    """Return the default weights of the morph targets: (S,).

    Raises
    ------
    FormatError
        If the weights are not numbers.
    """
    weights = mesh.numbers("weights")
    return np.zeros(count) if weights is None else _fitted(mesh, weights, count)


def node_weights(
    document: Document, tree: NodeTree, meshes: tuple[NodeMesh, ...]
) -> dict[int, Floats]:
    """Return the weights by which nodes override their meshes' weights: (S,) each."""
    nodes = document.table("nodes")
    return {
        node: _fitted(nodes[node], weights, len(meshes[tree.meshes[node]].target_names))
        for node, weights in tree.shape_weights.items()
        if tree.meshes[node] >= 0
    }


def _fitted(element: Element, weights: Floats, count: int) -> Floats:
    """Return weights for all morph targets; missing ones are 0."""
    if len(weights) != count:
        element.warn("G002.weights", "weights", expected=count, found=len(weights))
    return np.concatenate([weights[:count], np.zeros(max(0, count - len(weights)))])


def target_names(mesh: Element, primitives: Table, count: int) -> tuple[str, ...]:
    """Return the names of the morph targets; empty strings if there are none.

    Names are application data of the mesh, of a primitive, or of the targets themselves.
    """
    candidates = [_listed(mesh)]
    for place in range(len(primitives)):
        targets = primitives[place].table("targets")
        candidates += [_listed(primitives[place]), [_extra(item, "name") for item in targets.items]]
    for names in candidates:
        if len(names) == count and any(type(name) is str and name for name in names):
            return tuple(name if type(name) is str else "" for name in names)
    return ("",) * count


def _listed(element: Element) -> list[Any]:
    names = _extra(element.values, "targetNames")
    return names if type(names) is list else []


def _extra(values: Any, name: str) -> Any:
    """Return a member of an object's application data; None if it is missing."""
    extras = values.get("extras") if type(values) is dict else None
    return extras.get(name) if type(extras) is dict else None
