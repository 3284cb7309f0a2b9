"""Meshes in glTF form: a primitive per material, vertices split at seams, morph targets."""

from __future__ import annotations

from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.exporters.gltf.document import INDICES, VERTICES, Document, named, text_of
from viewer.exporters.gltf.materials import Materials
from viewer.exporters.gltf.skin import Influences, Shape, influence_sets
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.file_record import Json
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.geometry.vectors import moved_tangents, unit
from viewer.rigs.mesh import Mesh, split_seams, vertex_normals
from viewer.rigs.skin import influence_counts

_POINTS = 0  # mode of a primitive without triangles
_LONG = 65535  # maximum number of vertices with 16-bit indices, the last of which is reserved
_NOT_UNIT = 1e-3  # tolerance for unit length; squares of normals may underflow or overflow
_WORST_CONDITION = 1e5  # maximum condition number of an inverse bind matrix that is applied
# Quantised attributes: largest values of normalised integers
EXTENSION = "KHR_mesh_quantization"
_SHORT, _WORD, _BYTE = 32767, 65535, 255


def add_mesh(
    encoding: Encoding,
    materials: Materials,
    part: Part,
    shape: Shape,
    influences: Influences | None,
    tangents: Floats | None = None,
) -> int:
    """Add a part of a figure's mesh with at least one vertex; return its index."""
    mesh, surface = shape.figure.require_mesh(), _surface(part, shape)
    document = encoding.document
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
    own = None if tangents is None else moved_tangents(tangents[part.sources], surface.linear)
    if own is not None and own[:, 3].all() and own[:, :3].any(axis=1).all():
        attributes["TANGENT"] = document.array(own, "VEC4", VERTICES)
    if part.joint < 0 and influences is not None:
        sets = [*influence_sets(influences, part.sources)]
        for number, (joints, weights) in enumerate(encoding.influences(sets)):
            attributes |= {f"JOINTS_{number}": joints, f"WEIGHTS_{number}": weights}
    item = named(part.mesh_name)
    shared: Json = {"attributes": attributes}
    record = shape.figure.record
    extras = None if record is None else record.mesh_extras.get(part.index)
    shapes = shape.figure.blend_shapes
    if shapes is not None and len(part.targets):
        # Normals are written with length 1, and their offsets at the same scale.
        lengths = surface.lengths
        scales = np.divide(1.0, lengths, out=np.zeros_like(lengths), where=lengths > 0.0)
        directions = shapes.direction_values()
        shared["targets"] = targets = []
        for row in shape.targets[part.targets]:
            offsets = directions[row][part.sources] @ surface.linear.T
            target = {"POSITION": encoding.offsets(offsets, part.joint < 0)}
            if shapes.normal_offsets is not None:
                normals = shapes.normal_values()[row][part.sources] @ np.linalg.inv(surface.linear)
                target["NORMAL"] = encoding.normal_offsets(normals * scales)
            targets.append(target)
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
    """Vertices of a part in the space of its node."""

    positions: Floats
    normals: Floats
    """Unit normals: (R, 3), like the positions."""
    lengths: Floats
    """Lengths of the figure's own normals: (R, 1)."""
    linear: Floats
    """From binding space to the space of the node: (3, 3)."""


def _surface(part: Part, shape: Shape) -> _Surface:
    mesh, skin = shape.figure.require_mesh(), shape.figure.skin
    positions, normals = mesh.positions[part.sources], _normals(mesh)[part.sources]
    lengths = np.linalg.norm(mesh.normals[part.sources], axis=1, keepdims=True)
    if part.joint < 0 or skin is None:
        return _Surface(positions, normals, lengths, np.eye(3))
    matrix = skin.inverse_bind[part.joint]
    linear = matrix[:3, :3]
    # With p' = M p = L p + t, a normal becomes n' = L^-T n, or as a row n L^-1. It is written with
    # length 1, so the figure's length takes the factor that offsets of normals need, too.
    turned = normals @ np.linalg.inv(linear)
    stretch = np.linalg.norm(turned, axis=1, keepdims=True)
    return _Surface(apply_transform(matrix, positions), turned / stretch, lengths * stretch, linear)


def _normals(mesh: Mesh) -> Floats:
    """Return unit normals; those that cannot be normalised are computed from the triangles."""
    with np.errstate(over="ignore", invalid="ignore"):
        normals = unit(mesh.normals)
        odd = ~(np.abs(np.linalg.norm(normals, axis=1) - 1.0) < _NOT_UNIT)
    if odd.any():
        normals[odd] = vertex_normals(mesh.positions, mesh.triangles)[odd]
    return normals


