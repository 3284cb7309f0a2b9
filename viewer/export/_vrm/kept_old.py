"""Extension of a VRM 0.x file, with the indices of the file that is written.

Version 0.x binds expressions to meshes, which become one mesh per node here: such binds are
repeated. Its materials are parallel to those of the file.
"""

from __future__ import annotations

from typing import Any

from viewer.export._vrm.maps import Maps
from viewer.formats._vrm.json_parts import listed, part

__all__ = ["kept_old"]

_PLAIN = {
    "shader": "VRM_USE_GLTFSHADER",
    "renderQueue": -1,
    "floatProperties": {},
    "vectorProperties": {},
    "textureProperties": {},
    "keywordMap": {},
    "tagMap": {},
}


def kept_old(maps: Maps, names: list[str]) -> dict[str, Any]:
    """Return the root extension ``VRM`` of a character.

    ``names``: names of the written materials.
    """
    data = maps.record.extensions["VRM"]
    result = dict(data)
    bones = listed(data, "humanoid", "humanBones")
    result["humanoid"] = {
        **(data["humanoid"] if isinstance(data.get("humanoid"), dict) else {}),
        "humanBones": _nodes(bones, maps, "bones"),
    }
    meta = dict(data["meta"]) if isinstance(data.get("meta"), dict) else {}
    if meta.get("texture", -1) != -1:
        texture = maps.texture(meta.pop("texture"), "textures")
        meta |= {} if texture is None else {"texture": texture}
    result["meta"] = meta
    if isinstance(data.get("firstPerson"), dict):
        result["firstPerson"] = _first_person(data["firstPerson"], maps)
    groups = listed(data, "blendShapeMaster", "blendShapeGroups")
    if groups:
        result["blendShapeMaster"] = {
            **data["blendShapeMaster"],
            "blendShapeGroups": [
                {**each, "binds": _of_meshes(each.get("binds"), maps, "morph-binds")}
                for each in groups
                if isinstance(each, dict)
            ],
        }
    if isinstance(data.get("secondaryAnimation"), dict):
        result["secondaryAnimation"] = _springs(data["secondaryAnimation"], maps)
    result["materialProperties"] = _materials(listed(data, "materialProperties"), maps, names)
    return {"VRM": result}


def _nodes(rows: list[Any], maps: Maps, kind: str) -> list[Any]:
    return [
        {**each, "node": node}
        for each in rows
        if isinstance(each, dict) and (node := maps.joint(each.get("node"), kind)) is not None
    ]


def _of_meshes(rows: Any, maps: Maps, kind: str) -> list[Any]:
    """Return objects with translated meshes, one for each mesh that is written."""
    given = rows if isinstance(rows, list) else []
    return [
        {**each, "mesh": mesh}
        for each in given
        if isinstance(each, dict)
        for mesh in maps.meshes(each.get("mesh"), kind)
    ]


def _first_person(data: dict[str, Any], maps: Maps) -> dict[str, Any]:
    result = dict(data)
    if data.get("firstPersonBone", -1) != -1:
        bone = maps.joint(data["firstPersonBone"], "bones")
        result["firstPersonBone"] = -1 if bone is None else bone
    notes = _of_meshes(data.get("meshAnnotations"), maps, "annotations")
    return {**result, "meshAnnotations": notes}


def _springs(data: dict[str, Any], maps: Maps) -> dict[str, Any]:
    """Return the springs; groups of colliders keep their indices, because springs refer to them."""
    groups = []
    for each in listed(data, "boneGroups"):
        if not isinstance(each, dict):
            continue
        bones = [maps.joint(bone, "spring-joints") for bone in listed(each, "bones")]
        group = {**each, "bones": [bone for bone in bones if bone is not None]}
        if part(each, "center") not in (None, -1):
            center = maps.joint(each["center"], "centers")
            group["center"] = -1 if center is None else center
        groups.append(group)
    colliders = []
    for each in listed(data, "colliderGroups"):
        node = maps.joint(part(each, "node"), "colliders")
        # A group without a joint would be invalid: it moves to the first joint, without colliders.
        empty = {"node": maps.first_joint, "colliders": []}
        is_kept = node is not None and isinstance(each, dict)
        colliders.append({**each, "node": node} if is_kept else empty)
    return {**data, "boneGroups": groups, "colliderGroups": colliders}


def _materials(data: list[Any], maps: Maps, names: list[str]) -> list[Any]:
    """Return the properties of each written material, in their order."""
    result: list[Any] = [{"name": name, **_PLAIN} for name in names]
    for own, written in maps.materials.items():
        if own >= len(data) or not isinstance(data[own], dict):
            continue
        each = dict(data[own])
        textures = part(each, "textureProperties")
        given = textures.items() if isinstance(textures, dict) else ()
        each["textureProperties"] = {
            name: texture
            for name, index in given
            if (texture := maps.texture(index, "textures")) is not None
        }
        result[written] = each
    return result
