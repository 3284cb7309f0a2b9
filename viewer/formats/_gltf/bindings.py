"""Validation of the joint indices of skinned meshes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.formats._gltf.document import Document
from viewer.formats._nodes.content import NodeMesh, NodeSkin, NodeTree, Primitive

__all__ = ["checked_bindings"]


def checked_bindings(
    document: Document,
    tree: NodeTree,
    meshes: tuple[NodeMesh, ...],
    skins: tuple[NodeSkin, ...],
) -> tuple[NodeMesh, ...]:
    """Return the meshes after checking their joint indices against all skins in use.

    Raises
    ------
    FormatError
        If a vertex refers to a joint that the skin does not have. If errors are only recorded, the
        weight of such an influence is set to 0.
    """
    limits: dict[int, tuple[int, int]] = {}
    for node in np.nonzero((tree.meshes >= 0) & (tree.skins >= 0))[0].tolist():
        mesh, skin = int(tree.meshes[node]), int(tree.skins[node])
        count = len(skins[skin].joints)
        limits[mesh] = min(limits.get(mesh, (count, skin)), (count, skin))
    result = list(meshes)
    for mesh, (count, skin) in limits.items():
        result[mesh] = _checked(document, meshes[mesh], count, skin)
    return tuple(result)


def _checked(document: Document, mesh: NodeMesh, n_joints: int, skin: int) -> NodeMesh:
    primitives = []
    for primitive in mesh.primitives:
        joints, weights = primitive.joints, primitive.weights
        if joints is None or weights is None or int(joints.max(initial=0)) < n_joints:
            primitives.append(primitive)
            continue
        bad = joints >= n_joints
        vertex, column = (int(axis[0]) for axis in np.nonzero(bad))
        document.source.refuse(
            "W010.gltf-joint",
            f"{primitive.pointer}/attributes/JOINTS_{column // 4}",
            vertex=vertex,
            found=int(joints[vertex, column]),
            joints=n_joints,
            skin=skin,
        )
        primitives.append(_without(primitive, bad))
    return replace(mesh, primitives=tuple(primitives))


def _without(primitive: Primitive, bad: np.ndarray) -> Primitive:
    assert primitive.joints is not None and primitive.weights is not None
    joints = np.where(bad, 0, primitive.joints)
    return replace(primitive, joints=joints, weights=np.where(bad, 0.0, primitive.weights))
