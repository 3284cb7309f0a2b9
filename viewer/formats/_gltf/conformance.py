"""Violations of the specification without visible effect, reported only by lint."""

from __future__ import annotations

import numpy as np

from viewer.errors import FormatError
from viewer.formats._gltf.document import Document
from viewer.formats._gltf.elements import Element
from viewer.formats._nodes.ancestors import descendants, roots_of
from viewer.formats._nodes.content import NodeMesh, NodeSkin, NodeTree
from viewer.rig.arrays import Floats, Ints

__all__ = ["check_conformance"]

_ROUNDING = 1e-5  # tolerance of declared bounds, relative to the largest component
_UNIT = 1e-3  # tolerance of the deviation of a quaternion's length from 1
# Normalised integers that represent 1, by component type.
_ONES = {5120: 127.0, 5121: 255.0, 5122: 32767.0, 5123: 65535.0}


def check_conformance(
    document: Document, tree: NodeTree, meshes: tuple[NodeMesh, ...], skins: tuple[NodeSkin, ...]
) -> None:
    """Report the errors that Khronos' validator finds in accessors, skins, nodes and animations.

    Parameters
    ----------
    document : Document
        The file, whose elements have been read; errors that were reported then are not repeated.
    tree, meshes, skins : NodeTree, tuple of NodeMesh, tuple of NodeSkin
        Its contents.
    """
    _check_bounds(document)
    _check_primitives(document)
    roots = roots_of(tree.parents)
    for index, skin in enumerate(skins):
        if len(skin.joints):
            _check_hierarchy(document.table("skins")[index], skin, tree.parents, roots)
    _check_nodes(document, tree, meshes)
    animations = document.table("animations")
    for index in range(len(animations)):
        try:
            _check_animation(document, animations[index])
        except FormatError:  # the error was reported when the item was read
            continue


def _check_bounds(document: Document) -> None:
    """Compare declared bounds with the components of all accessors that have any."""
    for index in range(len(document.accessors)):
        try:
            accessor = document.accessors[index]
            if accessor.has("min") or accessor.has("max"):
                _compare_bounds(accessor, document.accessors.components(index))
        # The error was reported when the accessor was read, or the accessor is not used.
        except FormatError:
            continue


def _compare_bounds(accessor: Element, components: Floats | None) -> None:
    if components is None or not len(components) or not np.isfinite(components).all():
        return
    for name, found in (("min", components.min(axis=0)), ("max", components.max(axis=0))):
        if not accessor.has(name):
            continue
        declared = accessor.numbers(name)
        if declared is None or len(declared) != len(found):
            n_declared = 0 if declared is None else len(declared)
            accessor.warn("G002.bounds-length", name, expected=len(found), found=n_declared)
            continue
        apart = np.abs(declared - found)
        if (apart > _ROUNDING * max(1e-30, float(np.abs(components).max()))).any():
            worst = int(apart.argmax())
            values = {"expected": float(found[worst]), "found": float(declared[worst])}
            accessor.warn("G002.bounds", name, component=worst, **values)


def _check_primitives(document: Document) -> None:
    """Check that positions have bounds, and that unused influences refer to joint 0."""
    table = document.table("meshes")
    for mesh in range(len(table)):
        try:
            primitives = table[mesh].table("primitives")
            for place in range(len(primitives)):
                attributes = primitives[place].part("attributes")
                if attributes is not None:
                    _check_attributes(document, attributes)
        except FormatError:  # the error was reported when the item was read
            continue


def _check_attributes(document: Document, attributes: Element) -> None:
    accessors = document.accessors
    position = attributes.index("POSITION", len(accessors), "accessors")
    if position >= 0 and not _has_bounds(accessors[position]):
        attributes.warn("G002.no-bounds", "POSITION")
    for name in attributes.values:
        number = name.removeprefix("JOINTS_")
        if number == name or not attributes.has(f"WEIGHTS_{number}"):
            continue
        joints = accessors.components(attributes.index(name, len(accessors), "accessors"))
        weights = accessors.components(
            attributes.index(f"WEIGHTS_{number}", len(accessors), "accessors")
        )
        if joints is None or weights is None or joints.shape != weights.shape:
            continue
        unused = (weights == 0.0) & (joints != 0.0)
        if unused.any():
            vertex = int(unused.any(axis=1).argmax())
            attributes.warn("G002.unused-joints", name, n=int(unused.sum()), vertex=vertex)


