"""Meshes of a glTF document: their triangles, vertex attributes and morph targets.

Strips and fans become lists of triangles; points and lines are counted and reported. Primitives
that share their vertices get only those that their own triangles use.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import field
from functools import partial
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.errors import FormatError
from viewer.formats._scene_graph.content import MorphTargets, NodeMesh, NodeTree, Primitive
from viewer.formats._vrm.parts import list_in, part
from viewer.formats.gltf.document import Document
from viewer.formats.gltf.draco import decoded_primitive
from viewer.formats.gltf.elements import Element, Table
from viewer.phrases import counted, listed
from viewer.rigs.arrays import Bools, Floats, Ints

_LIST, _STRIP, _FAN = 4, 5, 6
_TRIANGLES = (_LIST, _STRIP, _FAN)  # all other modes draw points or lines
_MODES = range(7)

_MOST_UVS = 8  # maximum number of texture coordinate sets
_NUMBERED = re.compile(r"([A-Z]+)_(0|[1-9][0-9]{0,3})")  # name and set of an attribute
_Number = TypeVar("_Number", np.float64, np.int64)


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
    """Return all meshes."""
    table = document.table("meshes")
    reading = _Reading(document, _users(table))
    empty = NodeMesh("", ())
    meshes = []
    for index in range(len(table)):
        meshes.append(document.kept(partial(_mesh, reading, table[index]), empty))
    if reading.n_undrawn:
        document.source.warn(
            "F007.gltf-undrawn: {n} of points or lines not drawn",
            reading.undrawn,
            n=counted(reading.n_undrawn, "primitive"),
        )
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
        mesh.warn("G002.no-primitives: mesh without primitives")
    read = (_primitive(reading, primitives[place]) for place in range(len(primitives)))
    return _mesh_of(mesh, (primitive for primitive in read if primitive is not None))


def _mesh_of(mesh: Element, read: Iterable[Primitive]) -> NodeMesh:
    primitives = mesh.table("primitives")
    # All primitives must have the same number of morph targets.
    counts = [len(primitives[place].table("targets")) for place in range(len(primitives))]
    for place, found in enumerate(counts):
        if found != counts[0]:
            raise primitives[place].fault(
                "F002.gltf-targets: expected {expected} as in the first primitive, found {found}",
                "targets",
                expected=counted(counts[0], "morph target"),
                found=found,
            )
    count = counts[0] if counts else 0
    return NodeMesh(
        mesh.text("name"),
        tuple(read),
        _target_names(mesh, primitives, count),
        _default_weights(mesh, count),
        mesh.values.get("extras"),
    )


def read_vertices(document: Document, mesh: int) -> NodeMesh:
    """Return a mesh as the vertices that its primitives share, without triangles and looks."""
    element = document.table("meshes")[mesh]
    primitive = element.table("primitives")[0]
    told = primitive.part("attributes")
    assert told is not None  # a mesh that this program wrote
    position = told.required_index("POSITION", len(document.accessors), "accessors")
    attributes = _Attributes(document, told, document.accessors.count(position))
    joints, weights = _read_influences(attributes)
    vertices = Primitive(
        positions=_read_positions(attributes),
        triangles=np.zeros((0, 3), dtype=np.int32),
        joints=joints,
        weights=weights,
        targets=_offsets(attributes, primitive.table("targets"), "POSITION"),
    )
    return _mesh_of(element, [vertices])


def _primitive(reading: _Reading, primitive: Element) -> Primitive | None:
    """Return a primitive; None if it draws no triangles."""
    mode = primitive.choice("mode", _MODES, _LIST)
    element = primitive.part("attributes")
    if element is None:
        raise primitive.wrong("attributes", "an object")
    if mode not in _TRIANGLES:
        reading.n_undrawn += 1
        reading.undrawn = reading.undrawn or primitive.pointer
        return None
    if not element.has("POSITION"):
        # This is valid: an unsupported extension may provide the vertices.
        element.warn("G002.no-positions: no POSITION: not drawn")
        return None
    document = reading.document
    position = element.index("POSITION", len(document.accessors), "accessors")
    count = document.accessors.count(position)
    compressed = decoded_primitive(document, primitive)
    if compressed is not None:
        count = len(compressed.attributes.get("POSITION", range(count)))
        triangles = _read_triangles(document, primitive, count, compressed.triangles)
        attributes = _Attributes(document, element, count, None, compressed.attributes)
    else:
        triangles, rows = _read_triangles(document, primitive, count), None
        if reading.users[position] > 1:
            document.spend(count, primitive.pointer)
            rows, triangles = _used(triangles, count)
        attributes = _Attributes(document, element, count, rows)
    positions = _read_positions(attributes)
    joints, weights = _read_influences(attributes)
    targets, normal_targets = _read_targets(attributes, primitive.table("targets"))
    n_materials = len(document.table("materials"))
    return Primitive(
        positions=positions,
        triangles=triangles,
        normals=_read_normals(attributes),
        tangents=_tangents_of(attributes),
        uvs=_read_uvs(attributes),
        colors=_read_colors(attributes),
        joints=joints,
        weights=weights,
        material=primitive.index("material", n_materials, "materials"),
        targets=targets,
        normal_targets=normal_targets,
        pointer=primitive.pointer,
    )


def _used(triangles: Ints, count: int) -> tuple[Ints | None, Ints]:
    """Return the vertices that triangles use, and the triangles with indices into them."""
    used = np.zeros(count, dtype=np.bool_)
    used[triangles] = True
    if used.all():
        return None, triangles
    numbers = np.cumsum(used, dtype=np.int32) - 1
    return np.nonzero(used)[0].astype(np.int32), numbers[triangles]


@dataclass(frozen=True, slots=True, eq=False)
class _Attributes:
    """Attributes of a primitive, or of one of its morph targets."""

    document: Document
    """The document."""
    element: Element
    """Accessor indices by name."""
    n_vertices: int
    """Number of elements that each accessor must have."""
    rows: Ints | None = None
    """Vertices to read, (V,), if other primitives use the remaining ones; None for all."""
    decoded: Mapping[str, NDArray[np.number]] = field(default_factory=dict)
    """Components of the attributes that are compressed with Draco."""

    @property
    def n_rows(self) -> int:
        """Number of vertices that are read, V."""
        return self.n_vertices if self.rows is None else len(self.rows)

    def accessor(self, name: str) -> int:
        """Return the index of an attribute's accessor, -1 if the attribute is missing."""
        accessors = self.document.accessors
        index = self.element.index(name, len(accessors), "accessors")
        if index < 0:
            return index
        # The counts of accessors may be wrong if the data are compressed.
        decoded, expected = self.decoded.get(name), self.n_vertices
        found = accessors.count(index) if decoded is None else len(decoded)
        if found != expected:
            raise self.element.fault(
                "F002.gltf-vertices: expected {expected} as in POSITION, found {found}",
                name,
                expected=counted(expected, "element"),
                found=found,
            )
        return index

    def floats(self, name: str, *kinds: str) -> Floats | None:
        """Return an attribute, (V, C); None if it is missing; errors as of ``accessor``."""
        return self._values(self.document.accessors.floats, name, kinds)

    def stored(self, name: str, *kinds: str) -> NDArray[np.number] | None:
        """Return finite numbers as in the file, not copied; None if they need decoding."""
        index = self.accessor(name)
        if index < 0 or name in self.decoded:
            return None
        values = self.document.accessors.stored(index, kinds, self.element.at(name))
        return values if values is not None and _is_finite(values) else None

    def fractions(self, name: str, *kinds: str) -> Floats | None:
        """Return an attribute of normalised integers; shape and errors as for ``floats``."""
        return self._values(self.document.accessors.fractions, name, kinds)

    def integers(self, name: str, *kinds: str) -> NDArray[np.int64] | None:
        """Return an attribute of whole numbers; shape and errors as for ``floats``."""
        return self._values(self.document.accessors.integers, name, kinds)

    def _values(
        self, read: Callable[..., NDArray[_Number]], name: str, kinds: tuple[str, ...]
    ) -> NDArray[_Number] | None:
        index = self.accessor(name)
        if index < 0:
            return None
        return read(index, kinds, self.element.at(name), self.rows, self.decoded.get(name))

    def sets(self, name: str) -> list[int]:
        """Return the set numbers of attributes such as ``TEXCOORD_0``, in ascending order."""
        found = (_NUMBERED.fullmatch(key) for key in self.element.values)
        return sorted(int(match[2]) for match in found if match and match[1] == name)

    def vertex(self, row: int) -> int:
        """Return the index in the file of a vertex that was read."""
        return row if self.rows is None else int(self.rows[row])

    def finite(self, name: str, values: Floats) -> Floats:
        """Return values with non-finite ones set to 0 and a warning recorded."""
        bad = _not_finite(values)
        if not bad.any():
            return values
        first = int(bad.argmax())
        self.element.warn(
            "G002.finite: {n} with non-finite values (first: vertex {vertex}): set to 0",
            name,
            n=counted(int(bad.sum()), "vertex"),
            vertex=self.vertex(first),
        )
        return np.where(bad[:, None], 0.0, values)


