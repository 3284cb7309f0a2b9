"""Parts of both versions of spring chains: joints, colliders, and transforms of nodes."""

from __future__ import annotations

from typing import Any

import numpy as np

from viewer.data_classes import dataclass
from viewer.formats._nodes.content import NodeTree
from viewer.formats._vrm.json_parts import is_index, listed
from viewer.rig.arrays import Floats
from viewer.rig.geometry.rotation import quaternion_to_matrix
from viewer.rig.springs.springs import OUTSIDE

__all__ = [
    "Shape",
    "SpringJoint",
    "node_matrix",
    "node_world",
    "obstacles_of",
    "tail_between",
]


@dataclass(frozen=True, slots=True)
class SpringJoint:
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
class Shape:
    """A sphere, capsule or plane, as in ``Colliders``."""

    node: int
    offset: Floats
    tail: Floats
    radius: float
    kind: int = OUTSIDE


def obstacles_of(spring: Any, groups: list[tuple[int, ...]]) -> tuple[int, ...]:
    """Return the colliders of a chain's groups, each once."""
    chosen = [g for g in listed(spring, "colliderGroups") if is_index(g, len(groups))]
    return tuple(dict.fromkeys(index for group in chosen for index in groups[group]))


def tail_between(tree: NodeTree, head: int, tail: int) -> Floats | None:
    """Return the origin of a node in the space of an ancestor; None if the node is not below it."""
    place, node = np.zeros(3), tail
    while node != head:
        if node < 0:
            return None
        matrix = node_matrix(tree, node)
        place = matrix[:3, :3] @ place + matrix[:3, 3]
        node = int(tree.parents[node])
    return place


def node_world(tree: NodeTree, node: int) -> Floats:
    """Return the matrix from a node to the scene: (4, 4)."""
    matrix = np.eye(4)
    while node >= 0:
        matrix = node_matrix(tree, node) @ matrix
        node = int(tree.parents[node])
    return matrix


def node_matrix(tree: NodeTree, node: int) -> Floats:
    """Return the matrix from a node to its parent: (4, 4)."""
    if node in tree.matrices:
        return tree.matrices[node]
    matrix = np.eye(4)
    matrix[:3, :3] = quaternion_to_matrix(tree.rotations[node]) * tree.scales[node]
    matrix[:3, 3] = tree.translations[node]
    return matrix
