"""Chains of spring joints: ``VRMC_springBone`` 1.0, to which ``secondaryAnimation`` is upgraded.

::

    VRMC_springBone (1.0)
        springs         joints (node, stiffness, dragForce, gravityPower, gravityDir, hitRadius),
                        center (node), colliderGroups; each joint points at the next one
        colliderGroups  colliders
        colliders       node, shape: sphere (offset, radius) or capsule (offset, tail, radius);
                        VRMC_springBone_extended_collider replaces the shape: also inside, or
                        plane (offset, normal)
    VRM.secondaryAnimation (0.x)
        boneGroups      bones (nodes), stiffiness, dragForce, gravityPower, gravityDir, hitRadius,
                        center (node), colliderGroups; all nodes below a bone belong to the chain,
                        each points at its first child, and the last one 7 cm further
        colliderGroups  node, colliders (offset, radius)
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import wording
from viewer.formats._scene_graph.content import NodeFile, NodeTree
from viewer.formats._source import Source
from viewer.formats._vrm.parts import is_index, list_in, part, rows_of, value_of
from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.rotation import quaternion_to_matrix
from viewer.rigs.hierarchy import path_to_root
from viewer.rigs.springs.spring_joints import INSIDE, OUTSIDE, PLANE, Colliders, Springs

_EXTENSION = "VRMC_springBone"
EXTENDED = "VRMC_springBone_extended_collider"
_DOWN = (0.0, -1.0, 0.0)

_END = 0.07  # distance from the last joint to the swinging point, metres
_Groups: TypeAlias = list[tuple[int, ...]]
"""Colliders of each group."""


@dataclass(frozen=True, slots=True)
class _SpringJoint:
    """One spring joint, and the settings of its chain."""

    node: int
    tail: Floats
    stiffness: float
    drag: float
    gravity: Floats
    radius: float
    center: int
    obstacles: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class _Shape:
    """A sphere, capsule or plane, as in ``Colliders``."""

    node: int
    offset: Floats
    tail: Floats
    radius: float
    kind: int = OUTSIDE


def read_springs(file: NodeFile, source: Source, ends: Mapping[int, Floats]) -> Springs | None:
    """Return the spring joints as node indices, or None; ``ends`` are those of an upgrade (3,)."""
    told = file.extensions.get(_EXTENSION)
    if not isinstance(told, dict):
        return None
    shapes, groups = _shapes(file, told, source)
    chains = []
    for index, spring in enumerate(list_in(told, "springs")):
        chain = _chain(file.tree, spring, groups, ends)
        if chain is None:
            source.warn(wording.SPRING, f"/extensions/{_EXTENSION}/springs/{index}")
        elif chain:
            chains.append(chain)
    found: dict[int, _SpringJoint] = {}
    for chain in chains:
        for joint in chain:
            found.setdefault(joint.node, joint)
    if not found:
        return None
    joints = [*found.values()]
    return Springs(
        joints=np.array([each.node for each in joints], np.int32),
        tails=np.array([each.tail for each in joints]),
        stiffness=np.array([each.stiffness for each in joints]),
        drags=np.array([each.drag for each in joints]),
        gravities=np.array([each.gravity for each in joints]),
        radii=np.array([each.radius for each in joints]),
        centers=np.array([each.center for each in joints], np.int32),
        colliders=Colliders(
            np.array([each.node for each in shapes], np.int32),
            np.array([each.offset for each in shapes]).reshape(-1, 3),
            np.array([each.tail for each in shapes]).reshape(-1, 3),
            np.array([each.radius for each in shapes]),
            np.array([each.kind for each in shapes], np.int32),
        ),
        obstacles=tuple(each.obstacles for each in joints),
        n_chains=len(chains),
    )


def _shapes(file: NodeFile, told: object, source: Source) -> tuple[list[_Shape], _Groups]:
    """Return the colliders, and the colliders of each group."""
    places: dict[int, int] = {}
    shapes: list[_Shape] = []
    for index, each in enumerate(list_in(told, "colliders")):
        extended = part(each, "extensions", EXTENDED, "shape")
        told_shape = part(each, "shape") if extended is None else extended
        shape = _shape(part(each, "node"), told_shape, file.tree.n_nodes)
        if shape is None:
            at = f"/extensions/{_EXTENSION}/colliders/{index}"
            source.warn(
                "G006.collider: invalid collider ignored: expected a node, and a sphere or a "
                "capsule",
                at,
            )
        else:
            places[index] = len(shapes)
            shapes.append(shape)
    groups = [list_in(each, "colliders") for each in list_in(told, "colliderGroups")]
    return shapes, [
        tuple(places[index] for index in group if isinstance(index, int) and index in places)
        for group in groups
    ]


def _shape(node: object, told: object, n_nodes: int) -> _Shape | None:
    """Return a collider, possibly an extended one; None if it is invalid."""
    kinds = [kind for kind in ("sphere", "capsule", "plane") if isinstance(part(told, kind), dict)]
    if not is_index(node, n_nodes) or len(kinds) != 1:
        return None
    given = part(told, kinds[0])
    offset = rows_of(part(given, "offset"), (0.0, 0.0, 0.0))
    tail = rows_of(part(given, "tail"), (0.0, 0.0, 0.0)) if kinds[0] == "capsule" else offset
    radius = value_of(part(given, "radius"), 0.0)
    if offset is None or tail is None or radius is None:
        return None
    if kinds[0] == "plane":
        normal = rows_of(part(given, "normal"), (0.0, 0.0, 1.0))
        if normal is None or not normal.any():
            return None
        return _Shape(node, offset, offset + normal, 0.0, PLANE)
    return _Shape(node, offset, tail, radius, INSIDE if part(given, "inside") is True else OUTSIDE)


def _chain(
    tree: NodeTree, spring: object, groups: _Groups, ends: Mapping[int, Floats]
) -> list[_SpringJoint] | None:
    """Return the joints of a chain that point at the next one; None if it is invalid."""
    joints = list_in(spring, "joints")
    nodes = [part(each, "node") for each in joints]
    if not all(is_index(node, tree.n_nodes + len(ends)) for node in nodes):
        return None
    # Each push is followed by restoring the length, which may move the point back into the
    # collider, so a second push by the same collider moves it further.
    chosen = [g for g in list_in(spring, "colliderGroups") if is_index(g, len(groups))]
    obstacles = tuple(index for group in chosen for index in groups[group])
    center = part(spring, "center")
    chain = []
    for told, node, following in zip(joints, nodes, nodes[1:], strict=False):
        tail = ends[following] if following in ends else _tail_between(tree, node, following)
        down = rows_of(part(told, "gravityDir"), _DOWN)
        values = [
            value_of(part(told, name), default)
            for name, default in (
                *(("stiffness", 1.0), ("dragForce", 0.5)),
                *(("gravityPower", 0.0), ("hitRadius", 0.0)),
            )
        ]
        if tail is None or down is None or None in values:
            return None
        stiffness, drag, power, radius = (float(value or 0.0) for value in values)
        if tail.any():
            at = center if is_index(center, tree.n_nodes) else -1
            chain.append(
                _SpringJoint(node, tail, stiffness, drag, power * down, radius, at, obstacles)
            )
    return chain


def _tail_between(tree: NodeTree, head: int, tail: int) -> Floats | None:
    """Return the origin of a node in the space of an ancestor; None if the node is not below it."""
    place, node = np.zeros(3), tail
    while node != head:
        if node < 0:
            return None
        matrix = _node_matrix(tree, node)
        place = matrix[:3, :3] @ place + matrix[:3, 3]
        node = int(tree.parents[node])
    return place


def end_below(tree: NodeTree, node: int) -> Floats | None:
    """Return the swinging point of the last node of a chain of version 0.x: (3,), in its space.

    It continues the line from the parent. None if that has no length, or the node is flat.
    """
    world, parent = _node_world(tree, node), int(tree.parents[node])
    away = world[:3, 3] - (_node_world(tree, parent)[:3, 3] if parent >= 0 else 0.0)
    length = float(np.linalg.norm(away))
    if length == 0.0 or np.linalg.det(world[:3, :3]) == 0.0:
        return None
    return np.asarray(np.linalg.solve(world[:3, :3], away * (_END / length)), dtype=np.float64)


def _node_world(tree: NodeTree, node: int) -> Floats:
    """Return the matrix from a node to the scene: (4, 4)."""
    matrix = np.eye(4)
    for each in path_to_root(tree.parents, node):
        matrix = _node_matrix(tree, each) @ matrix
    return matrix


def _node_matrix(tree: NodeTree, node: int) -> Floats:
    """Return the matrix from a node to its parent: (4, 4)."""
    if node in tree.matrices:
        return tree.matrices[node]
    matrix = np.eye(4)
    matrix[:3, :3] = quaternion_to_matrix(tree.rotations[node]) * tree.scales[node]
    matrix[:3, 3] = tree.translations[node]
    return matrix
