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
    told = maps.record.extensions
    found = {"VRMC_vrm": _character(told["VRMC_vrm"], maps)}
    if isinstance(told.get(_SPRINGS), dict):
        found[_SPRINGS] = _springs(told[_SPRINGS], maps)
    return found


def _character(told: dict[str, Any], maps: Maps) -> dict[str, Any]:
    result = dict(told)
    bones = part(told, "humanoid", "humanBones")
    given = bones.items() if isinstance(bones, dict) else ()
    result["humanoid"] = {
        **(told["humanoid"] if isinstance(told.get("humanoid"), dict) else {}),
        "humanBones": {
            bone: {**each, "node": node}
            for bone, each in given
            if (node := maps.joint(part(each, "node"), "bones")) is not None
        },
    }
    meta = dict(told["meta"]) if isinstance(told.get("meta"), dict) else {}
    if "thumbnailImage" in meta:
        image = maps.image(meta.pop("thumbnailImage"), "textures")
        meta |= {} if image is None else {"thumbnailImage": image}
    result["meta"] = meta
    if isinstance(part(told, "firstPerson"), dict):
        notes = _rows(
            part(told, "firstPerson", "meshAnnotations"),
            "node",
            lambda node: maps.drawn(node, "annotations"),
        )
        result["firstPerson"] = {**told["firstPerson"], "meshAnnotations": notes}
    if isinstance(part(told, "expressions"), dict):
        result["expressions"] = {
            kind: {name: _expression(each, maps) for name, each in listed.items()}
            if isinstance(listed, dict) and kind in ("preset", "custom")
            else listed
            for kind, listed in told["expressions"].items()
        }
    return result


def _rows(told: Any, name: str, found: Callable[[Any], int | None]) -> list[Any]:
    """Return the objects of a list with translated indices, except those whose index is lost."""
    rows = told if isinstance(told, list) else []
    return [
        {**each, name: index}
        for each in rows
        if isinstance(each, dict) and (index := found(each.get(name))) is not None
    ]


def _expression(told: Any, maps: Maps) -> Any:
    if not isinstance(told, dict):
        return told
    result = dict(told)
    for key, (name, kind) in _BINDS.items():
        if key in told:
            found = maps.drawn if name == "node" else maps.material
            result[key] = _rows(told[key], name, lambda index: found(index, kind))  # noqa: B023
    return result


def _springs(told: dict[str, Any], maps: Maps) -> dict[str, Any]:
    """Return the spring bones; chains with a lost joint are omitted as a whole."""
    result, places, colliders = dict(told), dict[int, int](), list[Any]()
    for index, each in enumerate(listed(told, "colliders")):
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
            for each in listed(told, "colliderGroups")
            if isinstance(each, dict)
        ]
    else:
        result.pop("colliders", None)
        result.pop("colliderGroups", None)
    springs = [
        spring
        for each in listed(told, "springs")
        if isinstance(each, dict) and (spring := _spring(each, maps, bool(colliders)))
    ]
    return {**result, "springs": springs}


def _spring(told: dict[str, Any], maps: Maps, has_colliders: bool) -> dict[str, Any]:
    """Return one chain; an empty one if a joint is lost."""
    listed = told.get("joints")
    joints = _rows(listed, "node", lambda node: maps.joint(node, "spring-joints"))
    if not isinstance(listed, list) or len(joints) < len(listed):
        return {}
    result = {**told, "joints": joints}
    if "center" in told:
        center = maps.joint(result.pop("center"), "centers")
        result |= {} if center is None else {"center": center}
    if not has_colliders:
        result.pop("colliderGroups", None)
    return result


def kept_toon(told: dict[str, Any], maps: Maps) -> dict[str, Any]:
    """Return the toon shading of a material; textures that cannot be read are omitted."""
    result = {}
    for name, each in told.items():
        if name.endswith("Texture") and isinstance(each, dict):
            index = maps.texture(each.get("index"), "textures")
            if index is not None:
                result[name] = {**each, "index": index}
        else:
            result[name] = each
    return result
