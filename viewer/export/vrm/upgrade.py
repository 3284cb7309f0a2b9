"""VRM 0.x characters as VRM 1.0: the record of the file, translated member by member.

Indices still refer to the original file. Specifications: ``github.com/vrm-c/vrm-specification``,
``VRM`` 0.0, ``VRMC_vrm``, ``VRMC_springBone`` and ``VRMC_materials_mtoon`` 1.0. Vectors of version
0.x are in Unity's axes, whose z axis is reversed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from viewer.export.vrm.canonical_pose import facing_front
from viewer.export.vrm.meta import LICENCE
from viewer.formats._vrm.bones import modern_bone
from viewer.formats._vrm.materials import modern_toon, old_binds
from viewer.formats._vrm.parts import is_index, list_in, part, rows_of, value_of
from viewer.rig.arrays import Floats, Ints
from viewer.rig.expressions import OLD_PRESETS, TRANSFORM
from viewer.rig.figure import Figure
from viewer.rig.file_record import VrmRecord
from viewer.rig.springs.springs import Springs

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

# Springs
_DOWN = {"x": 0.0, "y": -1.0, "z": 0.0}

# Materials
_TOON, _UNLIT = "VRMC_materials_mtoon", "KHR_materials_unlit"
_BLENDS, _WRITES_DEPTH = (2, 3), 3  # _BlendMode
_MOST_OFFSET = 9


def upgraded(
    figure: Figure, record: VrmRecord, bones: Mapping[str, int]
) -> tuple[Figure, VrmRecord, list[str]]:
    """Return a figure that faces +z and has an end joint for each spring chain, and its record.

    ``record``: record of a VRM 0.x file.
    ``bones``: joint of each human bone.
    Also returns the members without a counterpart in VRM 1.0.
    """
    data, lost = part(record.extensions, "VRM"), list[str]()
    swinging = figure.require_skeleton().springs
    front, record = _with_ends(facing_front(figure, bones), record, swinging)
    character = {
        "specVersion": "1.0",
        "meta": _upgraded_meta(part(data, "meta"), record, figure.name, lost),
        "humanoid": _humanoid(data, lost),
    }
    views = _views(data, record)
    character |= {"firstPerson": {"meshAnnotations": views}} if views else {}
    character |= _gaze(data, lost)
    expressions = _upgraded_expressions(data, record, lost)
    character |= {"expressions": expressions} if expressions else {}
    extensions: dict[str, Any] = {"VRMC_vrm": character}
    springs = _upgraded_springs(part(data, "secondaryAnimation"), front, record, lost)
    extensions |= {"VRMC_springBone": springs} if springs else {}
    toon = _upgraded_toon(list_in(data, "materialProperties"), record.toon, lost)
    return front, replace(record, version=1, extensions=extensions, toon=toon), lost


def _humanoid(data: Any, lost: list[str]) -> dict[str, Any]:
    """Return the human bones; Unity's muscle settings have no counterpart."""
    bones: dict[str, Any] = {}
    for each in list_in(data, "humanoid", "humanBones"):
        bone = part(each, "bone")
        if isinstance(bone, str):
            bones.setdefault(modern_bone(bone), {"node": part(each, "node")})
            if part(each, "useDefaultValues") is False:
                lost.append(f"humanoid.{bone}")
    for name, default in _MUSCLES.items():
        value = part(data, "humanoid", name)
        # Not a difference: an integer may be too large for a float.
        if isinstance(value, int | float) and not default - _SAME <= value <= default + _SAME:
            lost.append(f"humanoid.{name}")
    return {"humanBones": bones}


def _views(data: Any, record: VrmRecord) -> list[Any]:
    """Return annotations of nodes, converted from annotations of meshes."""
    found = []
    for each in list_in(data, "firstPerson", "meshAnnotations"):
        view = _VIEWS.get(str(part(each, "firstPersonFlag")).lower(), "auto")
        nodes = [node for node, mesh in record.meshes.items() if mesh == part(each, "mesh")]
        found += [{"node": node, "type": view} for node in nodes]
    return found


