"""Nodes of human bones in VRM files."""

from __future__ import annotations

from collections.abc import Mapping

from viewer.formats._scene_graph.content import NodeFile
from viewer.formats._source import Source
from viewer.formats._vrm.parts import is_index, part
from viewer.phrases import quoted
from viewer.rigs.humanoid import HUMAN_BONES, SPINE_BONES

_OLD_THUMB = {"ThumbProximal": "ThumbMetacarpal", "ThumbIntermediate": "ThumbProximal"}


def read_humanoid(
    source: Source, file: NodeFile, told: Mapping[str, object], version: int, pointer: str
) -> dict[str, int]:
    """Return the node of each human bone, by its name in VRM 1.0; invalid bones are reported."""
    found: dict[str, int] = {}
    for _, bone, node in given_bones(told, version):
        if not is_index(node, file.tree.n_nodes):
            source.warn(
                "G006.bone-node: human bone {bone}: expected the index of a node, found {found}: "
                "ignored",
                f"{pointer}/humanoid/humanBones",
                bone=quoted(bone),
                found=node,
            )
        elif bone in HUMAN_BONES or bone in SPINE_BONES:
            found.setdefault(bone, node)
        else:
            source.warn(
                "G006.bone: unknown human bone {bone}: ignored",
                f"{pointer}/humanoid/humanBones",
                bone=quoted(bone),
            )
    return found


def given_bones(told: object, version: int) -> list[tuple[str, str, object]]:
    """Return the place of each stated human bone in its list, its name in VRM 1.0, and its node."""
    bones = part(told, "humanoid", "humanBones")
    if version == 0 and isinstance(bones, list):
        rows = [(str(place), part(each, "bone"), each) for place, each in enumerate(bones)]
        return [(at, modern_bone(b), part(each, "node")) for at, b, each in rows if type(b) is str]
    named = bones.items() if version == 1 and isinstance(bones, dict) else ()
    return [(bone, bone, part(each, "node")) for bone, each in named]


def modern_bone(bone: str) -> str:
    """Return the name in VRM 1.0 of a human bone of VRM 0.x: thumbs begin at the metacarpal."""
    for old, new in _OLD_THUMB.items():
        if bone.endswith(old):
            return bone.removesuffix(old) + new
    return bone