def _read_triangles(
    document: Document,
    primitive: Element,
    n_vertices: int,
    decoded: NDArray[np.int64] | None = None,
) -> Ints:
    """Return the triangles of a primitive, (T, 3) int32; ``decoded``: those of Draco, if any."""
    if decoded is not None:
        return _existing(document, primitive, decoded.reshape(-1), n_vertices).reshape(-1, 3)
    corners = _corners(document, primitive, n_vertices)
    mode = primitive.whole("mode", _LIST)
    if mode == _STRIP:
        return _strip(corners)
    if mode == _FAN:
        return _fan(corners)
    if len(corners) % 3:
        primitive.warn(
            "G002.corners: {n} vertex indices, not a multiple of 3: the last {left} ignored",
            "indices",
            n=len(corners),
            left=len(corners) % 3,
        )
    return corners[: len(corners) // 3 * 3].reshape(-1, 3)


def _corners(document: Document, primitive: Element, n_vertices: int) -> Ints:
    """Return vertex indices in drawing order: (N,) int32."""
    accessors = document.accessors
    index = primitive.index("indices", len(accessors), "accessors")
    if index < 0:
        document.spend(n_vertices * 4, primitive.pointer)
        return np.arange(n_vertices, dtype=np.int32)
    corners = accessors.integers(index, ("SCALAR",), primitive.at("indices"))[:, 0]
    return _existing(document, primitive, corners, n_vertices)


def _existing(
    document: Document, primitive: Element, corners: NDArray[np.int64], n_vertices: int
) -> Ints:
    """Return vertex indices after checking that all exist: (N,) int32."""
    if len(corners) and int(corners.max()) >= n_vertices:
        bad = corners >= n_vertices
        entry = int(bad.argmax())
        document.source.refuse(
            "F002.gltf-corner: index {entry}: expected a vertex index below {vertices}, found "
            "{found}",
            primitive.at("indices"),
            entry=entry,
            vertices=n_vertices,
            found=int(corners[entry]),
        )
        corners = np.where(bad, 0, corners)
    return corners.astype(np.int32)


def _strip(corners: Ints) -> Ints:
    """Return the triangles of a strip, every other one reversed, except for degenerate ones."""
    if len(corners) < 3:
        return np.zeros((0, 3), dtype=np.int32)
    triangles = np.column_stack([corners[:-2], corners[1:-1], corners[2:]])
    triangles[1::2] = triangles[1::2][:, [0, 2, 1]]
    # Degenerate triangles connect parts of a strip (glTF 2.0, 3.7.2.1).
    a, b, c = triangles.T
    return triangles[(a != b) & (b != c) & (c != a)]


def _fan(corners: Ints) -> Ints:
    """Return the triangles of a fan: 0 1 2 3 are (1, 2, 0), (2, 3, 0) (glTF 2.0, 3.7.2.1)."""
    if len(corners) < 3:
        return np.zeros((0, 3), dtype=np.int32)
    center = np.full(len(corners) - 2, corners[0])
    return np.column_stack([corners[1:-1], corners[2:], center])


def _read_positions(attributes: _Attributes) -> Floats:
    """Return the positions, (V, 3); they must exist and be finite."""
    positions = attributes.floats("POSITION", "VEC3")
    if positions is None:
        raise attributes.element.wrong("POSITION", "the index of an accessor")
    bad = _not_finite(positions)
    if bad.any():
        vertex, pointer = attributes.vertex(int(bad.argmax())), attributes.element.at("POSITION")
        source, n = attributes.element.source, int(bad.sum())
        source.refuse(
            "F003.gltf-positions: expected finite positions, found {n} non-finite ones (first: "
            "vertex {vertex})",
            pointer,
            n=n,
            vertex=vertex,
        )
        positions = np.where(bad[:, None], 0.0, positions)
    return positions


def _read_normals(attributes: _Attributes) -> Floats | None:
    """Return the normals: (V, 3); None if there are none."""
    normals = attributes.floats("NORMAL", "VEC3")
    return None if normals is None else attributes.finite("NORMAL", normals)


def _tangents_of(attributes: _Attributes) -> Callable[[], Floats | None] | None:
    """Return a reader of tangents (V, 4), which are only written back; None if there are none."""
    if not attributes.element.has("TANGENT"):
        return None

    def read() -> Floats | None:
        try:
            rows = attributes.floats("TANGENT", "VEC4")
        except FormatError:  # lint reports it
            return None
        return None if rows is None or _not_finite(rows).any() else rows

    return read


def _read_uvs(attributes: _Attributes) -> tuple[Floats, ...]:
    """Return the texture coordinates, each (V, 2), with v = 0 at the bottom row of an image."""
    numbers = [number for number in attributes.sets("TEXCOORD") if number < _MOST_UVS]
    found = []
    for number in range(max(numbers, default=-1) + 1):
        name = f"TEXCOORD_{number}"
        uvs = attributes.floats(name, "VEC2")
        if uvs is None:
            # Materials refer to sets by number, so gaps in the numbers are preserved.
            uvs = np.zeros((attributes.n_rows, 2))
        uvs = attributes.finite(name, uvs)
        found.append(np.column_stack([uvs[:, 0], 1.0 - uvs[:, 1]]))
    return tuple(found)


def _read_colors(attributes: _Attributes) -> Floats | None:
    """Return the vertex colours, linear with opacity: (V, 4); None if there are none."""
    colors = attributes.fractions("COLOR_0", "VEC3", "VEC4")
    if colors is None:
        return None
    colors = attributes.finite("COLOR_0", colors)
    if colors.shape[1] == 4:
        return colors
    return np.column_stack([colors, np.ones(len(colors))])


def _is_finite(values: NDArray[np.number]) -> bool:
    """Return whether all numbers are finite and the sum of their squares does not overflow."""
    flat = values.ravel()
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.isfinite(np.dot(flat, flat)))


