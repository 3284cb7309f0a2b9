"""Morph targets of the meshes of a figure, as its blend shapes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import FormatError
from viewer.formats._scene_graph.content import MorphTargets, NodeExpression, NodeFile, NodeMesh
from viewer.formats._scene_graph.motions import Reader
from viewer.formats._scene_graph.surfaces import (
    Piece,
    normal_matrix,
    normal_scales,
    part_name,
    used_materials,
)
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.blendshapes import BlendShapes
from viewer.rigs.bodies.offsets import DeferredOffsets
from viewer.rigs.expressions import OVERRIDES, PROCEDURAL, ExpressionRules, MaterialBinds


def shape_columns(file: NodeFile, nodes: list[int], readers: list[Reader]) -> dict[int, Ints]:
    """Return each node's blend shapes (S,), the same ones for the parts of one face."""
    # Nodes are parts of one face if their targets have the same names and default weights, and the
    # same keys in all animations; only animations of such nodes are read.
    shaped = [node for node in nodes if _mesh(file, node).target_names]
    looks = {
        node: (_mesh(file, node).target_names, tuple(_defaults(file, node).tolist()))
        for node in shaped
    }
    counts = Counter(looks.values())
    known: dict[tuple[object, ...], Ints] = {}
    columns: dict[int, Ints] = {}
    count = 0
    for node in shaped:
        names = _mesh(file, node).target_names
        # Targets without names do not necessarily correspond.
        is_alone = counts[looks[node]] == 1 or not all(names)
        key = (node,) if is_alone else (*looks[node], _keys(file, node, readers))
        if key not in known:
            known[key] = np.arange(count, count + len(names), dtype=np.int32)
            count += len(names)
        columns[node] = known[key]
    return columns


def _keys(file: NodeFile, node: int, readers: list[Reader]) -> tuple[object, ...]:
    """Return all keys of a node's morph targets in a form that can be compared."""
    found: list[object] = []
    for number, (animation, read) in enumerate(zip(file.animations, readers, strict=True)):
        if node not in animation.nodes:
            continue
        try:
            channels = read()
        except FormatError:
            # The error is raised when the animation is played; until then its keys are unknown.
            return (node,)
        for channel in channels:
            if channel.node == node and channel.path == "weights":
                tangents = None if channel.tangents is None else channel.tangents.tobytes()
                values = channel.times.tobytes(), channel.values.tobytes(), tangents
                found.append((number, channel.interpolation, *values))
    return tuple(found)


def _mesh(file: NodeFile, node: int) -> NodeMesh:
    return file.meshes[int(file.tree.meshes[node])]


def _defaults(file: NodeFile, node: int) -> Floats:
    """Return the weights of a node's morph targets in the rest pose."""
    given = file.tree.shape_weights.get(node)
    return _mesh(file, node).shape_weights if given is None else given


def blend_shapes_of(
    file: NodeFile, columns: dict[int, Ints], pieces: list[Piece]
) -> BlendShapes | None:
    """Return the blend shapes in binding space; their offsets are assembled on first use."""
    slots = {material: slot for slot, material in enumerate(used_materials(pieces))}
    if not columns and not any(_binds_of(each, slots) for each in file.expressions):
        return None
    owners: dict[int, int] = {}
    for node, own in columns.items():
        for column in own.tolist():
            owners.setdefault(column, node)
    short, full, weights = list[str](), list[str](), list[float]()
    for column, node in sorted(owners.items()):
        index = int(np.flatnonzero(columns[node] == column)[0])
        name = _mesh(file, node).target_names[index] or f"target {index}"
        part = part_name(file, node) or f"#{node}"
        short.append(name)
        full.append(f"{part}.{name}")
        weights.append(float(_defaults(file, node)[index]))
    counts, n_targets = Counter(short), len(short)
    count = sum(piece.n_vertices for piece in pieces)
    mixed, sums = _expressions(file, columns, n_targets, slots)
    shape = n_targets + len(mixed), count, 3

    def offsets(of_normals: bool) -> DeferredOffsets:
        of_all = _Offsets(columns, pieces, count, of_normals, sums)
        return DeferredOffsets(shape, of_all.dense, of_all.weighted)

    has_normals = any(piece.shading == "file" for piece in pieces)
    # A name that several parts have is prefixed by that of the part.
    names = (a if counts[a] == 1 else b for a, b in zip(short, full, strict=True))
    return BlendShapes(
        names=(*names, *(each.name for each in mixed)),
        offsets=offsets(of_normals=False),
        groups=("morph",) * shape[0],
        # In glTF, a target without normals leaves them unchanged; flat normals follow the surface.
        normal_offsets=offsets(of_normals=True) if has_normals else None,
        rest_weights=np.array(weights + [0.0] * len(mixed)),
        rules=_rules(mixed, n_targets) if mixed else None,
        material_binds=_material_binds(mixed, n_targets, slots),
    )


