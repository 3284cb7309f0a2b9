"""Meshes in glTF form: a primitive per material, vertices split at seams, morph targets."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.export._gltf.document import INDICES, VERTICES, Document, text_of
from viewer.export._gltf.encoding import Encoding
from viewer.export._gltf.materials import Materials
from viewer.export._gltf.parts import Part
from viewer.export._gltf.shape import Shape
from viewer.export._gltf.skin import Influences, influence_sets
from viewer.rig.arrays import Floats
from viewer.rig.blendshapes import BlendShapes
from viewer.rig.geometry.transform import apply_transform
from viewer.rig.geometry.vectors import moved_tangents, unit
from viewer.rig.mesh import Mesh, vertex_normals

_POINTS = 0  # mode of a primitive without triangles
_LONG = 65535  # maximum number of vertices with 16-bit indices, the last of which is reserved
_NOT_UNIT = 1e-3  # tolerance for unit length; squares of normals may underflow or overflow


def add_mesh(
    encoding: Encoding,
    materials: Materials,
    part: Part,
    shape: Shape,
    influences: Influences | None,
    tangents: Floats | None = None,
) -> int:
    """Add a part of a figure's mesh; return its index.

    ``encoding``: writer of vertex attributes.
    ``materials``: writer of the figure's materials.
    ``part``: part with at least one vertex.
    ``shape``: shape of the figure.
    ``influences``: influences of the mesh; None if it is not skinned.
    ``tangents`` (V, 4): see ``FileRecord.tangents``.
    """
    mesh, surface = shape.figure.require_mesh(), _surface(part, shape)
    document = encoding.document
    attributes = _attributes(encoding, mesh, part, surface)
    own = None if tangents is None else moved_tangents(tangents[part.sources], surface.linear)
    if own is not None and own[:, 3].all() and own[:, :3].any(axis=1).all():
        attributes["TANGENT"] = document.array(own, "VEC4", VERTICES)
    if part.joint < 0 and influences is not None:
        sets = [*influence_sets(influences, part.sources)]
        for number, (joints, weights) in enumerate(encoding.influences(sets)):
            attributes |= {f"JOINTS_{number}": joints, f"WEIGHTS_{number}": weights}
    item: dict[str, Any] = {"name": text_of(part.mesh_name)} if part.mesh_name else {}
    shared: dict[str, Any] = {"attributes": attributes}
    record = shape.figure.record
    extras = None if record is None else record.mesh_extras.get(part.index)
    shapes = shape.figure.blend_shapes
    if shapes is not None and len(part.targets):
        rows = shape.targets[part.targets]
        shared["targets"] = _targets(encoding, part, surface, shapes, rows)
        item["weights"] = shape.weights[0, part.targets].tolist()
        if any(part.target_names):
            kept = extras if isinstance(extras, dict) else {}
            extras = {**kept, "targetNames": [text_of(name) for name in part.target_names]}
    if extras is not None:
        item["extras"] = extras
    item["primitives"] = _primitives(document, materials, part, surface, shared)
    return document.add("meshes", item)


@dataclass(frozen=True, slots=True, eq=False)
class _Surface:
    """Vertices of a part in the space of its node.

    ``positions``, ``normals`` (R, 3): positions and unit normals of the written vertices.
    ``lengths`` (R, 1): lengths of the figure's own normals.
    ``linear`` (3, 3): from binding space to the space of the node.
    """

    positions: Floats
    normals: Floats
    lengths: Floats
    linear: Floats


def _surface(part: Part, shape: Shape) -> _Surface:
    mesh, skin = shape.figure.require_mesh(), shape.figure.skin
    positions, normals = mesh.positions[part.sources], _normals(mesh)[part.sources]
    lengths = np.linalg.norm(mesh.normals[part.sources], axis=1, keepdims=True)
    if part.joint < 0 or skin is None:
        return _Surface(positions, normals, lengths, np.eye(3))
    matrix = skin.inverse_bind[part.joint]
    linear = matrix[:3, :3]
    turned = normals @ np.linalg.inv(linear)
    stretch = np.linalg.norm(turned, axis=1, keepdims=True)
    return _Surface(apply_transform(matrix, positions), turned / stretch, lengths * stretch, linear)


def _attributes(encoding: Encoding, mesh: Mesh, part: Part, surface: _Surface) -> dict[str, int]:
    attributes = {
        "POSITION": encoding.positions(surface.positions, part.joint < 0),
        "NORMAL": encoding.normals(surface.normals),
    }
    if mesh.uvs is not None and len(mesh.uvs):
        # In glTF, the first image row is at v = 0; in this program, at v = 1.
        for number, uvs in enumerate((mesh.uvs, *mesh.other_uvs)):
            flipped = uvs[part.uv_indices] * [1.0, -1.0] + [0.0, 1.0]
            attributes[f"TEXCOORD_{number}"] = encoding.uvs(flipped)
    if mesh.colors is not None:
        colors = np.clip(mesh.colors[part.sources], 0.0, 1.0)
        attributes["COLOR_0"] = encoding.colors(colors)
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
    encoding: Encoding,
    part: Part,
    surface: _Surface,
    shapes: BlendShapes,
    rows: NDArray[np.intp],
) -> list[dict[str, int]]:
    # Normals are written with length 1, and their offsets at the same scale.
    scales = np.divide(
        1.0, surface.lengths, out=np.zeros_like(surface.lengths), where=surface.lengths > 0.0
    )
    targets, directions = [], shapes.direction_values()
    for row in rows:
        offsets = directions[row][part.sources] @ surface.linear.T
        target = {"POSITION": encoding.offsets(offsets, part.joint < 0)}
        if shapes.normal_offsets is not None:
            normals = shapes.normal_values()[row][part.sources] @ np.linalg.inv(surface.linear)
            target["NORMAL"] = encoding.normal_offsets(normals * scales)
        targets.append(target)
    return targets


def _primitives(
    document: Document,
    materials: Materials,
    part: Part,
    surface: _Surface,
    shared: dict[str, Any],
) -> list[dict[str, Any]]:
    triangles, n_vertices = part.triangles, len(part.sources)
    if len(triangles) == 0:
        return [{**shared, "mode": _POINTS, "material": materials.plain()}]
    if np.linalg.det(surface.linear) < 0.0:
        triangles = triangles[:, ::-1]
    dtype = np.uint16 if n_vertices <= _LONG else np.uint32
    primitives = []
    for index in np.unique(part.materials).tolist():
        chosen = triangles[part.materials == index].astype(dtype).ravel()
        primitives.append(
            {
                **shared,
                "indices": document.array(chosen, "SCALAR", INDICES),
                "material": materials.add(index),
            }
        )
    return primitives
