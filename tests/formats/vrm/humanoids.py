"""A small person in glTF files, with the bones of VRM."""

from typing import Any

import numpy as np
from formats.gltf.files import File

BONES = ("hips", "spine", "head", "leftUpperArm", "leftLowerArm", "rightUpperArm")
PARENTS = (-1, 0, 1, 1, 3, 1)
PLACES = ((0, 1, 0), (0, 0.3, 0), (0, 0.3, 0), (0.2, 0.2, 0), (0.3, 0, 0), (-0.2, 0.2, 0))
HALF = np.sqrt(0.5)
ABOUT_X, ABOUT_Y, ABOUT_Z = [HALF, 0, 0, HALF], [0, HALF, 0, HALF], [0, 0, HALF, HALF]


def humanoid(extension: str, prefix: str, scale: float = 1.0, **more: Any) -> File:
    """Return a person in a T-pose with bones as nodes 0 to 5."""
    bones = {bone: {"node": node} for node, bone in enumerate(BONES)}
    told = {"specVersion": "1.0", "humanoid": {"humanBones": bones}, **more}
    file = File(extensionsUsed=[extension], extensions={extension: told})
    for node, place in enumerate(PLACES):
        children = [child for child, parent in enumerate(PARENTS) if parent == node]
        item: dict[str, Any] = {"name": f"{prefix}{node}"}
        item["translation"] = [scale * part for part in place]
        file.add("nodes", item | ({"children": children} if children else {}))
    return file


def character() -> File:
    """Return a character of half the size, with different rest axes of the upper arm."""
    binds = [{"node": 6, "index": 0, "weight": 1.0}]
    expressions = {"preset": {"happy": {"morphTargetBinds": binds}}}
    file = humanoid("VRMC_vrm", "c", 0.5, expressions=expressions)
    file.root["nodes"][3]["rotation"] = ABOUT_X
    mesh = file.mesh()
    file.primitive["targets"] = [{"POSITION": file.accessor([[1, 0, 0]] * 3)}]
    file.add("nodes", {"name": "face", "mesh": mesh})
    file.root["nodes"][2]["children"] = [6]
    return file
