"""Morph targets of the meshes of a figure, as its blend shapes."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from viewer.formats._nodes.content import NodeFile, NodeMesh
from viewer.formats._nodes.surfaces import Piece, part_name
from viewer.rig.arrays import Deferred, Floats, Ints
from viewer.rig.blendshapes import BlendShapes

__all__ = ["blend_shapes_of", "shape_columns"]


def shape_columns(file: NodeFile, nodes: list[int]) -> dict[int, Ints]:
    """Return the blend shape of each morph target of each node.

    Nodes with the same names of targets and the same default weights share their blend shapes,
    as they are parts of one face, unless an animation moves one of them.

    Parameters
    ----------
    file : NodeFile
        Its meshes.
    nodes : list of int
        Nodes with a mesh.

    Returns
    -------
    dict of (S,) int32
        Of the nodes with morph targets.
    """
    moved = set().union(*(animation.nodes for animation in file.animations))
    known: dict[tuple[tuple[str, ...], tuple[float, ...]], Ints] = {}
    columns: dict[int, Ints] = {}
    count = 0
    for node in nodes:
        mesh = _mesh(file, node)
        if not mesh.target_names:
            continue
        key = mesh.target_names, tuple(_defaults(file, node).tolist())
        is_shared = node not in moved and all(mesh.target_names)
        if is_shared and key in known:
            columns[node] = known[key]
            continue
        columns[node] = np.arange(count, count + len(mesh.target_names), dtype=np.int32)
        count += len(mesh.target_names)
        if is_shared:
            known[key] = columns[node]
    return columns


def _mesh(file: NodeFile, node: int) -> NodeMesh:
    return file.meshes[int(file.tree.meshes[node])]


def _defaults(file: NodeFile, node: int) -> Floats:
    """Return the weights of a node's morph targets in the rest pose."""
    given = file.tree.shape_weights.get(node)
    return _mesh(file, node).shape_weights if given is None else given


def blend_shapes_of(
    file: NodeFile, columns: dict[int, Ints], pieces: list[Piece]
) -> BlendShapes | None:
    """Return the blend shapes of a figure; offsets are put together when first used.

    Parameters
    ----------
    file : NodeFile
        Its meshes.
    columns : dict of (S,) int32
        From ``shape_columns``.
    pieces : list of Piece
        The primitives, whose targets are transformed to binding space.
    """
    if not columns:
        return None
    owners: dict[int, int] = {}
    for node, own in columns.items():
        for column in own.tolist():
            owners.setdefault(column, node)
    targets = [_target(file, columns, column, node) for column, node in sorted(owners.items())]
    counts = Counter(target.name for target in targets)
    count = sum(piece.n_vertices for piece in pieces)
    shape = len(targets), count, 3
    has_normals = any(piece.shading == "file" for piece in pieces)
    return BlendShapes(
        names=tuple(t.name if counts[t.name] == 1 else t.full_name for t in targets),
        offsets=Deferred(shape, np.float64, lambda: _offsets(columns, pieces, shape, False)),
        groups=("morph",) * len(targets),
        # glTF keeps normals that a target does not move; flat ones follow the surface.
        normal_offsets=Deferred(shape, np.float64, lambda: _offsets(columns, pieces, shape, True))
        if has_normals
        else None,
        rest_weights=np.array([target.weight for target in targets]),
    )


@dataclass(frozen=True, slots=True)
class _Target:
    """Name, name with that of its part, and default weight of a morph target."""

    name: str
    full_name: str
    weight: float


def _target(file: NodeFile, columns: dict[int, Ints], column: int, node: int) -> _Target:
    index = int(np.flatnonzero(columns[node] == column)[0])
    name = _mesh(file, node).target_names[index] or f"target {index}"
    part = part_name(file, node) or f"#{node}"
    return _Target(name, f"{part}.{name}", float(_defaults(file, node)[index]))


def _offsets(
    columns: dict[int, Ints], pieces: list[Piece], shape: tuple[int, ...], of_normals: bool
) -> Floats:
    """Return the offsets of all vertices, or of their normals, in binding space: (S, V, 3)."""
    offsets = np.zeros(shape)
    first = 0
    for piece in pieces:
        rows = slice(first, first + piece.n_vertices)
        first += piece.n_vertices
        primitive, own = piece.primitive, columns.get(piece.node)
        targets = primitive.normal_targets if of_normals else primitive.targets
        if own is None or targets is None:
            continue
        linear = piece.baked[:3, :3]
        matrix = np.linalg.inv(linear) if of_normals else linear.T
        offsets[own, rows] = targets[:, piece.sources] @ matrix
    return offsets
