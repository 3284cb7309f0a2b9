"""VRM 0.x characters in the terms of VRM 1.0, translated member by member when a file is read.

Indices refer to nodes, textures and materials of the file, and vectors to its axes, in which
characters face -z. Vectors of version 0.x are in Unity's axes, whose z axis is reversed.
Specifications: ``github.com/vrm-c/vrm-specification``, ``VRM`` 0.0, ``VRMC_vrm``,
``VRMC_springBone`` and ``VRMC_materials_mtoon`` 1.0.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from viewer.data_classes import dataclass
from viewer.diagnostics import wording
from viewer.formats._scene_graph.content import NodeFile
from viewer.formats._source import Source
from viewer.formats._vrm.bones import given_bones
from viewer.formats._vrm.materials import modern_toon, upgraded_binds
from viewer.formats._vrm.parts import is_index, list_in, objects_in, part, rows_of, value_of
from viewer.formats._vrm.springs import end_below
from viewer.rigs.arrays import Floats
from viewer.rigs.expressions import OLD_PRESETS
from viewer.rigs.file_record import Json, StoredTextures

LICENCE = "https://vrm.dev/licenses/1.0/"
"""The VRM Public Licence, the only one that VRM 1.0 accepts."""
_MUSCLES = {
    **dict.fromkeys(("armStretch", "legStretch"), 0.05),
    **dict.fromkeys(("upperArmTwist", "lowerArmTwist", "upperLegTwist", "lowerLegTwist"), 0.5),
    "feetSpacing": 0.0,
    "hasTranslationDoF": False,
}
_VIEWS = {"auto": "auto", "both": "both", "thirdpersononly": "thirdPersonOnly"}
_VIEWS["firstpersononly"] = "firstPersonOnly"
_RANGES = ("HorizontalInner", "HorizontalOuter", "VerticalDown", "VerticalUp")
_STRAIGHT = [0, 0, 0, 1, 1, 1, 1, 0]  # time, value and two slopes of the first and last key
_SAME = 1e-6

# Meta data
_USERS = {
    "OnlyAuthor": "onlyAuthor",
    "ExplicitlyLicensedPerson": "onlySeparatelyLicensedPerson",
    "Everyone": "everyone",
}
_ALLOWS = {
    "violentUssageName": "allowExcessivelyViolentUsage",
    "sexualUssageName": "allowExcessivelySexualUsage",
}
_COMMONS = "https://creativecommons.org"
_LICENCES = {
    "CC0": f"{_COMMONS}/publicdomain/zero/1.0/",
    **{
        f"CC_{name}": f"{_COMMONS}/licenses/{name.lower().replace('_', '-')}/4.0/"
        for name in ("BY", "BY_NC", "BY_SA", "BY_NC_SA", "BY_ND", "BY_NC_ND")
    },
}

# Expressions
_PERCENT = 100.0

# Materials
_MTOON, _UNLIT = "VRMC_materials_mtoon", "KHR_materials_unlit"
_BLENDS, _WRITES_DEPTH = (2, 3), 3  # _BlendMode
_MOST_OFFSET = 9


@dataclass(frozen=True, slots=True, eq=False)
class NamedExpression:
    """An expression in the terms of version 1.0."""

    name: str
    """As the file states it."""
    preset: str
    """Preset of VRM 1.0 that an expression of version 0.x states; empty if none, and in 1.0."""
    told: Json
    """As in ``VRMC_vrm``; a bind whose mesh or weight is invalid lacks its node or weight."""
    undrawn: list[str]
    """Labels of changes of materials that have no effect."""


@dataclass(frozen=True, slots=True, eq=False)
class Upgrade:
    """A character of version 0.x in the terms of 1.0."""

    extensions: Json
    """``VRMC_vrm`` and, if there are chains, ``VRMC_springBone``."""
    expressions: list[NamedExpression]
    """In file order."""
    ends: Mapping[int, Floats]
    """End of a chain in the space of its last joint, (3,), by a number that no node has."""
    toon: Mapping[int, Json]
    """Toon and unlit extensions of materials, by index."""
    lost: list[str]
    """Members without a counterpart in version 1.0."""


def upgrade(file: NodeFile, source: Source) -> Upgrade:
    """Translate the extension ``VRM`` of a file; invalid spring chains are reported."""
    data, lost = file.extensions["VRM"], list[str]()
    character = {
        "specVersion": "1.0",
        "meta": _meta(part(data, "meta"), file.textures, lost),
        "humanoid": _humanoid(data, lost),
    }
    views = []
    for each in list_in(data, "firstPerson", "meshAnnotations"):
        view = _VIEWS.get(str(part(each, "firstPersonFlag")).lower(), "auto")
        nodes = nodes_with_mesh(file, part(each, "mesh"))
        views += [{"node": node, "type": view} for node in nodes]
    character |= {"firstPerson": {"meshAnnotations": views}} if views else {}
    character |= _gaze(data, lost)
    expressions = _expressions(data, file)
    lost += [f"materialValues {each}" for one in expressions for each in one.undrawn]
    named = _named(expressions)
    character |= {"expressions": named} if named else {}
    springs, ends = _springs(part(data, "secondaryAnimation"), file, source, lost)
    return Upgrade(
        {"VRMC_vrm": character} | ({"VRMC_springBone": springs} if springs else {}),
        expressions,
        ends,
        _toon(list_in(data, "materialProperties"), file.toon, lost),
        lost,
    )


def _humanoid(data: object, lost: list[str]) -> Json:
    """Return the human bones; Unity's muscle settings have no counterpart."""
    bones: Json = {}
    for place, bone, node in given_bones(data, 0):
        if bone in bones:
            lost.append(f"humanoid.humanBones[{place}]")
        bones.setdefault(bone, {"node": node})
    for each in list_in(data, "humanoid", "humanBones"):
        if isinstance(part(each, "bone"), str) and part(each, "useDefaultValues") is False:
            lost.append(f"humanoid.{each['bone']}")
    for name, default in _MUSCLES.items():
        value = part(data, "humanoid", name)
        # Not a difference: an integer may be too large for a float.
        if isinstance(value, int | float) and not default - _SAME <= value <= default + _SAME:
            lost.append(f"humanoid.{name}")
    return {"humanBones": bones}


