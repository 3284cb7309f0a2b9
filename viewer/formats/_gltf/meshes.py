"""Meshes of a glTF document: their triangles, vertex attributes and morph targets."""

from __future__ import annotations

from collections import Counter
from functools import partial

import numpy as np

from viewer.data_classes import dataclass
from viewer.formats._gltf.attributes import (
    Attributes,
    read_colors,
    read_normals,
    read_positions,
    read_uvs,
    tangents_of,
)
from viewer.formats._gltf.document import Document
from viewer.formats._gltf.draco import decoded_primitive
from viewer.formats._gltf.elements import Element, Table
from viewer.formats._gltf.influences import read_influences
from viewer.formats._gltf.targets import n_targets, read_targets, shape_weights, target_names
from viewer.formats._gltf.topology import TRIANGLES, read_triangles
from viewer.formats._nodes.content import NodeMesh, Primitive
from viewer.rig.arrays import Ints

__all__ = ["read_meshes"]

_MODES = range(7)


@dataclass(slots=True)
class _Reading:
    """State shared by all meshes while they are read."""

    document: Document
    users: Counter[int]
    """Number of primitives that use an accessor as positions."""
    n_undrawn: int = 0
    """Number of primitives of points and lines."""
    undrawn: str = ""
    """JSON pointer to the first of these primitives."""


def read_meshes(document: Document) -> tuple[NodeMesh, ...]:
    """Return all meshes.

    Raises
    ------
    FormatError
        If a mesh is malformed, refers to missing vertices or data, or has non-finite positions.
    """
    table = document.table("meshes")
    reading = _Reading(document, _users(table))
    empty = NodeMesh("", ())
    meshes = []
    for index in range(len(table)):
        meshes.append(document.kept(partial(_mesh, reading, table[index]), empty))
    if reading.n_undrawn:
        document.source.warn("F007.gltf-undrawn", reading.undrawn, n=reading.n_undrawn)
    return tuple(meshes)


def _users(table: Table) -> Counter[int]:
    found: Counter[int] = Counter()
    for index in range(len(table)):
        primitives = table[index].table("primitives")
        for place in range(len(primitives)):
            attributes = primitives[place].part("attributes")
            position = -1 if attributes is None else attributes.values.get("POSITION")
            if type(position) is int:
                found[position] += 1
    return found


def _mesh(reading: _Reading, mesh: Element) -> NodeMesh:
    primitives = mesh.table("primitives")
    if not len(primitives):
        mesh.warn("G002.no-primitives")
    count = n_targets(mesh, primitives)
    read = (_primitive(reading, primitives[place]) for place in range(len(primitives)))
    return NodeMesh(
        mesh.text("name"),
        tuple(primitive for primitive in read if primitive is not None),
        target_names(mesh, primitives, count),
        shape_weights(mesh, count),
        mesh.values.get("extras"),
    )


def _primitive(reading: _Reading, primitive: Element) -> Primitive | None:
    """Return a primitive; None if it draws no triangles."""
    mode = primitive.choice("mode", _MODES, 4)
    element = primitive.part("attributes")
    if element is None:
        raise primitive.wrong("attributes", "an object")
    if mode not in TRIANGLES:
        reading.n_undrawn += 1
        reading.undrawn = reading.undrawn or primitive.pointer
        return None
    if not element.has("POSITION"):
        # This is valid: an unsupported extension may provide the vertices.
        element.warn("G002.no-positions")
        return None
    document = reading.document
    position = element.index("POSITION", len(document.accessors), "accessors")
    count = document.accessors.count(position)
    compressed = decoded_primitive(document, primitive)
    if compressed is not None:
        count = len(compressed.attributes.get("POSITION", range(count)))
        triangles = read_triangles(document, primitive, count, compressed.triangles)
        decoded = Attributes(document, element, count, None, compressed.attributes)
        return _read(decoded, primitive, triangles)
    triangles = read_triangles(document, primitive, count)
    rows = None
    if reading.users[position] > 1:
        document.spend(count, primitive.pointer)
        rows, triangles = _used(triangles, count)
    return _read(Attributes(document, element, count, rows), primitive, triangles)


def _used(triangles: Ints, count: int) -> tuple[Ints | None, Ints]:
    """Return the vertices that triangles use, and the triangles with indices into them."""
    used = np.zeros(count, dtype=np.bool_)
    used[triangles] = True
    if used.all():
        return None, triangles
    numbers = np.cumsum(used, dtype=np.int32) - 1
    return np.nonzero(used)[0].astype(np.int32), numbers[triangles]


def _read(attributes: Attributes, primitive: Element, triangles: Ints) -> Primitive:
    """Return a primitive of triangles."""
    document = attributes.document
    positions = read_positions(attributes)
    joints, weights = read_influences(attributes)
    targets, normal_targets = read_targets(attributes, primitive.table("targets"))
    n_materials = len(document.table("materials"))
    return Primitive(
        positions=positions,
        triangles=triangles,
        normals=read_normals(attributes),
        tangents=tangents_of(attributes),
        uvs=read_uvs(attributes),
        colors=read_colors(attributes),
        joints=joints,
        weights=weights,
        material=primitive.index("material", n_materials, "materials"),
        targets=targets,
        normal_targets=normal_targets,
        pointer=primitive.pointer,
    )