def _not_finite(values: Floats) -> Bools:
    """Return a mask of the rows that are not finite: (V,)."""
    # The sum is quick to compute; rows are tested only if it is not finite.
    with np.errstate(invalid="ignore"):
        if np.isfinite(values.sum()):
            return np.zeros(len(values), dtype=np.bool_)
    return np.asarray(~np.isfinite(values).all(axis=1))


def _read_influences(attributes: _Attributes) -> tuple[Ints, Floats] | tuple[None, None]:
    """Return joints (V, K), 0 where the weight is 0, and weights (V, K); None if there are none."""
    numbers = attributes.sets("JOINTS")
    without = sorted(set(numbers) ^ set(attributes.sets("WEIGHTS")))
    if without:
        attributes.element.warn(
            "G004.influence-sets: joints without weights, or weights without joints, in set "
            "{sets}: ignored",
            sets=listed(without),
        )
    joints, weights = [], []
    for number in numbers:
        if number in without:
            continue
        joint_set = attributes.integers(f"JOINTS_{number}", "VEC4")
        weight_set = attributes.fractions(f"WEIGHTS_{number}", "VEC4")
        if joint_set is not None and weight_set is not None:
            joints.append(joint_set)
            weights.append(_finite_weights(attributes, number, weight_set))
    if not joints:
        return None, None
    all_weights = np.concatenate(weights, axis=1)
    all_joints = np.where(all_weights == 0.0, 0, np.concatenate(joints, axis=1))
    # Indices are at most 65535 in valid files; larger ones are reported with the skin.
    return np.minimum(all_joints, np.iinfo(np.int32).max).astype(np.int32), all_weights


