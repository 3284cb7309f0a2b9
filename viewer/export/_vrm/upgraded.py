"""VRM 0.x characters as VRM 1.0: the record of the file, translated member by member.

Indices still refer to the original file. Specifications: ``github.com/vrm-c/vrm-specification``,
``VRM`` 0.0, ``VRMC_vrm``, ``VRMC_springBone`` and ``VRMC_materials_mtoon`` 1.0. Vectors of version
0.x are in Unity's axes, whose z axis is reversed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from viewer.export._vrm.standing import facing_front
from viewer.export._vrm.upgraded_expressions import upgraded_expressions
from viewer.export._vrm.upgraded_meta import upgraded_meta
from viewer.export._vrm.upgraded_springs import upgraded_springs, with_ends
from viewer.export._vrm.upgraded_toon import upgraded_toon
from viewer.formats._vrm.bones import modern_bone
from viewer.formats._vrm.json_parts import listed, part
from viewer.formats._vrm.numbers import rows_of, value_of
from viewer.rig.figure import Figure
from viewer.rig.file_record import VrmRecord

__all__ = ["upgraded"]

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
    front, record = with_ends(facing_front(figure, bones), record, swinging)
    character = {
        "specVersion": "1.0",
        "meta": upgraded_meta(part(data, "meta"), record, figure.name, lost),
        "humanoid": _humanoid(data, lost),
    }
    views = _views(data, record)
    character |= {"firstPerson": {"meshAnnotations": views}} if views else {}
    character |= _gaze(data, lost)
    expressions = upgraded_expressions(data, record, lost)
    character |= {"expressions": expressions} if expressions else {}
    extensions: dict[str, Any] = {"VRMC_vrm": character}
    springs = upgraded_springs(part(data, "secondaryAnimation"), front, record, lost)
    extensions |= {"VRMC_springBone": springs} if springs else {}
    toon = upgraded_toon(listed(data, "materialProperties"), record.toon, lost)
    return front, replace(record, version=1, extensions=extensions, toon=toon), lost


def _humanoid(data: Any, lost: list[str]) -> dict[str, Any]:
    """Return the human bones; Unity's muscle settings have no counterpart."""
    bones: dict[str, Any] = {}
    for each in listed(data, "humanoid", "humanBones"):
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
    for each in listed(data, "firstPerson", "meshAnnotations"):
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
    bones = listed(data, "humanoid", "humanBones")
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
