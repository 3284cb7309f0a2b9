"""Chains of spring joints: ``VRMC_springBone`` 1.0 and ``secondaryAnimation``.

::

    VRMC_springBone (1.0)
        springs         joints (node, stiffness, dragForce, gravityPower, gravityDir, hitRadius),
                        center (node), colliderGroups; each joint points at the next one
        colliderGroups  colliders
        colliders       node, shape: sphere (offset, radius) or capsule (offset, tail, radius);
                        VRMC_springBone_extended_collider replaces the shape: also inside, or
                        plane (offset, normal)

Version 0.x is in ``old_springs.py``.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from viewer.formats._nodes.content import NodeFile, NodeTree
from viewer.formats._source import Source
from viewer.formats._vrm.json_parts import is_index, listed, part
from viewer.formats._vrm.numbers import rows_of, value_of
from viewer.formats._vrm.old_springs import old_chains, old_shapes
from viewer.formats._vrm.spring_parts import (
    Shape,
    SpringJoint,
    obstacles_of,
    tail_between,
)
from viewer.rig.springs.springs import INSIDE, OUTSIDE, PLANE, Colliders, Springs

__all__ = ["read_springs"]

EXTENSION = "VRMC_springBone"
EXTENDED = "VRMC_springBone_extended_collider"
_DOWN = (0.0, -1.0, 0.0)


def read_springs(file: NodeFile, source: Source) -> Springs | None:
    """Return the spring joints of a file as node indices; None if there are none.

    Parameters
    ----------
    file : NodeFile
        The file, with its extensions.
    source : Source
        Records messages about invalid chains and colliders, which are ignored.
    """
    told = file.extensions.get(EXTENSION)
    old = part(file.extensions, "VRM", "secondaryAnimation")
    if isinstance(told, dict):
        shapes, groups = _shapes(file, told, source)
        chains = [*_chains(file, told, groups, source)]
    elif isinstance(old, dict):
        shapes, groups = old_shapes(file, old)
        chains = [*old_chains(file, old, groups, source)]
    else:
        return None
    found: dict[int, SpringJoint] = {}
    for chain in chains:
        for joint in chain:
            found.setdefault(joint.node, joint)
    return _springs([*found.values()], shapes, len(chains)) if found else None


def _springs(joints: list[SpringJoint], shapes: list[Shape], n_chains: int) -> Springs:
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
        n_chains=n_chains,
    )


def _shapes(file: NodeFile, told: Any, source: Source) -> tuple[list[Shape], list[tuple[int, ...]]]:
    """Return the colliders of version 1.0, and the colliders of each group."""
    places: dict[int, int] = {}
    shapes: list[Shape] = []
    for index, each in enumerate(listed(told, "colliders")):
        extended = part(each, "extensions", EXTENDED, "shape")
        told_shape = part(each, "shape") if extended is None else extended
        shape = _shape(part(each, "node"), told_shape, file.tree.n_nodes)
        if shape is None:
            at = f"/extensions/{EXTENSION}/colliders/{index}"
            source.warn("G006.collider", at)
        else:
            places[index] = len(shapes)
            shapes.append(shape)
    groups = [listed(each, "colliders") for each in listed(told, "colliderGroups")]
    return shapes, [
        tuple(places[index] for index in group if isinstance(index, int) and index in places)
        for group in groups
    ]


def _shape(node: Any, told: Any, n_nodes: int) -> Shape | None:
    """Return a collider of version 1.0, possibly an extended one; None if it is invalid."""
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
        return Shape(node, offset, offset + normal, 0.0, PLANE)
    return Shape(node, offset, tail, radius, INSIDE if part(given, "inside") is True else OUTSIDE)


def _chains(
    file: NodeFile, told: Any, groups: list[tuple[int, ...]], source: Source
) -> Iterator[list[SpringJoint]]:
    """Yield the chains of version 1.0."""
    for index, spring in enumerate(listed(told, "springs")):
        chain = _chain(file.tree, spring, listed(spring, "joints"), groups)
        if chain is None:
            source.warn("G006.spring", f"/extensions/{EXTENSION}/springs/{index}")
        elif chain:
            yield chain


def _chain(
    tree: NodeTree, spring: Any, joints: list[Any], groups: list[tuple[int, ...]]
) -> list[SpringJoint] | None:
    """Return the joints of a chain that point at the next one; None if it is invalid."""
    nodes = [part(each, "node") for each in joints]
    if not all(is_index(node, tree.n_nodes) for node in nodes):
        return None
    obstacles = obstacles_of(spring, groups)
    center = part(spring, "center")
    chain = []
    for told, node, following in zip(joints, nodes, nodes[1:], strict=False):
        tail = tail_between(tree, node, following)
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
                SpringJoint(node, tail, stiffness, drag, power * down, radius, at, obstacles)
            )
    return chain