def nodes_with_mesh(file: NodeFile, mesh: object) -> list[int]:
    """Return the nodes that show a mesh; none if it is not an index."""
    return file.tree.with_mesh(mesh) if is_index(mesh, len(file.meshes)) else []


def _gaze(data: object, lost: list[str]) -> Json:
    """Return the gaze; its ranges are linear in version 1.0."""
    first = part(data, "firstPerson")
    if not isinstance(first, dict):
        return {}
    is_bone = str(first.get("lookAtTypeName", "Bone")).lower() == "bone"
    gaze: Json = {"type": "bone" if is_bone else "expression"}
    offset = first.get("firstPersonBoneOffset")
    if isinstance(offset, dict):
        place = _vector(offset)
        if place is None:
            lost.append("firstPerson.firstPersonBoneOffset")
        else:
            gaze["offsetFromHeadBone"] = place
    for name in _RANGES:
        given = first.get(f"lookAt{name}")
        if not isinstance(given, dict):
            continue
        gaze[f"rangeMap{name}"] = _range(given, f"firstPerson.lookAt{name}", lost)
        if given.get("curve") not in (None, _STRAIGHT):
            lost.append(f"firstPerson.lookAt{name}.curve")
    bones = list_in(data, "humanoid", "humanBones")
    heads = [part(each, "node") for each in bones if part(each, "bone") == "head"]
    if first.get("firstPersonBone", -1) not in (-1, *heads):
        lost.append("firstPerson.firstPersonBone")
    return {"lookAt": gaze}


def _range(told: Json, name: str, lost: list[str]) -> dict[str, float]:
    """Return the range of a direction of the gaze; numbers that are missing keep their default."""
    found = {}
    for old, new in (("xRange", "inputMaxValue"), ("yRange", "outputScale")):
        value = value_of(told.get(old), 0.0)
        if value is None:
            lost.append(f"{name}.{old}")
        elif told.get(old) is not None:
            found[new] = value
    return found


def _meta(data: object, textures: StoredTextures | None, lost: list[str]) -> Json:
    """Return the meta data; permissions that version 0.x does not have keep their defaults."""
    given = data if isinstance(data, dict) else {}
    texts = {key: value for key, value in given.items() if isinstance(value, str) and value.strip()}
    meta: Json = {"name": texts.get("title", "")}
    author = texts.get("author")
    meta |= {"authors": [author] if author else [], "licenseUrl": LICENCE}
    for old, new in (("version", "version"), ("contactInformation", "contactInformation")):
        meta |= {new: texts[old]} if old in texts else {}
    meta |= {"references": [texts["reference"]]} if "reference" in texts else {}
    if texts.get("allowedUserName") in _USERS:
        meta["avatarPermission"] = _USERS[texts["allowedUserName"]]
    for old, new in _ALLOWS.items():
        meta |= {new: texts[old] == "Allow"} if old in texts else {}
    meta |= _licence(texts)
    listed, texture = () if textures is None else textures.textures, given.get("texture")
    image = None
    if is_index(texture, len(listed)):
        image = part(listed[texture], "source")
    if isinstance(image, int):
        meta["thumbnailImage"] = image
    elif texture not in (-1, None):
        lost.append("meta.texture")
    return meta