def _finite_weights(attributes: _Attributes, number: int, weights: Floats) -> Floats:
    """Return weights; non-finite ones are errors, and become 0 if errors are only recorded."""
    bad = ~np.isfinite(weights)
    if bad.any():
        row, column = (int(axis[0]) for axis in np.nonzero(bad))
        source, pointer = attributes.element.source, attributes.element.at(f"WEIGHTS_{number}")
        vertex, found = attributes.vertex(row), float(weights[row, column])
        n = int(bad.sum())
        source.refuse(
            "W003.gltf-weights: expected finite weights, found {n} non-finite ones (first: "
            "{found} at vertex {vertex})",
            pointer,
            n=n,
            vertex=vertex,
            found=found,
        )
        weights = np.where(bad, 0.0, weights)
    return weights


def _read_targets(
    attributes: _Attributes, targets: Table
) -> tuple[MorphTargets | None, MorphTargets | None]:
    """Return the offsets of positions and normals of a primitive; None if there are none."""
    if not len(targets):
        return None, None
    offsets = _offsets(attributes, targets, "POSITION")
    if offsets is None:
        offsets = MorphTargets(attributes.n_rows, [None] * len(targets))
    return offsets, _offsets(attributes, targets, "NORMAL")


def _offsets(attributes: _Attributes, targets: Table, name: str) -> MorphTargets | None:
    """Return the offsets of one attribute; None if no target has that attribute."""
    used = [place for place in range(len(targets)) if targets[place].has(name)]
    if not used:
        return None
    document, rows = attributes.document, attributes.rows
    # Limit the size as if all vertices moved: some uses need an offset for each vertex.
    document.spend(len(targets) * attributes.n_rows * 3 * 8, targets.pointer)
    found: list[NDArray[np.number] | None] = [None] * len(targets)
    for place in used:
        target = _Attributes(document, targets[place], attributes.n_vertices)
        values: NDArray[np.number] | None = target.stored(name, "VEC3")
        if values is None:
            whole = target.floats(name, "VEC3")
            values = None if whole is None else target.finite(name, whole)
        found[place] = values
    return MorphTargets(attributes.n_rows, found, rows)


def _target_names(mesh: Element, primitives: Table, count: int) -> tuple[str, ...]:
    """Return the names of the morph targets, stated in any of three places; empty without names."""
    candidates = [list_in(mesh.values, "extras", "targetNames")]
    for place in range(len(primitives)):
        targets = primitives[place].table("targets")
        candidates += [
            list_in(primitives[place].values, "extras", "targetNames"),
            [part(item, "extras", "name") for item in targets.items],
        ]
    for names in candidates:
        if len(names) == count and any(type(name) is str and name for name in names):
            return tuple(name if type(name) is str else "" for name in names)
    return ("",) * count


def _default_weights(mesh: Element, count: int) -> Floats:
    """Return the default weights of the morph targets: (S,)."""
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
        element.warn(
            "G002.weights: expected {expected}, one per morph target, found {found}",
            "weights",
            expected=counted(count, "weight"),
            found=len(weights),
        )
    return np.concatenate([weights[:count], np.zeros(max(0, count - len(weights)))])
