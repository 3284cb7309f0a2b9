"""One mesh and skin made from all meshes of a figure, in its binding space.

Weights are scaled to sums of 1. Primitives without normals are shaded flat, which splits vertices
between faces, or smoothly if they are large. Transformed normals keep the lengths that they have in
the file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import zip_longest
from typing import Literal, TypeAlias

import numpy as np

from viewer.data_classes import dataclass
from viewer.formats._scene_graph.bindings import Bindings
from viewer.formats._scene_graph.content import NodeFile, Primitive
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.geometry.vectors import moved_tangents, unit
from viewer.rigs.mesh import Mesh, PartView, area_vectors, vertex_normals
from viewer.rigs.skin import Skin

_NO_SUM = 1e-12  # minimum sum of weights that is scaled to 1
_MOST_TRIANGLES = 200_000  # largest primitive that is shaded flat

# Grid cells per unit of normal components: faces within half a degree share a normal.
_CELLS = 128
_Origin: TypeAlias = Literal["file", "flat", "smooth"]


@dataclass(frozen=True, slots=True, eq=False)
class Influences:
    """A flat list of influences, vertex by vertex."""

    counts: Ints
    """Number of influences of each vertex: (V,)."""
    joints: Ints
    weights: Floats
    """Joint of the figure and weight of each, (N,); the weights of a vertex sum to 1."""
    deviation: float = 0.0
    """Largest deviation of a sum of weights from 1 before normalisation."""
    n_deviating: int = 0
    """Number of sums that deviate by more than the rounding of 8-bit weights."""
    unweighted: Bools | None = None
    """Vertices without any weight, which follow their first slot: (V,); None if there are none."""


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """A primitive of the mesh of one node, as part of a figure."""

    node: int
    part: int
    """Node of the mesh, and index of the figure's part."""
    primitive: Primitive
    """As in the file."""
    baked: Floats
    """Mesh space to binding space: (4, 4)."""
    influences: Influences
    """Influences of the V vertices."""
    sources: Ints
    """Original vertex of each vertex in the primitive, because flat shading splits vertices: (V,)
    int32."""
    triangles: Ints
    """Indices of the piece's vertices, counter-clockwise from outside in binding space: (T, 3)
    int32."""
    normals: Floats
    """Mesh space: (V, 3)."""
    shading: _Origin
    """Origin of the normals."""

    @property
    def n_vertices(self) -> int:
        """Number of vertices, V."""
        return len(self.sources)


_Shading: TypeAlias = tuple[Ints, Ints, Floats, bool]
"""Original of each of R vertices, which include those without triangles, (R,); triangles of these
vertices, (T, 3); unit normals, (R, 3); whether vertices were split between faces."""


def pieces_of(file: NodeFile, nodes: list[int], bindings: Bindings) -> list[Piece]:
    """Return the primitives of a figure, part by part."""
    pieces: list[Piece] = []
    shadings: dict[int, _Shading] = {}  # by identity of the primitive, which many nodes may share
    for part, node in enumerate(nodes):
        skin = int(file.tree.skins[node])
        for primitive in file.meshes[int(file.tree.meshes[node])].primitives:
            if len(primitive.triangles) == 0:
                continue
            if skin >= 0 and primitive.joints is not None:
                baked = bindings.baked[skin]
                influences = _divided(primitive, bindings.slots[skin])
            else:
                joint, baked = bindings.rigid[node]
                n_vertices = len(primitive.positions)
                counts, joints = np.ones(n_vertices, np.int32), np.full(n_vertices, joint, np.int32)
                influences = Influences(counts, joints, np.ones(n_vertices))
            if id(primitive) not in shadings:
                shadings[id(primitive)] = _shading(primitive)
            sources, triangles, normals, is_flat = shadings[id(primitive)]
            kind: _Origin = "flat" if is_flat else "smooth"
            if primitive.normals is not None:
                kind = "file"
            if is_flat:
                influences = _of_rows(influences, sources)
            # A reflection reverses the triangles.
            if np.linalg.det(baked[:3, :3]) < 0.0:
                triangles = triangles[:, ::-1]
            pieces.append(
                Piece(node, part, primitive, baked, influences, sources, triangles, normals, kind)
            )
    return pieces


