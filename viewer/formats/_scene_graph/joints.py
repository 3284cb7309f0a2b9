"""Joints made from nodes, with auxiliary joints for shear and second bindings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import field, replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.formats._scene_graph.content import NodeTree
from viewer.rigs.arrays import Floats
from viewer.rigs.constraints.constraint import Constraint
from viewer.rigs.geometry.rotation import matrix_to_quaternion, quaternion_to_matrix
from viewer.rigs.humanoid import Humanoid
from viewer.rigs.kinematics import joint_worlds
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.springs.spring_joints import Colliders, Springs

_NO_ROTATION = np.array([0.0, 0.0, 0.0, 1.0])
_BY_SPRING = ("tails", "stiffness", "drags", "gravities", "radii")


@dataclass(slots=True, eq=False)
class Joints:
    """The joints of a figure whose skeleton is under construction."""

    nodes: list[int] = field(default_factory=list)
    """Node of each joint; -1 for auxiliary joints."""
    names: list[str] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    translations: list[Floats] = field(default_factory=list)
    rotations: list[Floats] = field(default_factory=list)
    scales: list[Floats] = field(default_factory=list)
    """As in ``Skeleton``."""
    own: dict[int, int] = field(default_factory=dict)
    """Joint of each node, which its animation moves."""
    carrier: dict[int, int] = field(default_factory=dict)
    """Joint with the whole transform of each node, which children and meshes follow: the node's own
    joint, or an auxiliary one below it if the node shears."""

    def add(
        self,
        node: int,
        name: str,
        parent: int,
        translation: Floats,
        rotation: Floats,
        scale: Floats,
    ) -> int:
        """Append a joint and return its index."""
        self.nodes.append(node)
        self.names.append(name)
        self.parents.append(parent)
        self.translations.append(translation)
        self.rotations.append(rotation)
        self.scales.append(scale)
        return len(self.nodes) - 1

    def add_auxiliary(self, parent: int, rotation: Floats = _NO_ROTATION) -> int:
        """Append a joint without a node, at the origin of its parent."""
        return self.add(-1, "", parent, np.zeros(3), rotation, np.ones(3))


def make_joints(tree: NodeTree, nodes: list[int]) -> Joints:
    """Return a joint for each node, and auxiliary joints for nodes that shear."""
    joints = Joints()
    parents = tree.parents.tolist()
    for node in nodes:
        parent, below = joints.carrier.get(parents[node], -1), None
        translation, rotation = tree.translations[node], tree.rotations[node]
        scales = tree.scales[node]
        if node in tree.matrices:
            # M = U S V^T shears, so it becomes T R(U) S(S) and, below it, R(V^T).
            translation = tree.matrices[node][:3, 3]
            left, scales, right = sheared(tree.matrices[node][:3, :3])
            rotation, below = matrix_to_quaternion(np.stack([left, right]))
        own = joints.add(node, tree.names[node], parent, translation, rotation, scales)
        joints.own[node] = own
        joints.carrier[node] = own if below is None else joints.add_auxiliary(own, below)
    return joints


def sheared(linear: Floats) -> tuple[Floats, Floats, Floats]:
    """Return rotations U, V^T and S (3,), U diag(S) V^T = M (3, 3); S has a minus if M reflects."""
    left, scales, right = np.linalg.svd(linear)
    # U or V^T may be a reflection. The third column of U, or row of V^T, and the third factor
    # change their signs together, which leaves the product as it is.
    if np.linalg.det(left) < 0.0:
        left[:, 2] *= -1.0
        scales[2] *= -1.0
    if np.linalg.det(right) < 0.0:
        right[2] *= -1.0
        scales[2] *= -1.0
    return left, scales, right


def rest_worlds(joints: Joints) -> Floats:
    """Return the joint-to-figure matrices of the rest pose: (J, 4, 4)."""
    rotations = quaternion_to_matrix(np.array(joints.rotations))
    linear = rotations * np.array(joints.scales)[:, None, :]
    parents = np.array(joints.parents, dtype=np.int32)
    return joint_worlds(parents, linear, np.array(joints.translations))


def skeleton_of(
    joints: Joints,
    humanoid: Mapping[str, int] | None = None,
    constraints: Iterable[Constraint] = (),
    springs: Springs | None = None,
) -> Skeleton:
    """Return the skeleton; auxiliary joints have no DOFs, constrained joints locked ones."""
    is_auxiliary = np.array(joints.nodes) < 0
    balls = np.flatnonzero(~is_auxiliary).astype(np.int32)
    count = 3 * len(balls)
    given = (humanoid or {}).items()
    bones = {bone: joints.own[node] for bone, node in given if node in joints.own}
    followers = tuple(
        replace(each, joint=joints.own[each.joint], source=joints.own[each.source])
        for each in constraints
        if each.joint in joints.own and each.source in joints.own
    )
    # A pose has no effect on constrained joints.
    is_free = ~np.isin(balls, [each.joint for each in followers])
    limits = np.where(np.repeat(is_free, 3)[:, None], [-np.inf, np.inf], 0.0)
    return Skeleton(
        names=tuple(joints.names),
        parents=np.array(joints.parents, dtype=np.int32),
        rest_translations=np.array(joints.translations),
        rest_rotations=np.array(joints.rotations),
        rest_scales=np.array(joints.scales),
        dof_joints=np.repeat(balls, 3),
        dof_kinds=np.tile(np.arange(3, 6, dtype=np.int32), len(balls)),
        rest_dofs=np.zeros(count),
        dof_limits=limits,
        auxiliary=is_auxiliary if is_auxiliary.any() else None,
        humanoid=Humanoid(bones) if bones else None,
        constraints=followers,
        springs=None if springs is None else _springs_of(springs, joints.own),
    )


def _springs_of(springs: Springs, own: Mapping[int, int]) -> Springs | None:
    """Return the spring joints of one figure, with joints instead of nodes; None if it has none."""
    rows = [row for row, node in enumerate(springs.joints.tolist()) if node in own]
    if not rows:
        return None
    shapes = springs.colliders
    kept = [index for index, node in enumerate(shapes.joints.tolist()) if node in own]
    places = {index: place for place, index in enumerate(kept)}
    chosen = np.array(rows)
    return replace(
        springs,
        **{name: getattr(springs, name)[chosen] for name in _BY_SPRING},
        joints=np.array([own[int(springs.joints[row])] for row in rows]),
        centers=np.array([own.get(int(springs.centers[row]), -1) for row in rows]),
        colliders=Colliders(
            np.array([own[int(shapes.joints[index])] for index in kept], np.int32),
            *(getattr(shapes, name)[kept] for name in ("offsets", "tails", "radii", "kinds")),
        ),
        obstacles=tuple(
            tuple(places[index] for index in springs.obstacles[row] if index in places)
            for row in rows
        ),
    )
