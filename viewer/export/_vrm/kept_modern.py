"""Extensions of a VRM 1.0 file, with the indices of the file that is written.

Members without indices are kept unchanged.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from viewer.export._vrm.maps import Maps
from viewer.formats._vrm.json_parts import listed, part

__all__ = ["kept_modern", "kept_toon"]

_SPRINGS = "VRMC_springBone"
_BINDS = {
    "morphTargetBinds": ("node", "morph-binds"),
    "materialColorBinds": ("material", "material-binds"),
    "textureTransformBinds": ("material", "material-binds"),
}


def kept_modern(maps: Maps) -> dict[str, Any]:
    """Return the root extensions ``VRMC_vrm`` and ``VRMC_springBone`` of a character."""
    data = maps.record.extensions
    found = {"VRMC_vrm": _character(data["VRMC_vrm"], maps)}
    if isinstance(data.get(_SPRINGS), dict):
        found[_SPRINGS] = _springs(data[_SPRINGS], maps)
    return found


def _character(data: dict[str, Any], maps: Maps) -> dict[str, Any]:
    result = dict(data)
    bones = part(data, "humanoid", "humanBones")
    given = bones.items() if isinstance(bones, dict) else ()
    result["humanoid"] = {
        **(data["humanoid"] if isinstance(data.get("humanoid"), dict) else {}),
        "humanBones": {
            bone: {**each, "node": node}
            for bone, each in given
            if (node := maps.joint(part(each, "node"), "bones")) is not None
        },
    }
    meta = dict(data["meta"]) if isinstance(data.get("meta"), dict) else {}
    if "thumbnailImage" in meta:
        image = maps.image(meta.pop("thumbnailImage"), "textures")
        meta |= {} if image is None else {"thumbnailImage": image}
    result["meta"] = meta
    if isinstance(part(data, "firstPerson"), dict):
        notes = _rows(
            part(data, "firstPerson", "meshAnnotations"),
            "node",
            lambda node: maps.drawn(node, "annotations"),
        )
        result["firstPerson"] = {**data["firstPerson"], "meshAnnotations": notes}
    if isinstance(part(data, "expressions"), dict):
        result["expressions"] = {
            kind: {name: _expression(each, maps) for name, each in listed.items()}
            if isinstance(listed, dict) and kind in ("preset", "custom")
            else listed
            for kind, listed in data["expressions"].items()
        }
    return result


def _rows(data: Any, name: str, found: Callable[[Any], int | None]) -> list[Any]:
    """Return the objects of a list with translated indices, except those whose index is lost."""
    rows = data if isinstance(data, list) else []
    return [
        {**each, name: index}
        for each in rows
        if isinstance(each, dict) and (index := found(each.get(name))) is not None
    ]


def _expression(data: Any, maps: Maps) -> Any:
    if not isinstance(data, dict):
        return data
    result = dict(data)
    for key, (name, kind) in _BINDS.items():
        if key in data:
            found = maps.drawn if name == "node" else maps.material
            result[key] = _rows(data[key], name, lambda index: found(index, kind))  # noqa: B023
    return result


def _springs(data: dict[str, Any], maps: Maps) -> dict[str, Any]:
    """Return the spring bones; chains with a lost joint are omitted as a whole."""
    result, places, colliders = dict(data), dict[int, int](), list[Any]()
    for index, each in enumerate(listed(data, "colliders")):
        node = maps.joint(part(each, "node"), "colliders")
        if node is not None:
            places[index] = len(colliders)
            colliders.append({**each, "node": node})
    if colliders:
        result["colliders"] = colliders
        result["colliderGroups"] = [
            {
                **each,
                "colliders": [
                    places[i] for i in listed(each, "colliders") if type(i) is int and i in places
                ],
            }
            for each in listed(data, "colliderGroups")
            if isinstance(each, dict)
        ]
    else:
        result.pop("colliders", None)
        result.pop("colliderGroups", None)
    springs = [
        spring
        for each in listed(data, "springs")
        if isinstance(each, dict) and (spring := _spring(each, maps, bool(colliders)))
    ]
    return {**result, "springs": springs}


def _spring(data: dict[str, Any], maps: Maps, has_colliders: bool) -> dict[str, Any]:
    """Return one chain; an empty one if a joint is lost."""
    listed = data.get("joints")
    joints = _rows(listed, "node", lambda node: maps.joint(node, "spring-joints"))
    if not isinstance(listed, list) or len(joints) < len(listed):
        return {}
    result = {**data, "joints": joints}
    if "center" in data:
        center = maps.joint(result.pop("center"), "centers")
        result |= {} if center is None else {"center": center}
    if not has_colliders:
        result.pop("colliderGroups", None)
    return result


def kept_toon(data: dict[str, Any], maps: Maps) -> dict[str, Any]:
    """Return the toon shading of a material; textures that cannot be read are omitted."""
    result = {}
    for name, each in data.items():
        if name.endswith("Texture") and isinstance(each, dict):
            index = maps.texture(each.get("index"), "textures")
            if index is not None:
                result[name] = {**each, "index": index}
        else:
            result[name] = each
    return result
