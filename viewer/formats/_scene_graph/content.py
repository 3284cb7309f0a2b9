"""Contents of a file of nodes, as its reader returns them before figures are created.

Nothing is converted: names, transforms, weights and keys are as in the file, in its unit and axes.
Readers guarantee that indices are valid, numbers are finite, and the parents form a forest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import field
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Phrase
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.constraints.constraint import Constraint
from viewer.rigs.file_record import Json, StoredTextures
from viewer.rigs.geometry.vectors import Up
from viewer.rigs.material import Material
from viewer.rigs.mesh import PartView
from viewer.rigs.motion.transform_clip import Interpolation, TransformPath
from viewer.rigs.springs.spring_joints import Springs

REACH = 1e18
"""Largest coordinate that can be drawn: the squares of lengths must fit into single precision."""


@dataclass(frozen=True, slots=True, eq=False)
class NodeFile:
    """Everything in a file of nodes."""

    name: str
    """The file's name without its suffix."""
    tree: NodeTree
    """All nodes."""
    roots: tuple[int, ...]
    """Root nodes of the scene that is shown."""
    meshes: tuple[NodeMesh, ...] = ()
    skins: tuple[NodeSkin, ...] = ()
    materials: tuple[Material, ...] = ()
    animations: tuple[NodeAnimation, ...] = ()
    cameras: tuple[NodeCamera, ...] = ()
    """In file order; referred to by index."""
    up: Up = "y"
    """Up axis of the file."""
    unit: str = "m"
    """Unit of length, a key of ``viewer.rigs.units.METRES``; empty if unknown."""
    extensions: Mapping[str, Any] = field(default_factory=dict)
    """Parsed JSON of the root's extensions, such as ``VRMC_vrm``."""
    extras: Any = None
    """Application data of the root, as parsed from JSON; None if there is none."""
    asset: Mapping[str, Any] = field(default_factory=dict)
    """Generator, copyright and the like."""
    scene: Mapping[str, Any] = field(default_factory=dict)
    """Name and application data of the scene that is shown, as parsed from JSON."""
    unkept: Callable[[], tuple[str, ...]] = tuple
    """Returns the members of the file that are not read, such as ``images.extras``."""
    lost_nodes: tuple[str, ...] = ()
    """Names of the nodes that are neither joints, meshes nor cameras."""
    contents: Callable[[], tuple[Phrase, ...]] = tuple
    """Returns what the file holds, as parts of a message; empty if unknown."""
    humanoid: Mapping[str, int] = field(default_factory=dict)
    """Node of each human bone, by its name in VRM 1.0; empty if the file states none."""
    expressions: tuple[NodeExpression, ...] = ()
    """Facial expressions."""
    constraints: tuple[Constraint, ...] = ()
    """Nodes (instead of joints) that follow others, in the order of evaluation."""
    part_views: Mapping[int, PartView] = field(default_factory=dict)
    """The views in which the meshes of some nodes are drawn."""
    springs: Springs | None = None
    """Spring nodes (instead of joints)."""
    named_nodes: frozenset[int] = frozenset()
    """Further nodes that must become joints, because extensions refer to them."""
    toon: Mapping[int, Json] = field(default_factory=dict)
    """Toon and unlit extensions of materials by index, as parsed from JSON."""
    old_members: tuple[str, ...] | None = None
    """Members of a VRM 0.x file that VRM 1.0 cannot hold; None for other files."""
    textures: StoredTextures | None = None
    """Textures as the file lists them."""
    facts: tuple[tuple[str, str], ...] = ()
    """Further properties for ``viewer info``, each a heading and a text."""
    has_pointers: bool = False
    """Whether elements have JSON pointers, such as ``/nodes/3``."""