def _licence(texts: dict[str, str]) -> Json:
    """Return the permissions that the licence and the commercial use state."""
    licence, found = texts.get("licenseName", ""), dict[str, Any]()
    if "commercialUssageName" in texts:
        pays = texts["commercialUssageName"] == "Allow" and "_NC" not in licence
        found["commercialUsage"] = "personalProfit" if pays else "personalNonProfit"
    if licence in _LICENCES:
        found["allowRedistribution"] = True
        changes = "prohibited" if licence.endswith("_ND") else "allowModificationRedistribution"
        found["modification"] = changes
        found["creditNotation"] = "unnecessary" if licence == "CC0" else "required"
    elif licence == "Redistribution_Prohibited":
        found["allowRedistribution"] = False
    urls = [texts.get("otherLicenseUrl"), texts.get("otherPermissionUrl"), _LICENCES.get(licence)]
    stated = [url for url in dict.fromkeys(urls) if url]
    if stated:
        found["otherLicenseUrl"] = stated[0]
    if stated[1:]:
        found["thirdPartyLicenses"] = ", ".join(stated[1:])
    return found


def _expressions(data: object, file: NodeFile) -> list[NamedExpression]:
    """Return the expressions, whose binds name nodes instead of meshes."""
    found = []
    materials = list_in(data, "materialProperties")[: len(file.materials)]
    for _, each in objects_in(data, "blendShapeMaster", "blendShapeGroups"):
        told: Json = {"isBinary": each.get("isBinary") is True}
        binds = [bind for bound in list_in(each, "binds") for bind in _binds(bound, file)]
        told |= {"morphTargetBinds": binds} if binds else {}
        changes, undrawn = upgraded_binds(each, materials)
        preset = OLD_PRESETS.get(str(each.get("presetName") or "").lower(), "")
        name = str(each.get("name") or each.get("presetName") or "unnamed")
        found.append(NamedExpression(name, preset, told | changes, undrawn))
    return found


def _binds(told: object, file: NodeFile) -> list[Json]:
    """Return the binds of the nodes that show the mesh of a bind."""
    given = part(told, "weight")
    weight = None if given is None else value_of(given, 0.0)
    bind = {"index": part(told, "index")}
    bind |= {} if weight is None else {"weight": weight / _PERCENT}
    nodes = nodes_with_mesh(file, part(told, "mesh"))
    return [{"node": node, **bind} for node in nodes] or [bind]


def _named(expressions: list[NamedExpression]) -> dict[str, Json]:
    """Return the preset and custom expressions; a further one of a preset becomes a custom one."""
    found: dict[str, Json] = {"preset": {}, "custom": {}}
    for each in expressions:
        binds = [
            b for b in list_in(each.told, "morphTargetBinds") if {"node", "weight"} <= b.keys()
        ]
        told = {**each.told, "morphTargetBinds": binds}
        if not binds:
            del told["morphTargetBinds"]
        if each.preset and each.preset not in found["preset"]:
            found["preset"][each.preset] = told
        else:
            found["custom"][_free(each.name, found)] = told
    return {kind: listed for kind, listed in found.items() if listed}


def _free(name: str, found: dict[str, Json]) -> str:
    """Return a name that no expression has."""
    taken, number, free = {*found["preset"], *found["custom"]}, 1, name
    while free in taken:
        number += 1
        free = f"{name} {number}"
    return free


def _springs(
    data: object, file: NodeFile, source: Source, lost: list[str]
) -> tuple[Json, dict[int, Floats]]:
    """Return ``VRMC_springBone``, empty without springs, and the ends that chains get.

    In version 0.x all nodes below a bone swing, each towards its first child, and the last one
    towards a point 7 cm further. In version 1.0 a chain is a list of nodes; the last one only ends
    it.
    """
    tree, ends = file.tree, dict[int, Floats]()
    children: dict[int, list[int]] = {}
    for node, parent in enumerate(tree.parents.tolist()):
        children.setdefault(parent, []).append(node)
    colliders, groups, places = _colliders(data, tree.n_nodes, lost)
    springs = []
    for index, group in enumerate(list_in(data, "boneGroups")):
        swing, bones = _swing(group), list_in(group, "bones")
        if swing is None or not all(is_index(bone, tree.n_nodes) for bone in bones):
            at = f"/extensions/VRM/secondaryAnimation/boneGroups/{index}"
            source.warn(wording.SPRING, at)
            lost.append(f"secondaryAnimation.boneGroups[{index}]")
            continue
        shared = _shared(group, places, tree.n_nodes)
        for path in (path for bone in bones for path in _paths(bone, children)):
            end = end_below(tree, path[-1])
            if end is not None:
                path.append(tree.n_nodes + len(ends))
                ends[path[-1]] = end
            if path[1:]:
                joints = [{"node": node, **swing} for node in path[:-1]]
                springs.append({**shared, "joints": [*joints, {"node": path[-1]}]})
    if not springs:
        return {}, {}
    found: Json = {"specVersion": "1.0", "springs": springs}
    found |= {"colliders": colliders, "colliderGroups": groups} if colliders else {}
    return found, ends