def _primitives(
    document: Document,
    materials: Materials,
    part: Part,
    surface: _Surface,
    shared: Json,
) -> list[Json]:
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


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Triangles of a mesh that become a glTF mesh with a node."""

    index: int
    """Index into the mesh's parts; -1 for triangles without a part, or for a whole mesh."""
    name: str
    mesh_name: str
    """Names of the node and of the mesh."""
    joint: int
    """Joint whose node contains the mesh, because all vertices follow it rigidly; -1 if a skin
    moves them."""
    sources: Ints
    uv_indices: Ints
    """(R,): vertex and texture coordinate of the figure that each written vertex copies."""
    triangles: Ints
    """(T, 3): indices into the written vertices."""
    materials: Ints
    """(T,): material of each triangle, -1 for none."""
    targets: NDArray[np.intp]
    """(M,): the part's morph targets, as indices into ``Shape.targets``."""
    target_names: tuple[str, ...]
    """Their names."""


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A mesh in a file, and the figure's vertices in it."""

    node: int
    """Its node."""
    part: Part
    """The part from which it was written."""
    decoding: Floats = field(default_factory=lambda: np.eye(4))
    """(4, 4): from positions in the file, which may be quantised, to the figure's."""


def parts_of(name: str, shape: Shape, influences: Influences | None) -> list[Part]:
    """Return the parts of a figure; a mesh without parts is one part, named ``name``."""
    figure, mesh = shape.figure, shape.figure.require_mesh()
    sources, uv_indices, triangles = split_seams(mesh)
    parts, taken = list[Part](), set[int]()
    for index, rows in _rows(mesh, triangles, len(sources)).items():
        places = np.full(len(sources), -1, dtype=np.int32)
        places[rows] = np.arange(len(rows), dtype=np.int32)
        chosen = mesh.part_indices == index
        # A part that follows the joint of its name only is on that joint's node, as in its file.
        joint = -1
        if influences is not None and index >= 0:
            joint = _joint_of(figure, influences, index, sources[rows])
        if joint in taken:
            joint = -1
        taken.add(joint)
        targets, names = _part_targets(shape, index, sources[rows])
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
    """Return each part's vertices; a vertex without triangles goes with the preceding one."""
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


def _part_targets(
    shape: Shape, index: int, sources: Ints
) -> tuple[NDArray[np.intp], tuple[str, ...]]:
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
        and shapes.direction_values()[shape.targets[target]][sources].any()
    ]
    labels = (given.get(int(shape.targets[target])) or names[target] for target in targets)
    return np.array(targets, dtype=np.intp), tuple(labels)