def _gaze(data: Any, lost: list[str]) -> dict[str, Any]:
    """Return the gaze; its ranges are linear in version 1.0."""
    first = part(data, "firstPerson")
    if not isinstance(first, dict):
        return {}
    is_bone = str(first.get("lookAtTypeName", "Bone")).lower() == "bone"
    gaze: dict[str, Any] = {"type": "bone" if is_bone else "expression"}
    offset = first.get("firstPersonBoneOffset")
    if isinstance(offset, dict):
        place = rows_of([offset.get(axis) or 0.0 for axis in "xyz"], (0.0, 0.0, 0.0))
        if place is None:
            lost.append("firstPerson.firstPersonBoneOffset")
        else:
            gaze["offsetFromHeadBone"] = (place * (1.0, 1.0, -1.0) + 0.0).tolist()
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


def _range(told: dict[str, Any], name: str, lost: list[str]) -> dict[str, float]:
    """Return the range of a direction of the gaze; numbers that are missing keep their default."""
    found = {}
    for old, new in (("xRange", "inputMaxValue"), ("yRange", "outputScale")):
        value = value_of(told.get(old), 0.0)
        if value is None:
            lost.append(f"{name}.{old}")
        elif told.get(old) is not None:
            found[new] = value
    return found


def _upgraded_meta(data: Any, record: VrmRecord, name: str, lost: list[str]) -> dict[str, Any]:
    """Return the meta data; permissions that version 0.x does not have keep their defaults.

    ``data``: meta data of version 0.x.
    ``record``: record of the file, whose textures include the thumbnail.
    ``name``: used if the meta data has none.
    ``lost``: extended by the members without a counterpart.
    """
    given = data if isinstance(data, dict) else {}
    texts = {key: value for key, value in given.items() if isinstance(value, str) and value.strip()}
    meta: dict[str, Any] = {"name": texts.get("title", name)}
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
    image = _thumbnail(given.get("texture"), record)
    if image is not None:
        meta["thumbnailImage"] = image
    elif given.get("texture", -1) not in (-1, None):
        lost.append("meta.texture")
    return meta


def _licence(texts: dict[str, str]) -> dict[str, Any]:
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


def _thumbnail(texture: Any, record: VrmRecord) -> int | None:
    """Return the image of a texture; None if there is none."""
    textures = () if record.textures is None else record.textures.textures
    source = part(textures[texture], "source") if is_index(texture, len(textures)) else None
    return source if isinstance(source, int) else None


def _upgraded_expressions(told: Any, record: VrmRecord, lost: list[str]) -> dict[str, Any]:
    """Return the preset and custom expressions; a further one of a preset becomes a custom one.

    ``told``: the extension ``VRM``, whose ``blendShapeGroups`` have name, presetName, isBinary,
    binds (mesh, index, weight in percent), and materialValues.
    ``lost``: extended by the material values without a counterpart.
    """
    found: dict[str, dict[str, Any]] = {"preset": {}, "custom": {}}
    materials = list_in(told, "materialProperties")
    for each in list_in(told, "blendShapeMaster", "blendShapeGroups"):
        if not isinstance(each, dict):
            continue
        expression: dict[str, Any] = {"isBinary": each.get("isBinary") is True}
        binds = _binds(each, record)
        expression |= {"morphTargetBinds": binds} if binds else {}
        expression |= _material_binds(each, materials, lost)
        preset = OLD_PRESETS.get(str(each.get("presetName", "")).lower(), "")
        if preset and preset not in found["preset"]:
            found["preset"][preset] = expression
        else:
            found["custom"][_free(str(each.get("name") or "unnamed"), found)] = expression
    return {kind: listed for kind, listed in found.items() if listed}


def _free(name: str, found: dict[str, dict[str, Any]]) -> str:
    """Return a name that no expression has."""
    taken, number, free = {*found["preset"], *found["custom"]}, 1, name
    while free in taken:
        number += 1
        free = f"{name} {number}"
    return free


def _binds(told: dict[str, Any], record: VrmRecord) -> list[Any]:
    """Return the binds of nodes from those of meshes."""
    return [
        {"node": node, "index": part(each, "index"), "weight": weight / _PERCENT}
        for each in list_in(told, "binds")
        if (weight := value_of(part(each, "weight"), 0.0)) is not None
        for node, mesh in record.meshes.items()
        if mesh == part(each, "mesh")
    ]