def _divided(primitive: Primitive, slots: Ints) -> Influences:
    """Return influences with sums of 1 (glTF 2.0, 3.7.3.1) of the skin's joints (M,)."""
    assert primitive.joints is not None and primitive.weights is not None
    weights = primitive.weights.astype(np.float64)
    sums = weights.sum(axis=1)
    # A vertex without weights follows its first slot, as in Blender and three.js.
    unbound = np.abs(sums) < _NO_SUM
    weights[unbound] = 0.0
    weights[unbound, :1] = 1.0
    weights /= np.where(unbound, 1.0, sums)[:, None]
    used = weights != 0.0
    deviations = np.abs(sums - 1.0)[~unbound]
    # Each of K weights is rounded to a multiple of 1 / 255.
    rounding = 0.5 / 255.0 * weights.shape[1] + 1e-6
    return Influences(
        np.count_nonzero(used, axis=1).astype(np.int32),
        slots[primitive.joints[used]],
        weights[used],
        float(deviations.max(initial=0.0)),
        int(np.count_nonzero(deviations > rounding)),
        unbound if unbound.any() else None,
    )


def _shading(primitive: Primitive) -> _Shading:
    """Return the normals of a primitive, split between its faces if the file has none."""
    if primitive.normals is None:
        return flat_shaded(primitive.positions, primitive.triangles)
    sources = np.arange(len(primitive.positions), dtype=np.int32)
    return sources, primitive.triangles, primitive.normals, False