@dataclass(frozen=True, slots=True, eq=False)
class NodeTree:
    """All nodes of a file, in file order, as parallel arrays."""

    names: tuple[str, ...]
    """As in the file; may repeat or be empty."""
    parents: Ints
    """-1 for a root; a parent may come after its children: (N,) int32."""
    translations: Floats
    rotations: Floats
    scales: Floats
    """Local transform T R S, unit quaternions (x, y, z, w): (N, 3), (N, 4), (N, 3)."""
    meshes: Ints
    skins: Ints
    cameras: Ints
    """Indices of each node's mesh, skin and camera, -1 for none: (N,) int32."""
    matrices: Mapping[int, Floats] = field(default_factory=dict)
    """Local matrices of nodes that shear and therefore cannot be expressed as T R S, (4, 4). Their
    translation, rotation and scale are those of the identity."""
    shape_weights: Mapping[int, Floats] = field(default_factory=dict)
    """Morph target weights of the nodes that override those of their mesh: (S,)."""
    extras: Mapping[int, Any] = field(default_factory=dict)
    extensions: Mapping[int, Any] = field(default_factory=dict)
    """Application data and extensions by node, as parsed from JSON."""

    @property
    def n_nodes(self) -> int:
        """Number of nodes, N."""
        return len(self.names)

    def with_mesh(self, mesh: int) -> list[int]:
        """Return the nodes that show a mesh."""
        return np.flatnonzero(self.meshes == mesh).tolist()


@dataclass(frozen=True, slots=True, eq=False)
class NodeMesh:
    """Primitives that share one name and one list of morph targets."""

    name: str
    """As in the file."""
    primitives: tuple[Primitive, ...]
    """In file order; empty if the file has only points or lines."""
    target_names: tuple[str, ...] = ()
    """Names of the morph targets; empty strings without a name."""
    shape_weights: Floats = field(default_factory=lambda: np.zeros(0))
    """Default weights of the morph targets: (S,)."""
    extras: Any = None
    """Application data, as parsed from JSON; None if there is none."""


@dataclass(frozen=True, slots=True, eq=False)
class Primitive:
    """Triangles with one material; no other primitive uses the vertices."""

    positions: Floats
    """Mesh space, file units: (V, 3)."""
    triangles: Ints
    """Counter-clockwise from outside: (T, 3) int32."""
    normals: Floats | None = None
    """(V, 3); None if the file has none: the surface is flat shaded (glTF) or smoothed by the
    importer."""
    uvs: tuple[Floats, ...] = ()
    """Texture coordinate sets, v = 0 at the bottom row of the image: (V, 2)."""
    colors: Floats | None = None
    """Linear vertex colours with opacity, which multiply the material's base colour: (V, 4)."""
    joints: Ints | None = None
    weights: Floats | None = None
    """(V, K) int32, (V, K); influences of all sets in one table: indices into the skin's joints.
    Weights are as stored, unused slots are 0."""
    dqs_fractions: Floats | None = None
    """Fraction of dual quaternion skinning of each vertex, for skins with the method ``"mix"``:
    (V,)."""
    material: int = -1
    """Index into ``NodeFile.materials``, -1 for none."""
    targets: MorphTargets | None = None
    """Offsets of the positions for each morph target of the mesh."""
    normal_targets: MorphTargets | None = None
    """Offsets of the normals; None if the file has none."""
    pointer: str = ""
    """JSON pointer to it; empty for files without JSON."""
    tangents: Callable[[], Floats | None] | None = None
    """Returns the directions of u in mesh space and the signs of the directions of v, (V, 4), or
    None if they are invalid."""


Moved: TypeAlias = tuple[NDArray[np.intp], Floats]


class MorphTargets:
    """Offsets of V positions or normals for S morph targets, converted when first used.

    ``offsets``: S of (V, 3) as in the file, of any float type; None if a target moves nothing.
    ``rows``: vertices of the offsets that are used; all if omitted.
    """

    __slots__ = ("_parts", "_rows", "n_vertices")

    def __init__(
        self,
        n_vertices: int,
        offsets: Iterable[NDArray[np.number] | None],
        rows: NDArray[np.integer] | None = None,
    ) -> None:
        self.n_vertices, self._rows = n_vertices, rows
        self._parts: list[NDArray[np.number] | Moved | None] = [*offsets]

    def __len__(self) -> int:
        return len(self._parts)

    def moved(self, target: int) -> Moved:
        """Return the vertices that a target moves, and their offsets: (M,), (M, 3)."""
        part = self._parts[target]
        if not isinstance(part, tuple):
            self._parts[target] = part = self._compressed(part)
        return part

    def _compressed(self, offsets: NDArray[np.number] | None) -> Moved:
        if offsets is None:
            return np.zeros(0, dtype=np.intp), np.zeros((0, 3))
        offsets = offsets if self._rows is None else offsets[self._rows]
        x, y, z = offsets.T
        vertices = np.flatnonzero((x != 0.0) | (y != 0.0) | (z != 0.0))
        return vertices, offsets[vertices].astype(np.float64)

    def weighted(self, weights: Floats) -> Floats:
        """Return the sum of all targets, w_s d_s: (V, 3)."""
        total = np.zeros((self.n_vertices, 3))
        for target in np.flatnonzero(weights).tolist():
            vertices, offsets = self.moved(target)
            if len(vertices) == self.n_vertices:
                total += weights[target] * offsets
            else:
                total[vertices] += weights[target] * offsets
        return total

    def dense(self) -> Floats:
        """Return the offsets of all vertices: (S, V, 3)."""
        result = np.zeros((len(self), self.n_vertices, 3))
        for target in range(len(self)):
            vertices, offsets = self.moved(target)
            result[target, vertices] = offsets
        return result