def _paths(start: int, children: Mapping[int, list[int]]) -> Iterator[list[int]]:
    """Yield a path from a node along first children, and one from each other child."""
    starts = [start]
    while starts:
        path = [starts.pop()]
        while below := children.get(path[-1], []):
            starts += below[:0:-1]
            path.append(below[0])
        yield path


def _shared(group: object, places: Mapping[int, int], n_nodes: int) -> Json:
    """Return the members that all chains of a group have in common."""
    comment, center = part(group, "comment"), part(group, "center")
    found: Json = {"name": comment} if isinstance(comment, str) and comment else {}
    found |= {"center": center} if is_index(center, n_nodes) else {}
    used = [places[n] for n in list_in(group, "colliderGroups") if type(n) is int and n in places]
    return {**found, "colliderGroups": used} if used else found


def _swing(group: object) -> Json | None:
    """Return the parameters of a joint; None if a number is invalid."""
    given = part(group, "gravityDir")
    direction = [0.0, -1.0, 0.0] if given is None else _vector(given)
    names = {"stiffiness": "stiffness", "gravityPower": "gravityPower"}
    names |= {"dragForce": "dragForce", "hitRadius": "hitRadius"}
    found = {new: value_of(part(group, old), 0.0) for old, new in names.items()}
    if direction is None or None in found.values():
        return None
    return {**found, "gravityDir": direction}


def _vector(told: object) -> list[float] | None:
    """Return a vector in our axes, in which missing numbers are 0; None if one is invalid."""
    found = rows_of([part(told, axis) or 0.0 for axis in "xyz"], (0.0, 0.0, 0.0))
    # Adding 0 replaces -0 by 0.
    return None if found is None else (found * (1.0, 1.0, -1.0) + 0.0).tolist()


def _colliders(
    data: object, n_nodes: int, lost: list[str]
) -> tuple[list[Json], list[Json], dict[int, int]]:
    """Return the colliders, their groups, and the new place of each group that is not empty."""
    colliders, groups, places = list[Json](), list[Json](), dict[int, int]()
    for index, each in enumerate(list_in(data, "colliderGroups")):
        own, node = [], part(each, "node")
        for number, sphere in enumerate(list_in(each, "colliders")):
            offset = _vector(part(sphere, "offset"))
            radius = value_of(part(sphere, "radius"), 0.0)
            if offset is None or radius is None or not is_index(node, n_nodes):
                lost.append(f"secondaryAnimation.colliderGroups[{index}].colliders[{number}]")
                continue
            own.append(len(colliders))
            shape = {"sphere": {"offset": offset, "radius": radius}}
            colliders.append({"node": node, "shape": shape})
        if own:
            places[index] = len(groups)
            groups.append({"colliders": own})
    return colliders, groups, places


def _toon(properties: list[object], known: Mapping[int, Json], lost: list[str]) -> dict[int, Json]:
    """Return the extensions of materials, by index, from those they have and the properties."""
    found: dict[int, Json] = {index: dict(each) for index, each in known.items()}
    offsets = _offsets(properties)
    for index, each in enumerate(properties):
        shader = part(each, "shader")
        if shader == "VRM/MToon":
            toon, omitted = modern_toon(each)
            found[index] = {_MTOON: {**toon, "renderQueueOffsetNumber": offsets.get(index, 0)}}
            lost += omitted
        elif isinstance(shader, str) and shader.startswith("VRM/Unlit"):
            found[index] = {_UNLIT: {}}
    return found


def _offsets(properties: list[object]) -> dict[int, int]:
    """Return the order of transparent materials: 0 is last, or first if they write depth."""
    queues: dict[bool, dict[int, int]] = {False: {}, True: {}}
    for index, each in enumerate(properties):
        mode, queue = part(each, "floatProperties", "_BlendMode"), part(each, "renderQueue")
        if mode in _BLENDS and isinstance(queue, int):
            queues[mode == _WRITES_DEPTH][index] = queue
    found = {}
    for writes, own in queues.items():
        order = sorted(set(own.values()))
        for index, queue in own.items():
            place = order.index(queue) if writes else order.index(queue) - len(order) + 1
            found[index] = min(max(place, -_MOST_OFFSET), _MOST_OFFSET)
    return found