def flat_shaded(positions: Floats, triangles: Ints) -> _Shading:
    """Split vertices between faces that are not coplanar, so that a cube has 24."""
    # A large mesh is shaded smoothly, as splitting could make it six times as large.
    if len(triangles) > _MOST_TRIANGLES:
        sources = np.arange(len(positions), dtype=np.int32)
        return sources, triangles, vertex_normals(positions, triangles), False
    normals = unit(area_vectors(positions, triangles))
    cells = np.rint(normals * _CELLS).astype(np.int64) + _CELLS
    side = 2 * _CELLS + 1
    # Faces with normals in the same of side^3 cells count as coplanar. A vertex and the cell of a
    # face at it make one number, and each distinct number becomes a vertex.
    directions = (cells[:, 0] * side + cells[:, 1]) * side + cells[:, 2]
    corners = triangles.ravel().astype(np.int64)
    pairs = corners * side**3 + np.repeat(directions, 3)
    unique, inverse = np.unique(pairs, return_inverse=True)
    unused = np.setdiff1d(np.arange(len(positions)), corners)
    sources = np.concatenate([unique // side**3, unused]).astype(np.int32)
    split = inverse.reshape(-1, 3).astype(np.int32)
    return sources, split, vertex_normals(positions[sources], split), True


def _of_rows(influences: Influences, rows: Ints) -> Influences:
    """Return the influences of the given vertices, which may repeat; the statistics stay."""
    starts = np.concatenate([[0], np.cumsum(influences.counts)])
    counts = influences.counts[rows]
    firsts = np.concatenate([[0], np.cumsum(counts)])
    index = np.repeat(starts[rows] - firsts[:-1], counts) + np.arange(firsts[-1])
    joints, weights = influences.joints[index], influences.weights[index]
    lone = None if influences.unweighted is None else influences.unweighted[rows]
    return replace(influences, counts=counts, joints=joints, weights=weights, unweighted=lone)


def mesh_of(file: NodeFile, nodes: list[int], pieces: list[Piece]) -> Mesh:
    """Return the mesh of a figure; primitives without an attribute get neutral values."""
    firsts = np.cumsum([0, *(piece.n_vertices for piece in pieces)])
    starts = zip(pieces, firsts, strict=False)
    triangles = np.concatenate([piece.triangles + first for piece, first in starts])
    counts = [len(piece.triangles) for piece in pieces]
    used = used_materials(pieces)
    slots = {material: slot for slot, material in enumerate(used)} | {-1: -1}
    coordinates = zip_longest(*(piece.primitive.uvs for piece in pieces))
    sets = (_filled(pieces, given, np.zeros(2)) for given in coordinates)
    uvs = tuple(values for values in sets if values is not None)
    views: tuple[PartView, ...] = tuple(file.part_views.get(node, "auto") for node in nodes)
    return Mesh(
        positions=np.concatenate([_positions(piece) for piece in pieces]),
        normals=np.concatenate(
            [piece.normals @ normal_matrix(piece) * normal_scales(piece) for piece in pieces]
        ),
        triangles=triangles.astype(np.int32),
        uvs=uvs[0] if uvs else None,
        other_uvs=uvs[1:],
        colors=_filled(pieces, [piece.primitive.colors for piece in pieces], np.ones(4)),
        materials=tuple(file.materials[material] for material in used),
        triangle_materials=np.repeat([slots[piece.primitive.material] for piece in pieces], counts),
        parts=tuple(part_name(file, node) for node in nodes),
        triangle_parts=np.repeat([piece.part for piece in pieces], counts),
        part_views=views if any(node in file.part_views for node in nodes) else (),
    )


def used_materials(pieces: list[Piece]) -> list[int]:
    """Return the materials of a figure, as indices into the file's materials."""
    return sorted({piece.primitive.material for piece in pieces} - {-1})


def part_name(file: NodeFile, node: int) -> str:
    """Return the name of a node's part: the name of the node or, if it has none, of its mesh."""
    return file.tree.names[node] or file.meshes[int(file.tree.meshes[node])].name


def _positions(piece: Piece) -> Floats:
    """Return the positions in binding space, p' = A p; equal ones stay equal."""
    positions = piece.primitive.positions[piece.sources]
    if np.array_equal(piece.baked, np.eye(4)):
        return positions
    # A matrix product may round equal rows differently, which would open seams.
    x, y, z = positions.T[:, :, None]
    right, up, back, shift = piece.baked[:3].T
    return np.asarray(x * right + y * up + z * back + shift, dtype=np.float64)


def normal_matrix(piece: Piece) -> Floats:
    """Return A^-1, (3, 3), which multiplies rows of normals: n' = A^-T n."""
    return np.asarray(np.linalg.inv(piece.baked[:3, :3]), dtype=np.float64)


def normal_scales(piece: Piece) -> Floats:
    """Return factors that give transformed normals the lengths they have in the file: (V, 1)."""
    moved = np.linalg.norm(piece.normals @ normal_matrix(piece), axis=1)
    lengths = np.linalg.norm(piece.normals, axis=1)
    scales: Floats = np.where(moved > 0.0, lengths / np.where(moved > 0.0, moved, 1.0), 1.0)
    return scales[:, None]


def tangents_of(pieces: list[Piece]) -> Floats | None:
    """Return the tangents in binding space, t' = A t; see ``FileRecord.tangents``."""
    rows = [_tangents(piece) for piece in pieces]
    if all(each is None for each in rows):
        return None
    return np.concatenate([
        np.zeros((piece.n_vertices, 4)) if each is None else each
        for piece, each in zip(pieces, rows, strict=True)
    ])  # fmt: skip


def _tangents(piece: Piece) -> Floats | None:
    read = piece.primitive.tangents
    # Tangents refer to the normals of the file.
    stored = None if read is None or piece.shading != "file" else read()
    return None if stored is None else moved_tangents(stored[piece.sources], piece.baked[:3, :3])


def _filled(pieces: list[Piece], given: Sequence[Floats | None], neutral: Floats) -> Floats | None:
    """Return the values of primitives per vertex, neutral where None; None if all lack them."""
    if all(values is None for values in given):
        return None
    rows = [
        np.tile(neutral, (piece.n_vertices, 1)) if values is None else values[piece.sources]
        for piece, values in zip(pieces, given, strict=True)
    ]
    return np.concatenate(rows)


def skin_of(file: NodeFile, pieces: list[Piece], inverse_bind: Floats) -> Skin:
    """Return the skin of a figure."""
    fractions = np.concatenate([_dqs_fractions(file, piece) for piece in pieces])
    none = [np.zeros(piece.n_vertices, dtype=np.bool_) for piece in pieces]
    lone = [piece.influences.unweighted for piece in pieces]
    unweighted = np.concatenate([b if a is None else a for a, b in zip(lone, none, strict=True)])
    counts = np.concatenate([piece.influences.counts for piece in pieces])
    return Skin(
        starts=np.concatenate([[0], np.cumsum(counts)]).astype(np.int32),
        joints=np.concatenate([piece.influences.joints for piece in pieces]),
        weights=np.concatenate([piece.influences.weights for piece in pieces]),
        inverse_bind=inverse_bind,
        dqs_fractions=fractions if fractions.any() else None,
        unweighted=unweighted if unweighted.any() else None,
    )


def _dqs_fractions(file: NodeFile, piece: Piece) -> Floats:
    """Return the fraction of DQS at each vertex of a piece: (V,)."""
    number = int(file.tree.skins[piece.node])
    skin = file.skins[number] if number >= 0 and piece.primitive.joints is not None else None
    if skin is not None and skin.method == "mix" and piece.primitive.dqs_fractions is not None:
        return piece.primitive.dqs_fractions[piece.sources]
    return np.full(piece.n_vertices, float(skin is not None and skin.method == "dqs"))