def _material_binds(told: dict[str, Any], materials: list[Any], lost: list[str]) -> dict[str, Any]:
    """Return the binds of colours and of texture transforms."""
    binds, unknown = old_binds(told, materials)
    lost += [f"materialValues {each}" for each in unknown]
    colors = [
        {"material": owner, "type": kind, "targetValue": value.tolist()}
        for owner, kind, value in binds
        if kind != TRANSFORM
    ]
    moves = [
        {"material": owner, "scale": value[:2].tolist(), "offset": value[2:].tolist()}
        for owner, kind, value in binds
        if kind == TRANSFORM
    ]
    named = {"materialColorBinds": colors, "textureTransformBinds": moves}
    return {name: rows for name, rows in named.items() if rows}


def _with_ends(
    figure: Figure, record: VrmRecord, springs: Springs | None
) -> tuple[Figure, VrmRecord]:
    """Return a figure with an end joint below the last joint of each chain, and its record.

    In version 0.x all joints below a bone swing, each towards its first child, and the last one
    towards a point 7 cm further. In version 1.0 a chain is a list of joints; the last one only ends
    it. In the record, the nodes of end joints are additional to those of the file.

    ``springs``: those of the figure as read, which include the swinging points.
    """
    skeleton = figure.require_skeleton()
    children = _children(record.joints, skeleton.parents)
    groups = list_in(part(record.extensions, "VRM", "secondaryAnimation"), "boneGroups")
    starts = [
        record.joints[bone]
        for group in groups
        for bone in list_in(group, "bones")
        if isinstance(bone, int) and bone in record.joints
    ]
    last = {path[-1] for start in starts for path in _paths(start, children)}
    rows = {} if springs is None else {int(j): row for row, j in enumerate(springs.joints)}
    tails = {joint: springs.tails[rows[joint]] for joint in sorted(last & {*rows}) if springs}
    if not tails:
        return figure, record
    first, n_joints = 1 + max(*record.joints, *record.parts, 0), skeleton.n_joints
    joints = dict(record.joints) | {first + row: n_joints + row for row in range(len(tails))}
    return _extended(figure, tails), replace(record, joints=joints)


def _extended(figure: Figure, tails: Mapping[int, Floats]) -> Figure:
    """Return a figure with an additional joint below each of these, at these positions."""
    skeleton, count, skin = figure.require_skeleton(), len(tails), figure.skin
    more = replace(
        skeleton,
        names=(*skeleton.names, *(f"{skeleton.names[joint]}_end" for joint in tails)),
        parents=np.append(skeleton.parents, [*tails]).astype(np.int32),
        rest_translations=np.vstack([skeleton.rest_translations, *tails.values()]),
        rest_rotations=np.vstack([skeleton.rest_rotations, *[[0.0, 0.0, 0.0, 1.0]] * count]),
        rest_scales=np.vstack([skeleton.rest_scales, np.ones((count, 3))]),
        auxiliary=None
        if skeleton.auxiliary is None
        else np.append(skeleton.auxiliary, np.zeros(count, dtype=np.bool_)),
    )
    if skin is not None:
        bound = np.vstack([skin.inverse_bind, np.tile(np.eye(4), (count, 1, 1))])
        skin = replace(skin, inverse_bind=bound)
    return replace(figure, skeleton=more, skin=skin)


def _children(joints: Mapping[int, int], parents: Ints) -> dict[int, list[int]]:
    """Return the joints below each joint, in the order of their nodes."""
    found: dict[int, list[int]] = {}
    for _, joint in sorted(joints.items()):
        found.setdefault(int(parents[joint]), []).append(joint)
    return found


def _paths(start: int, children: Mapping[int, list[int]]) -> Iterator[list[int]]:
    """Yield a path from a joint along first children, and one from each other child."""
    starts = [start]
    while starts:
        path = [starts.pop()]
        while below := children.get(path[-1], []):
            starts += below[:0:-1]
            path.append(below[0])
        yield path


