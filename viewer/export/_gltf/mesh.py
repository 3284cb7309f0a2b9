"""Meshes in glTF form: one per part, with a primitive per material, and shared vertices.

Vertices are split at seams. Every part has all morph targets of the figure.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.export._gltf.document import INDICES, VERTICES, Document, text_of
from viewer.export._gltf.materials import Color, Materials
from viewer.export._gltf.shape import Shape
from viewer.export._gltf.skin import Influences, influence_sets
from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.blendshapes import BlendShapes
from viewer.rig.geometry.vectors import unit
from viewer.rig.mesh import Mesh, split_seams, vertex_normals

_POINTS = 0  # mode of a primitive without triangles
_LONG = 65535  # maximum number of vertices with 16-bit indices, the highest being reserved
_NOT_UNIT = 1e-3  # tolerance of unit length; squares of normals may underflow or overflow


@dataclass(frozen=True, slots=True)
class WrittenMeshes:
    """Indices and names of a figure's meshes, and their total number of vertices."""

    meshes: list[int]
    names: list[str]
    n_vertices: int


def add_meshes(
    document: Document,
    name: str,
    shape: Shape,
    influences: Influences | None,
    color: Color | None = None,
) -> WrittenMeshes:
    """Add a figure's mesh: a mesh for each of its parts.

    ``document``: modified in place.
    ``name``: name of the figure.
    ``shape``: shape of a figure whose mesh is not empty.
    ``influences``: influences of the mesh; None if it is not skinned.
    ``color`` (r, g, b): linear colour of untextured surfaces.
    Returns the meshes; vertices on seams are duplicated.
    """
    mesh = shape.figure.require_mesh()
    sources, uv_indices, triangles = split_seams(mesh)
    attributes = _attributes(document, mesh, sources, uv_indices)
    for number, (joints, weights) in enumerate(
        influence_sets(influences, sources) if influences is not None else ()
    ):
        attributes[f"JOINTS_{number}"] = document.array(joints, "VEC4", VERTICES)
        attributes[f"WEIGHTS_{number}"] = document.array(weights, "VEC4", VERTICES)
    common: dict[str, Any] = {}
    shared: dict[str, Any] = {"attributes": attributes}
    shapes = shape.figure.blend_shapes
    if shapes is not None and len(shape.targets):
        shared["targets"] = _targets(document, mesh, shapes, shape.targets, sources)
        common["weights"] = shape.weights[0].tolist()
        common["extras"] = {"targetNames": [text_of(shapes.names[row]) for row in shape.targets]}
    materials = Materials(document, mesh, color)
    meshes, names = [], []
    for part in np.unique(mesh.part_indices).tolist() or [-1]:
        title = mesh.parts[part] if part >= 0 else ""
        names.append(text_of(title or f"{name} mesh"))
        chosen = mesh.part_indices == part
        primitives = _primitives(document, materials, triangles, chosen, shared, len(sources))
        item = {"name": names[-1], **common, "primitives": primitives}
        meshes.append(document.add("meshes", item))
    return WrittenMeshes(meshes, names, len(sources))


def _attributes(document: Document, mesh: Mesh, sources: Ints, uv_indices: Ints) -> dict[str, int]:
    attributes = {
        "POSITION": document.array(mesh.positions[sources], "VEC3", VERTICES, bounds=True),
        "NORMAL": document.array(_normals(mesh)[sources], "VEC3", VERTICES),
    }
    if mesh.uvs is not None and len(mesh.uvs):
        # In glTF, the first image row is at v = 0; in this program, at v = 1.
        for number, uvs in enumerate((mesh.uvs, *mesh.other_uvs)):
            flipped = uvs[uv_indices] * [1.0, -1.0] + [0.0, 1.0]
            attributes[f"TEXCOORD_{number}"] = document.array(flipped, "VEC2", VERTICES)
    if mesh.colors is not None:
        colors = np.clip(mesh.colors[sources], 0.0, 1.0)
        attributes["COLOR_0"] = document.array(colors, "VEC4", VERTICES)
    return attributes


def _normals(mesh: Mesh) -> Floats:
    """Return unit normals; those that cannot be normalised are computed from the triangles."""
    with np.errstate(over="ignore", invalid="ignore"):
        normals = unit(mesh.normals)
        odd = ~(np.abs(np.linalg.norm(normals, axis=1) - 1.0) < _NOT_UNIT)
    if odd.any():
        normals[odd] = vertex_normals(mesh.positions, mesh.triangles)[odd]
    return normals


def _targets(
    document: Document,
    mesh: Mesh,
    shapes: BlendShapes,
    rows: NDArray[np.intp],
    sources: Ints,
) -> list[dict[str, int]]:
    # Normals are written with length 1, and their offsets at the same scale.
    lengths = np.linalg.norm(mesh.normals, axis=1, keepdims=True)
    scales = np.divide(1.0, lengths, out=np.zeros_like(lengths), where=lengths > 0.0)
    targets = []
    for row in rows:
        one = np.zeros(shapes.n_shapes)
        one[row] = 1.0
        offsets = shapes.displacement(one)[sources]
        target = {"POSITION": document.array(offsets, "VEC3", VERTICES, bounds=True)}
        normal_offsets = shapes.normal_displacement(one)
        if normal_offsets is not None:
            target["NORMAL"] = document.array((normal_offsets * scales)[sources], "VEC3", VERTICES)
        targets.append(target)
    return targets


def _primitives(
    document: Document,
    materials: Materials,
    triangles: Ints,
    chosen: Bools,
    shared: dict[str, Any],
    n_vertices: int,
) -> list[dict[str, Any]]:
    """Return a primitive for each material of the chosen triangles, (T,)."""
    if len(triangles) == 0:
        return [{**shared, "mode": _POINTS, "material": materials.plain()}]
    dtype = np.uint16 if n_vertices <= _LONG else np.uint32
    indices = materials.mesh.material_indices
    primitives = []
    for index in np.unique(indices[chosen]).tolist():
        corners = triangles[chosen & (indices == index)].astype(dtype).ravel()
        primitives.append(
            {
                **shared,
                "indices": document.array(corners, "SCALAR", INDICES),
                "material": materials.add(index),
            }
        )
    return primitives
