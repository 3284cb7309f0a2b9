"""Skins of a glTF document: joints and their inverse bind matrices."""

from __future__ import annotations

from functools import partial

import numpy as np

from viewer.formats._gltf.document import Document
from viewer.formats._gltf.elements import Element, Table
from viewer.formats._nodes.content import NodeSkin
from viewer.rig.arrays import Floats

__all__ = ["read_skins"]

_EMPTY = NodeSkin("", np.zeros(0, dtype=np.int32), np.zeros((0, 4, 4)))
_LAST_ROW = 1e-4  # maximum deviation of the last row from 0 0 0 1 that is due to rounding


def read_skins(document: Document) -> tuple[NodeSkin, ...]:
    """Return all skins.

    Raises
    ------
    FormatError
        If a skin is malformed, refers to missing nodes, or has too few or invalid matrices.
    """
    table = document.table("skins")
    skins = (partial(_skin, document, table, index) for index in range(len(table)))
    return tuple(document.kept(skin, _EMPTY) for skin in skins)


def _skin(document: Document, table: Table, index: int) -> NodeSkin:
    skin = table[index]
    n_nodes = len(document.table("nodes"))
    joints = skin.indices("joints", n_nodes, "nodes")
    if not joints:
        if not skin.has("joints"):
            raise skin.wrong("joints", "a list of nodes")
        skin.warn("G004.no-joints", "joints")
        return _EMPTY
    if len(set(joints)) != len(joints):
        skin.warn("G004.joint-twice", "joints", n=len(joints) - len(set(joints)))
    root = skin.values.get("skeleton", 0)
    if type(root) is not int or not 0 <= root < n_nodes:
        skin.warn("G004.skeleton", "skeleton", found=str(root)[:20])
    matrices = _inverse_bind(document, skin, len(joints))
    return NodeSkin(skin.text("name"), np.array(joints, dtype=np.int32), matrices)


def _inverse_bind(document: Document, skin: Element, n_joints: int) -> Floats:
    """Return one matrix per joint; identities if there are none."""
    name = "inverseBindMatrices"
    accessor = skin.index(name, len(document.accessors), "accessors")
    if accessor < 0:
        return np.tile(np.eye(4), (n_joints, 1, 1))
    found = document.accessors.count(accessor)
    if found < n_joints:
        raise skin.fault("F002.gltf-bind-count", name, expected=n_joints, found=found)
    if found > n_joints:
        skin.warn("G004.bind-count", name, expected=n_joints, found=found)
    matrices = document.accessors.matrices(accessor, skin.at(name))[:n_joints]
    is_finite = np.isfinite(matrices).all(axis=(1, 2))
    if not is_finite.all():
        raise skin.fault("F003.gltf-bind", name, joint=int((~is_finite).argmax()))
    odd = (np.abs(matrices[:, 3] - (0.0, 0.0, 0.0, 1.0)) > _LAST_ROW).any(axis=1)
    if odd.any():
        joint = int(odd.argmax())
        row = " ".join(f"{value:g}" for value in matrices[joint, 3])
        raise skin.fault("F002.gltf-bind-row", name, joint=joint, found=row)
    matrices[:, 3] = 0.0, 0.0, 0.0, 1.0
    return matrices