@dataclass(frozen=True, slots=True, eq=False)
class NodeSkin:
    """Joints that deform meshes."""

    name: str
    """As in the file."""
    joints: Ints
    """Node of each joint: (M,) int32."""
    inverse_bind: Floats
    """Mesh-to-joint matrices at bind time, (M, 4, 4); identities if the file has none."""
    method: Literal["lbs", "dqs", "mix"] = "lbs"
    """Skinning method requested by the file."""


@dataclass(frozen=True, slots=True, eq=False)
class NodeAnimation:
    """A named animation, whose keys are read when it is first played."""

    name: str
    """As in the file; may repeat or be empty."""
    start: float
    end: float
    """Seconds of the first and the last key."""
    nodes: frozenset[int]
    """Nodes that it moves."""
    read: Callable[[], tuple[NodeChannel, ...]]
    """Returns the channels; called at most once, may raise a ``FormatError``."""
    pointer: str = ""
    """JSON pointer to it; empty for files without JSON."""
    extras: Any = None
    """Application data, as parsed from JSON; None if there is none."""
    rate: float | None = None
    """Frames per second that the file states; None if it states none."""


@dataclass(frozen=True, slots=True, eq=False)
class NodeChannel:
    """Keys of one property of one node; see ``viewer.rigs.motion.transform_clip``."""

    node: int
    """Node that moves."""
    path: TransformPath
    """``"translation"``, ``"rotation"``, ``"scale"`` or ``"weights"``."""
    times: Floats
    """Seconds, increasing: (N,)."""
    values: Floats
    """C = 3, 4 (quaternions, not necessarily of unit length), 3, or S: (N, C)."""
    interpolation: Interpolation = "linear"
    """``"step"``, ``"linear"`` or ``"cubic"``."""
    tangents: Floats | None = None
    """Incoming and outgoing slopes per second, (N, 2, C); only for ``"cubic"``."""
    key_times: Floats | None = None
    """Seconds of the file's own keys, if the reader added others between them: (K,)."""


@dataclass(frozen=True, slots=True, eq=False)
class NodeCamera:
    """A perspective or orthographic camera that looks along -z of its node, y up."""

    name: str
    """As in the file."""
    vertical_angle: float | None
    """Vertical field of view in radians; None for an orthographic camera."""
    aspect: float | None = None
    """Width divided by height, if the file specifies it."""
    height: float = 0.0
    """Height of an orthographic camera's view, file units."""
    near: float | None = None
    far: float | None = None
    """Distances of the clipping planes, file units; None if there is none."""


@dataclass(frozen=True, slots=True, eq=False)
class NodeExpression:
    """A facial expression: a weighted sum of morph targets; see ``viewer.rigs.expressions``."""

    name: str
    """As in the file."""
    binds: tuple[tuple[int, int, float], ...]
    """Node, morph target of its mesh, and the weight of that target at weight 1."""
    is_binary: bool = False
    """Whether it is always either fully on or off."""
    kind: str = ""
    """Key of ``PROCEDURAL``; empty for other expressions."""
    overrides: Mapping[str, str] = field(default_factory=dict)
    """Entry of ``OVERRIDES`` for each key of ``PROCEDURAL``."""
    materials: tuple[tuple[int, str, Floats], ...] = ()
    """Material, kind and target of each change of a material; see ``MaterialBinds``."""
    preset: str = ""
    """Name in VRM 1.0; empty if there is none."""