@dataclass(slots=True, eq=False)
class Encoding:
    """Writer of vertex attributes."""

    document: Document
    """Modified in place."""
    center: Floats = field(default_factory=lambda: np.zeros(3))
    reach: float = 1.0
    """(3,): quantised positions are (p - center) / reach, in -1 to 1."""
    is_quantized: bool = False
    """Whether attributes are integers."""
    errors: dict[str, float] = field(default_factory=dict)
    """Largest rounding error of each kind of attribute: ``positions`` in figure units, ``normals``
    in radians, ``uvs``, ``weights``."""

    @property
    def decoding(self) -> Floats:
        """T(center) S(reach): from stored positions to the figure's, (4, 4)."""
        matrix = np.eye(4)
        matrix[:3, :3] *= self.reach
        matrix[:3, 3] = self.center
        return matrix

    def positions(self, values: Floats, is_placed: bool = True) -> int:
        """Add positions (R, 3); those that ``decoding`` does not transform are not quantised."""
        if not (self.is_quantized and is_placed):
            return self.document.array(values, "VEC3", VERTICES, bounds=True)
        return self._lengths(values - self.center)

    def offsets(self, values: Floats, is_placed: bool = True) -> int:
        """Add offsets of positions (R, 3)."""
        if not (self.is_quantized and is_placed):
            return self.document.array(values, "VEC3", VERTICES, bounds=True)
        return self._lengths(values)

    def _lengths(self, values: Floats) -> int:
        stored = np.rint(values / self.reach * _SHORT).astype(np.int16)
        self._note("positions", np.abs(stored * (self.reach / _SHORT) - values))
        return self.document.integers(stored, "VEC3", True)

    def normals(self, values: Floats) -> int:
        """Add unit vectors (R, 3)."""
        if not self.is_quantized:
            return self.document.array(values, "VEC3", VERTICES)
        stored = np.rint(values * _SHORT).astype(np.int16)
        back = stored / np.linalg.norm(stored, axis=1, keepdims=True)
        self._note("normals", np.linalg.norm(back - values, axis=1))
        return self.document.integers(stored, "VEC3")

    def normal_offsets(self, values: Floats) -> int:
        """Add offsets of normals (R, 3); those beyond the range are not quantised."""
        if not self.is_quantized or np.abs(values).max(initial=0.0) > 1.0:
            return self.document.array(values, "VEC3", VERTICES)
        return self.document.integers(np.rint(values * _SHORT).astype(np.int16), "VEC3")

    def uvs(self, values: Floats) -> int:
        """Add texture coordinates (R, 2); repeating ones are not quantised."""
        if not self.is_quantized or values.min(initial=0.0) < 0.0 or values.max(initial=0.0) > 1.0:
            return self.document.array(values, "VEC2", VERTICES)
        stored = np.rint(values * _WORD).astype(np.uint16)
        self._note("uvs", np.abs(stored / _WORD - values))
        return self.document.integers(stored, "VEC2")

    def colors(self, values: Floats) -> int:
        """Add colours (R, 4), 0 to 1."""
        if not self.is_quantized:
            return self.document.array(values, "VEC4", VERTICES)
        bytes_ = np.rint(values * _BYTE)
        is_exact = np.abs(bytes_ / _BYTE - values).max(initial=0.0) < 1e-7
        stored = bytes_.astype(np.uint8) if is_exact else np.rint(values * _WORD).astype(np.uint16)
        return self.document.integers(stored, "VEC4")

    def influences(
        self, sets: list[tuple[NDArray[np.unsignedinteger], Floats]]
    ) -> list[tuple[int, int]]:
        """Add sets of joints and weights (R, 4); return their accessors."""
        if not self.is_quantized:
            return [
                (
                    self.document.array(joints, "VEC4", VERTICES),
                    self.document.array(weights, "VEC4", VERTICES),
                )
                for joints, weights in sets
            ]
        every = np.concatenate([weights for _, weights in sets], axis=1)
        stored = _summing(every)
        self._note("weights", np.abs(stored / _WORD - every))
        added = []
        for number, (joints, _) in enumerate(sets):
            own = stored[:, 4 * number : 4 * number + 4]
            used = np.where(own > 0, joints, 0).astype(joints.dtype)
            added.append(
                (
                    self.document.array(used, "VEC4", VERTICES),
                    self.document.integers(own, "VEC4"),
                )
            )
        return added

    def _note(self, kind: str, errors: Floats) -> None:
        self.errors[kind] = max(self.errors.get(kind, 0.0), float(errors.max(initial=0.0)))


def _summing(weights: Floats) -> NDArray[np.uint16]:
    """Return 16-bit weights that sum to 65535 exactly, as glTF requires (largest remainders)."""
    # Rounding down leaves ``missing`` units, fewer than there are weights: one for each of the
    # weights with the largest remainders, which ``rank`` counts from 0.
    exact = weights / weights.sum(axis=1, keepdims=True) * _WORD
    stored = np.floor(exact).astype(np.int64)
    missing = _WORD - stored.sum(axis=1)
    order = np.argsort(stored - exact, axis=1, kind="stable")
    rank = np.empty_like(order)
    np.put_along_axis(rank, order, np.broadcast_to(np.arange(order.shape[1]), order.shape), axis=1)
    return (stored + (rank < missing[:, None])).astype(np.uint16)


def quantized(document: Document, positions: Floats, offsets: list[Floats]) -> Encoding:
    """Return an encoding whose range contains positions (V, 3) and their offsets (V, 3)."""
    # Positions and offsets share one scale, because the node's matrix multiplies both. It is the
    # same for all axes, so that normals need no transform.
    low, high = positions.min(axis=0), positions.max(axis=0)
    most = max((float(np.abs(each).max(initial=0.0)) for each in offsets), default=0.0)
    reach = max(0.5 * float((high - low).max()), most)
    return Encoding(document, 0.5 * (low + high), reach or 1.0, is_quantized=True)
