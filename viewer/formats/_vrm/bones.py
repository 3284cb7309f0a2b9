"""Nodes of human bones in VRM files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from viewer.formats._nodes.content import NodeFile
from viewer.formats._source import Source
from viewer.formats._vrm.json_parts import is_index, part
from viewer.rig.humanoid import HUMAN_BONES, SPINE_BONES

__all__ = ["modern_bone", "read_humanoid"]

_OLD_THUMB = {"ThumbProximal": "ThumbMetacarpal", "ThumbIntermediate": "ThumbProximal"}


def read_humanoid(
    source: Source, file: NodeFile, told: Mapping[str, Any], version: int, pointer: str
) -> dict[str, int]:
    """Return the node of each human bone, by its name in VRM 1.0.

    Parameters
    ----------
    source : Source
        Records messages about invalid bones, which are ignored.
    file : NodeFile
        The file, with its nodes.
    told : mapping
        The extension with the humanoid.
    version : int
        0 or 1.
    pointer : str
        JSON pointer to the extension.
    """
    bones = part(told, "humanoid", "humanBones")
    given: list[tuple[Any, Any]] = []
    if version == 0 and isinstance(bones, list):
        given = [(part(each, "bone"), part(each, "node")) for each in bones]
        given = [(modern_bone(bone), node) for bone, node in given if isinstance(bone, str)]
    elif isinstance(bones, dict):
        given = [(bone, part(each, "node")) for bone, each in bones.items()]
    found: dict[str, int] = {}
    for bone, node in given:
        if not is_index(node, file.tree.n_nodes):
            source.warn("G006.bone-node", f"{pointer}/humanoid/humanBones", bone=bone, found=node)
        elif bone in HUMAN_BONES or bone in SPINE_BONES:
            found[bone] = node
        else:
            source.warn("G006.bone", f"{pointer}/humanoid/humanBones", bone=bone)
    return found


def modern_bone(bone: str) -> str:
    """Return the name in VRM 1.0 of a human bone of VRM 0.x.

    >>> modern_bone("leftThumbProximal"), modern_bone("hips")
    ('leftThumbMetacarpal', 'hips')
    """
    for old, new in _OLD_THUMB.items():
        if bone.endswith(old):
            return bone.removesuffix(old) + new
    return bone
