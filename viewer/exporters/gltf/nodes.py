"""Nodes of a glTF file: conversion to y up and metres, the figure's placement, its joints.

::

    z up, centimetres        rotated by -90 degrees about x if z is up, scaled to metres if the unit
    │                        is known and not the metre; omitted if neither applies
    └── the figure's name    figure_translation and figure_scale
        ├── joints           T R S, by the figure's names; the root has the figure_translation of
        │                    sampled motions where it moves all there is
        ├── fixed            never moves; only if some vertices have no influence
        └── mesh             only if the mesh is not skinned; a skinned mesh is a root node

A figure from a glTF or FBX file has its own root, and needs the first two nodes only if it is moved
or converted.
"""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.exporters.gltf.document import Document, named, text_of
from viewer.formats.gltf.nodes import Z_TO_Y
from viewer.rigs.arrays import Floats
from viewer.rigs.constraints.evaluation import constrained
from viewer.rigs.file_record import Json
from viewer.rigs.geometry.rotation import matrix_to_quaternion
from viewer.rigs.geometry.vectors import SignedUp
from viewer.rigs.pose import Pose, joint_rotations, local_matrices
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.units import METRES, UNIT_NAMES

_NO_ROTATION = np.array([0.0, 0.0, 0.0, 1.0])
_Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True, slots=True, eq=False)
class Locals:
    """Joint transforms relative to their parents."""

    translations: Floats
    rotations: Floats
    scales: Floats
    """(J, 3): figure units, unit quaternions (x, y, z, w), factors."""


@dataclass(slots=True)
class Tree:
    """Indices of nodes."""

    root: int
    """The topmost node."""
    place: int
    """The node that moves the whole figure; -1 if there is none."""
    joints: list[int]
    """Nodes of the joints, in the figure's order."""
    fixed: list[int]
    """The node of vertices without influence, if there are any."""


def locals_of(skeleton: Skeleton, pose: Pose) -> Locals:
    """Return the local joint transforms of a pose of a skeleton with its shape applied."""
    places = local_matrices(skeleton, pose)[:, :3, 3]
    rotations = matrix_to_quaternion(joint_rotations(skeleton, pose))
    return Locals(places, constrained(skeleton, rotations, places, pose.scales), pose.scales)


def add_nodes(
    document: Document,
    name: str,
    up: SignedUp,
    unit: str,
    skeleton: Skeleton | None,
    pose: Pose | None,
    still: Locals | None,
    fixes: bool,
    bare: bool = False,
) -> Tree:
    """Add all nodes except meshes; ``bare`` lets a lone root joint be the topmost node."""
    if bare and skeleton is not None and still is not None and not fixes:
        moved = pose is not None and (pose.figure_translation.any() or pose.figure_scale != 1.0)
        if np.sum(skeleton.parents < 0) == 1 and not moved and not _above(up, unit):
            own = _add_joints(document, skeleton, still)
            return Tree(own[0], -1, own, [])
    top: Json = {"name": text_of(name)}
    place = root = document.add("nodes", top)
    above = _above(up, unit)
    if above:
        root = document.add("nodes", {**above, "children": [place]})
    children: list[int] = []
    if pose is not None:
        _put(top, "translation", pose.figure_translation, 0.0)
        _put(top, "scale", np.full(3, pose.figure_scale), 1.0)
    joints: list[int] = []
    if skeleton is not None and still is not None:
        joints = _add_joints(document, skeleton, still)
        roots = np.flatnonzero(skeleton.parents < 0)
        children += [joints[joint] for joint in roots]
    fixed = [document.add("nodes", {"name": "fixed"})] if fixes else []
    children += fixed
    if children:
        top["children"] = children
    return Tree(root, place, joints, fixed)


def _above(up: SignedUp, unit: str) -> Json:
    """Return the properties and name of the node above the whole figure; may be empty."""
    names, node = [], {}
    if up == "z":
        names.append("z up")
        node["rotation"] = list(Z_TO_Y)
    if METRES.get(unit, 1.0) != 1.0:
        names.append(UNIT_NAMES[unit])
        node["scale"] = [METRES[unit]] * 3
    return {"name": ", ".join(names), **node} if names else {}


def to_metres(up: SignedUp, unit: str) -> Floats:
    """Return the matrix of the node above the whole figure: (4, 4)."""
    matrix = np.diag([METRES.get(unit, 1.0)] * 3 + [1.0])
    if up == "z":
        matrix[:3, :3] = matrix[:3, :3] @ _Z_UP
    return matrix


def _add_joints(document: Document, skeleton: Skeleton, still: Locals) -> list[int]:
    first = len(document.root.get("nodes", ()))
    below: list[list[int]] = [[] for _ in skeleton.names]
    for joint, parent in enumerate(skeleton.parents.tolist()):
        if parent >= 0:
            below[parent].append(first + joint)
    for joint, name in enumerate(skeleton.names):
        node = named(name)
        _put(node, "translation", still.translations[joint], 0.0)
        rotation = still.rotations[joint]
        _put(node, "rotation", rotation / np.linalg.norm(rotation), _NO_ROTATION)
        _put(node, "scale", still.scales[joint], 1.0)
        if below[joint]:
            node["children"] = below[joint]
        document.add("nodes", node)
    return list(range(first, first + skeleton.n_joints))


def _put(node: Json, name: str, values: Floats, default: float | Floats) -> None:
    if (values != default).any():
        if not np.isfinite(values).all():
            raise RigError("expected finite numbers in the pose, which glTF needs")
        node[name] = [float(value) for value in values]