def _has_bounds(accessor: Element) -> bool:
    return accessor.has("min") and accessor.has("max")


def _check_hierarchy(skin: Element, read: NodeSkin, parents: Ints, roots: Ints) -> None:
    """Check that the joints have a common root, and that ``skeleton`` is one if it is declared."""
    found = np.unique(roots[read.joints]).tolist()
    if len(found) > 1:
        skin.warn("G004.no-common-root", "joints", nodes=found)
    declared = skin.values.get("skeleton")
    if type(declared) is int and 0 <= declared < len(parents):
        outside = int((~descendants(parents, declared)[read.joints]).sum())
        if outside:
            skin.warn("G004.not-a-root", "skeleton", node=declared, n=outside)


def _check_nodes(document: Document, tree: NodeTree, meshes: tuple[NodeMesh, ...]) -> None:
    """Check nodes with a mesh: skins without influences, influences without a skin."""
    n_bound = [sum(part.joints is not None for part in mesh.primitives) for mesh in meshes]
    is_drawn = [bool(mesh.primitives) for mesh in meshes]
    identity = (0.0,) * 6 + (1.0,) * 4
    for node in np.flatnonzero(tree.meshes >= 0).tolist():
        mesh, element = int(tree.meshes[node]), document.table("nodes")[node]
        if tree.skins[node] < 0:
            if n_bound[mesh]:
                element.warn("G003.no-skin")
            continue
        if is_drawn[mesh] and not n_bound[mesh]:
            element.warn("G003.no-influences", "skin")
            continue
        local = (*tree.translations[node], *tree.rotations[node], *tree.scales[node])
        if node in tree.matrices or not np.allclose(local, identity, atol=1e-6):
            n_rigid = len(meshes[mesh].primitives) - n_bound[mesh]
            if n_rigid:
                element.warn("G003.partly-used", n=n_rigid)
            else:
                element.warn("G003.unused-transform")


def _check_animation(document: Document, animation: Element) -> None:
    """Check times, bounds and rotations of keys, and that no channel moves a matrix."""
    channels, samplers = animation.table("channels"), animation.table("samplers")
    accessors, nodes = document.accessors, document.table("nodes")
    rotating: set[int] = set()
    for place in range(len(channels)):
        target = channels[place].part("target")
        if target is None:
            continue
        node = target.index("node", len(nodes), "nodes")
        path = target.text("path")
        if node >= 0 and path != "weights" and nodes[node].has("matrix"):
            target.warn("G005.matrix", "node", node=node)
        if path == "rotation":
            rotating.add(channels[place].index("sampler", len(samplers), "samplers"))
    seen: set[int] = set()
    for place in range(len(samplers)):
        sampler = samplers[place]
        times = sampler.index("input", len(accessors), "accessors")
        if times >= 0 and times not in seen:
            seen.add(times)
            _check_times(document, sampler, times)
        if place in rotating and sampler.text("interpolation", "LINEAR") != "CUBICSPLINE":
            _check_rotations(document, sampler)


def _check_times(document: Document, sampler: Element, accessor: int) -> None:
    if not _has_bounds(document.accessors[accessor]):
        sampler.warn("G005.no-bounds", "input")
    times = document.accessors.components(accessor)
    if times is not None and len(times) and times.min() < 0.0:
        sampler.warn("G005.negative", "input", n=int((times < 0.0).sum()), found=float(times.min()))


def _check_rotations(document: Document, sampler: Element) -> None:
    accessor = sampler.index("output", len(document.accessors), "accessors")
    if accessor < 0:
        return
    keys = document.accessors.components(accessor)
    if keys is None or keys.shape[1] != 4:
        return
    one = _ONES.get(document.accessors[accessor].whole("componentType"), 1.0)
    lengths = np.linalg.norm(keys, axis=1) / one
    # Integers are rounded: 1 / 127 for each component of a byte.
    odd = np.abs(lengths - 1.0) > (_UNIT if one == 1.0 else 0.02)
    if odd.any():
        key = int(odd.argmax())
        found = {"index": key, "found": float(lengths[key])}
        sampler.warn("G005.unit", "output", n=int(odd.sum()), **found)
