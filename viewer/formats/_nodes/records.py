"""Application data and names of a file of nodes, stored in a figure to be written back."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from viewer.formats._nodes.content import NodeFile
from viewer.formats._nodes.grouping import is_skinned
from viewer.formats._nodes.joints import Joints
from viewer.formats._nodes.surfaces import Piece, tangents_of, used_materials
from viewer.rig.arrays import Ints
from viewer.rig.file_record import FileRecord, VrmRecord

__all__ = ["record_of"]


def record_of(
    file: NodeFile,
    joints: Joints,
    nodes: list[int],
    columns: Mapping[int, Ints],
    pieces: list[Piece],
) -> FileRecord:
    """Return the record of one figure.

    Parameters
    ----------
    file : NodeFile
        The file, with its asset, nodes and meshes.
    joints : Joints
        The joints of the figure.
    nodes : list of int
        Nodes with a mesh, one per part.
    columns : mapping of (S,) int32
        Blend shapes of each node's morph targets.
    pieces : list of Piece
        The primitives of the figure.
    """
    extras = file.tree.extras
    meshes = [file.meshes[int(file.tree.meshes[node])] for node in nodes]
    none = np.zeros(0, dtype=np.int32)
    skins = {int(file.tree.skins[node]) for node in nodes} - {-1}
    return FileRecord(
        copyright=str(file.asset.get("copyright") or ""),
        extras=file.extras,
        joint_extras={joint: extras[node] for node, joint in joints.own.items() if node in extras},
        part_extras={
            part: extras[node]
            for part, node in enumerate(nodes)
            if node in extras and node not in joints.own
        },
        mesh_extras={
            part: mesh.extras for part, mesh in enumerate(meshes) if mesh.extras is not None
        },
        mesh_names=tuple(mesh.name for mesh in meshes),
        skin_names=tuple(file.skins[skin].name for skin in sorted(skins)),
        part_shapes=tuple(columns.get(node, none) for node in nodes),
        target_names=tuple(mesh.target_names for mesh in meshes),
        scene=file.scene,
        tangents=partial(tangents_of, pieces),
        unkept=file.unkept,
        lost_nodes=file.lost_nodes,
        vrm=_vrm_record(file, joints, nodes, pieces),
        has_skin=any(
            is_skinned(mesh, int(file.tree.skins[node]))
            for mesh, node in zip(meshes, nodes, strict=True)
        ),
    )


def _vrm_record(
    file: NodeFile, joints: Joints, nodes: list[int], pieces: list[Piece]
) -> VrmRecord | None:
    """Return the VRM properties of the figure that has the humanoid; None for others."""
    versions = [n for n, name in ((1, "VRMC_vrm"), (0, "VRM")) if name in file.extensions]
    if not versions or not any(node in joints.own for node in file.humanoid.values()):
        return None
    return VrmRecord(
        version=versions[0],
        extensions=file.extensions,
        joints=joints.own,
        parts={node: part for part, node in enumerate(nodes)},
        meshes={node: int(file.tree.meshes[node]) for node in nodes},
        materials=tuple(used_materials(pieces)),
        toon=file.toon,
        textures=file.textures,
    )
