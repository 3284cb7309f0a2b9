"""Spring chains of VRM 0.x, ``VRM.secondaryAnimation``.

::

    boneGroups      bones (nodes), stiffiness, dragForce, gravityPower, gravityDir, hitRadius,
                    center (node), colliderGroups; all nodes below a bone belong to the chain, each
                    points at its first child, and the last one 7 cm further
    colliderGroups  node, colliders (offset, radius)

Vectors are in Unity's axes, whose z axis is reversed.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from viewer.formats._nodes.content import NodeFile, NodeTree
from viewer.formats._source import Source
from viewer.formats._vrm.json_parts import is_index, listed, part
from viewer.formats._vrm.numbers import rows_of, value_of
from viewer.formats._vrm.spring_parts import (
    Shape,
    SpringJoint,
    node_matrix,
    node_world,
    obstacles_of,
)
from viewer.rig.arrays import Floats

__all__ = ["old_chains", "old_shapes"]

_END = 0.07  # distance from the last joint to the swinging point, metres
_TO_OURS = np.array([1.0, 1.0, -1.0])
_DOWN = (0.0, -1.0, 0.0)


def old_shapes(file: NodeFile, told: Any) -> tuple[list[Shape], list[tuple[int, ...]]]:
    """Return the colliders of version 0.x, and the colliders of each group."""
    shapes: list[Shape] = []
    groups: list[tuple[int, ...]] = []
    for each in listed(told, "colliderGroups"):
        first, node = len(shapes), part(each, "node")
        for given in listed(each, "colliders") if is_index(node, file.tree.n_nodes) else ():
            offset = _vector(part(given, "offset"), (0.0, 0.0, 0.0))
            radius = value_of(part(given, "radius"), 0.0)
            if offset is not None and radius is not None:
                shapes.append(Shape(node, offset, offset, radius))
        groups.append(tuple(range(first, len(shapes))))
    return shapes, groups


def old_chains(
    file: NodeFile, told: Any, groups: list[tuple[int, ...]], source: Source
) -> Iterator[list[SpringJoint]]:
    """Yield the chains of version 0.x, one for each root bone."""
    tree = file.tree
    children: dict[int, list[int]] = {}
    for node, parent in enumerate(tree.parents.tolist()):
        children.setdefault(parent, []).append(node)
    for index, group in enumerate(listed(told, "boneGroups")):
        down = _vector(part(group, "gravityDir"), _DOWN)
        names = ("stiffiness", "dragForce", "gravityPower", "hitRadius")
        values = [value_of(part(group, name), 0.0) for name in names]
        bones = listed(group, "bones")
        is_valid = all(is_index(bone, tree.n_nodes) for bone in bones)
        if down is None or None in values or not is_valid:
            at = f"/extensions/VRM/secondaryAnimation/boneGroups/{index}"
            source.warn("G006.spring", at)
            continue
        stiffness, drag, power, radius = (float(value or 0.0) for value in values)
        center = part(group, "center")
        at_node = center if is_index(center, tree.n_nodes) else -1
        rest = (stiffness, drag, power * down, radius, at_node, obstacles_of(group, groups))
        for bone in bones:
            tails = [*_tails(tree, children, bone)]
            chain = [SpringJoint(node, tail, *rest) for node, tail in tails if tail.any()]
            if chain:
                yield chain


def _tails(
    tree: NodeTree, children: dict[int, list[int]], bone: int
) -> Iterator[tuple[int, Floats]]:
    """Yield a bone and all nodes below it, parents first, with the swinging point of each."""
    stack = [bone]
    while stack:
        node = stack.pop()
        below = children.get(node, [])
        stack += below[::-1]
        if below:
            yield node, node_matrix(tree, below[0])[:3, 3]
            continue
        world, parent = node_world(tree, node), int(tree.parents[node])
        away = world[:3, 3] - (node_world(tree, parent)[:3, 3] if parent >= 0 else 0.0)
        length = float(np.linalg.norm(away))
        if length > 0.0 and abs(np.linalg.det(world[:3, :3])) > 0.0:
            tail = np.linalg.solve(world[:3, :3], away * (_END / length))
            yield node, np.asarray(tail, dtype=np.float64)


def _vector(told: Any, default: tuple[float, ...]) -> Floats | None:
    """Return a vector of version 0.x in our axes; None if it is invalid."""
    if told is None:
        return np.array(default) * _TO_OURS
    found = rows_of([part(told, axis) or 0.0 for axis in "xyz"], default)
    return None if found is None else found * _TO_OURS
