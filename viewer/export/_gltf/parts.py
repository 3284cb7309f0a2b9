"""Parts of a figure in glTF form: a node and a mesh for each, on a skin or on one joint."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.export._gltf.shape import Shape
from viewer.export._gltf.skin import Influences
from viewer.rig.arrays import Floats, Ints
from viewer.rig.figure import Figure
from viewer.rig.mesh import Mesh, split_seams
from viewer.rig.skin import influence_counts

__all__ = ["Part", "parts_of"]

_WORST_CONDITION = 1e5  # maximum condition number of an inverse bind matrix that is applied


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Triangles of a mesh that become a glTF mesh with a node.

    Attributes
    ----------
    index : int
        Index into the mesh's parts; -1 for triangles without a part, or for a whole mesh.
    name, mesh_name : str
        Names of the node and of the mesh.
    joint : int
        Joint whose node contains the mesh, because all vertices follow it rigidly; -1 if a skin
        moves them.
    sources, uv_indices : (R,) int32
        Vertex and texture coordinate of the figure that each written vertex copies.
    triangles : (T, 3) int32
        Indices into the written vertices.
    materials : (T,) int32
        Material of each triangle, -1 for none.
    targets : (M,) int
        The part's morph targets, as indices into ``Shape.targets``.
    target_names : tuple of M str
        Their names.
    """

    index: int
    name: str
    mesh_name: str
    joint: int
    sources: Ints
    uv_indices: Ints
    triangles: Ints
    materials: Ints
    targets: NDArray[np.intp]
    target_names: tuple[str, ...]


def parts_of(name: str, shape: Shape, influences: Influences | None) -> list[Part]:
    """Return the parts of a figure; a mesh without parts is a single part.

    A part whose vertices all follow the joint of its name is attached to that joint's node, as in
    its original file; others are skinned.

    ``name``: name of the mesh and its node if there are no parts.
    ``shape``: shape of a figure with a mesh.
    ``influences``: influences of the mesh; None if it is not skinned.
    """
    figure, mesh = shape.figure, shape.figure.require_mesh()
    sources, uv_indices, triangles = split_seams(mesh)
    parts, taken = list[Part](), set[int]()
    for index, rows in _rows(mesh, triangles, len(sources)).items():
        places = np.full(len(sources), -1, dtype=np.int32)
        places[rows] = np.arange(len(rows), dtype=np.int32)
        chosen = mesh.part_indices == index
        joint = -1
        if influences is not None and index >= 0:
            joint = _joint_of(figure, influences, index, sources[rows])
        if joint in taken:
            joint = -1
        taken.add(joint)
        targets, names = _targets(shape, index, sources[rows])
        parts.append(
            Part(
                index,
                (mesh.parts[index] if index >= 0 else "") or name,
                _mesh_name(figure, index, name),
                joint,
                sources[rows],
                uv_indices[rows],
                places[triangles[chosen]],
                mesh.material_indices[chosen],
                targets,
                names,
            )
        )
    return parts


def _rows(mesh: Mesh, triangles: Ints, count: int) -> dict[int, Ints]:
    """Return the written vertices of each part; parts may share vertices.

    Vertices without triangles belong to the part of the preceding vertex.
    """
    owners = np.full(count, -2, dtype=np.int32)
    owners[triangles] = mesh.part_indices[:, None]
    is_free = owners == -2
    known = np.maximum.accumulate(np.where(is_free, -1, np.arange(count)))
    first = int(mesh.part_indices[0]) if mesh.n_triangles else -1
    owners = np.where(known >= 0, owners[np.maximum(known, 0)], first)
    found = {}
    for index in np.unique(np.append(mesh.part_indices, owners)).tolist():
        chosen = is_free & (owners == index)
        chosen[triangles[mesh.part_indices == index]] = True
        found[index] = np.flatnonzero(chosen).astype(np.int32)
    return found


def _joint_of(figure: Figure, influences: Influences, index: int, sources: Ints) -> int:
    """Return the joint whose node contains a part of the mesh, -1 for none."""
    skin, skeleton = influences.skin, figure.require_skeleton()
    if not (influence_counts(skin)[sources] == 1).all():
        return -1
    joints = np.unique(skin.joints[skin.starts[sources]])
    name = figure.require_mesh().parts[index]
    if len(joints) != 1 or not name or skeleton.names[int(joints[0])] != name:
        return -1
    linear = skin.inverse_bind[int(joints[0]), :3, :3]
    scales = np.linalg.svd(linear, compute_uv=False)
    return int(joints[0]) if scales[0] < _WORST_CONDITION * scales[2] else -1


def _mesh_name(figure: Figure, index: int, name: str) -> str:
    record = figure.record
    if index < 0:
        return name
    has_names = record is not None and len(record.mesh_names) > index
    own = record.mesh_names[index] if record is not None and has_names else ""
    return own or figure.require_mesh().parts[index]


def _targets(shape: Shape, index: int, sources: Ints) -> tuple[NDArray[np.intp], tuple[str, ...]]:
    """Return a part's morph targets, as indices into the figure's, and their names."""
    every = np.arange(len(shape.targets))
    shapes, record = shape.figure.blend_shapes, shape.figure.record
    if shapes is None or len(every) == 0:
        return every[:0], ()
    names = [shapes.names[row] for row in shape.targets]
    if record is None or index < 0 or index >= len(record.part_shapes):
        return every, tuple(names)
    own = record.part_shapes[index].tolist()
    place = {int(row): target for target, row in enumerate(shape.targets)}
    given = dict(zip(own, record.target_names[index], strict=True))
    first = [place[row] for row in own if row in place]
    targets = first + [
        target
        for target in every.tolist()
        if shapes.is_expression(int(shape.targets[target]))
        and _moves(shapes.direction_values()[shape.targets[target]], sources)
    ]
    labels = (given.get(int(shape.targets[target])) or names[target] for target in targets)
    return np.array(targets, dtype=np.intp), tuple(labels)


def _moves(offsets: Floats, sources: Ints) -> bool:
    return bool(offsets[sources].any())