def _upgraded_springs(
    data: Any, figure: Figure, record: VrmRecord, lost: list[str]
) -> dict[str, Any]:
    """Return ``VRMC_springBone``; empty if there are no springs.

    ``data``: ``secondaryAnimation``.
    ``figure``, ``record``: from ``_with_ends``.
    ``lost``: extended by the chains whose first joint the figure does not have, and by groups and
    colliders with invalid numbers.
    """
    parents = figure.require_skeleton().parents
    children = _children(record.joints, parents)
    nodes = {joint: node for node, joint in record.joints.items()}
    colliders, groups, places = _colliders(data, lost)
    springs = []
    for index, group in enumerate(list_in(data, "boneGroups")):
        swing = _swing(group)
        if swing is None:
            lost.append(f"secondaryAnimation.boneGroups[{index}]")
            continue
        shared = _shared(group, places, len(list_in(data, "colliderGroups")))
        for bone in list_in(group, "bones"):
            if not isinstance(bone, int) or bone not in record.joints:
                lost.append(f"secondaryAnimation.boneGroups.bones {bone}")
                continue
            for path in _paths(record.joints[bone], children):
                rows = [{"node": nodes[joint], **swing} for joint in path[:-1]]
                if rows:
                    joints = [*rows, {"node": nodes[path[-1]]}]
                    springs.append({**shared, "joints": joints})
    if not springs:
        return {}
    found: dict[str, Any] = {"specVersion": "1.0", "springs": springs}
    return {**found, "colliders": colliders, "colliderGroups": groups} if colliders else found


def _shared(group: Any, places: Mapping[int, int], count: int) -> dict[str, Any]:
    """Return the members that all chains of a group have in common."""
    comment, center = part(group, "comment"), part(group, "center")
    found: dict[str, Any] = {"name": comment} if isinstance(comment, str) and comment else {}
    found |= {"center": center} if isinstance(center, int) and center >= 0 else {}
    used = [n for n in list_in(group, "colliderGroups") if is_index(n, count) and n in places]
    return {**found, "colliderGroups": [places[n] for n in used]} if used else found


def _swing(group: Any) -> dict[str, Any] | None:
    """Return the parameters of a joint, with rotated gravity; None if a number is invalid."""
    direction = _vector(part(group, "gravityDir") or _DOWN)
    names = {"stiffiness": "stiffness", "gravityPower": "gravityPower"}
    names |= {"dragForce": "dragForce", "hitRadius": "hitRadius"}
    found = {new: value_of(part(group, old), 0.0) for old, new in names.items()}
    if direction is None or None in found.values():
        return None
    x, y, z = direction
    return {**found, "gravityDir": [0.0 - x, y, z]}


def _vector(told: Any) -> list[float] | None:
    """Return a vector, in which missing numbers are 0; None if a number is invalid."""
    found = rows_of([part(told, axis) or 0.0 for axis in "xyz"], (0.0, 0.0, 0.0))
    return None if found is None else found.tolist()


def _colliders(data: Any, lost: list[str]) -> tuple[list[Any], list[Any], dict[int, int]]:
    """Return the colliders, their groups, and the new place of each group that is not empty."""
    colliders, groups, places = list[Any](), list[Any](), dict[int, int]()
    for index, each in enumerate(list_in(data, "colliderGroups")):
        own = []
        for number, sphere in enumerate(list_in(each, "colliders")):
            offset = _vector(part(sphere, "offset"))
            radius = value_of(part(sphere, "radius"), 0.0)
            if offset is None or radius is None:
                lost.append(f"secondaryAnimation.colliderGroups[{index}].colliders[{number}]")
                continue
            x, y, z = offset
            shape = {"sphere": {"offset": [x, y, 0.0 - z], "radius": radius}}
            own.append(len(colliders))
            colliders.append({"node": part(each, "node"), "shape": shape})
        if own:
            places[index] = len(groups)
            groups.append({"colliders": own})
    return colliders, groups, places


def _upgraded_toon(
    properties: list[Any], known: Mapping[int, Any], lost: list[str]
) -> dict[int, Any]:
    """Return the extensions of each material, by index.

    ``properties``: ``materialProperties``, parallel to the materials.
    ``known``: extensions that the materials already have.
    ``lost``: extended by the properties without a counterpart.
    """
    found: dict[int, Any] = {index: dict(each) for index, each in known.items()}
    offsets = _offsets(properties)
    for index, each in enumerate(properties):
        shader = part(each, "shader")
        if shader == "VRM/MToon":
            toon, omitted = modern_toon(each)
            found[index] = {_TOON: {**toon, "renderQueueOffsetNumber": offsets.get(index, 0)}}
            lost += omitted
        elif isinstance(shader, str) and shader.startswith("VRM/Unlit"):
            found[index] = {_UNLIT: {}}
    return found


def _offsets(properties: list[Any]) -> dict[int, int]:
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