def _binds_of(
    expression: NodeExpression, slots: Mapping[int, int]
) -> list[tuple[int, str, Floats]]:
    """Return the changes of materials that a figure has, by the index in its mesh."""
    return [
        (slots[index], kind, target)
        for index, kind, target in expression.materials
        if index in slots
    ]


def _material_binds(
    mixed: list[NodeExpression], first: int, slots: Mapping[int, int]
) -> MaterialBinds | None:
    """Return the changes of materials by expressions, whose blend shapes begin at ``first``."""
    rows = [
        (shape, *bind) for shape, each in enumerate(mixed, first) for bind in _binds_of(each, slots)
    ]
    if not rows:
        return None
    shapes, materials, kinds, targets = zip(*rows, strict=True)
    return MaterialBinds(np.array(shapes), np.array(materials), kinds, np.array(targets))


def _expressions(
    file: NodeFile, columns: dict[int, Ints], n_targets: int, slots: Mapping[int, int]
) -> tuple[list[NodeExpression], Floats]:
    """Return the figure's expressions, and their weights of its S morph targets: (E, S)."""
    found: list[NodeExpression] = []
    sums: list[Floats] = []
    for each in file.expressions:
        row = np.zeros(n_targets)
        for node, index, weight in each.binds:
            if node in columns:
                # An expression binds each of the nodes that share a target.
                column = columns[node][index]
                row[column] = max(row[column], weight, key=abs)
        if row.any() or _binds_of(each, slots):
            found.append(each)
            sums.append(row)
    return found, np.array(sums).reshape(len(found), n_targets)


def _rules(mixed: list[NodeExpression], first: int) -> ExpressionRules:
    """Return the rules of expressions that follow ``first`` morph targets."""
    kinds = [*PROCEDURAL]
    return ExpressionRules(
        rows=np.arange(first, first + len(mixed), dtype=np.int32),
        is_binary=np.array([each.is_binary for each in mixed]),
        kinds=np.array([kinds.index(each.kind) if each.kind else -1 for each in mixed]),
        overrides=np.array(
            [
                [OVERRIDES.index(each.overrides.get(kind, "none")) for kind in kinds]
                for each in mixed
            ]
        ),
        presets=tuple(each.preset for each in mixed),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Offsets:
    """Offsets of S morph targets, then of E expressions, which are sums of them."""

    columns: dict[int, Ints]
    pieces: list[Piece]
    n_vertices: int
    of_normals: bool
    sums: Floats
    """Weights of the morph targets in the expressions: (E, S)."""

    def dense(self) -> Floats:
        """Return the offsets of all vertices: (S + E, V, 3)."""
        offsets = np.zeros((self.sums.shape[1], self.n_vertices, 3))
        for rows, piece, own, targets in self._targets():
            offsets[own, rows] = self._bound(piece, targets.dense()[:, piece.sources])
        if not len(self.sums):
            return offsets
        return np.concatenate([offsets, np.einsum("es,sva->eva", self.sums, offsets)])

    def weighted(self, weights: Floats) -> Floats:
        """Return the sum of the offsets by weights (S + E,), without that array: (V, 3)."""
        n_targets = self.sums.shape[1]
        weights = weights[:n_targets] + weights[n_targets:] @ self.sums
        total = np.zeros((self.n_vertices, 3))
        for rows, piece, own, targets in self._targets():
            total[rows] = self._bound(piece, targets.weighted(weights[own])[piece.sources])
        return total

    def _targets(self) -> Iterator[tuple[slice, Piece, Ints, MorphTargets]]:
        """Yield the rows of each piece with targets, the piece, its blend shapes and targets."""
        first = 0
        for piece in self.pieces:
            rows = slice(first, first + piece.n_vertices)
            first += piece.n_vertices
            primitive, own = piece.primitive, self.columns.get(piece.node)
            targets = primitive.normal_targets if self.of_normals else primitive.targets
            if own is not None and targets is not None:
                yield rows, piece, own, targets

    def _bound(self, piece: Piece, values: Floats) -> Floats:
        """Return offsets of a piece in binding space."""
        if self.of_normals:
            return values @ normal_matrix(piece) * normal_scales(piece)
        return values @ piece.baked[:3, :3].T
