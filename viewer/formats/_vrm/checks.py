"""Requirements of VRM characters: version, meta data, human bones, and weights of expressions.

Specifications: ``github.com/vrm-c/vrm-specification``, ``VRM`` 0.0 and ``VRMC_vrm`` 1.0.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from viewer.diagnostics import wording
from viewer.formats._source import Source
from viewer.formats._vrm.bones import given_bones
from viewer.formats._vrm.parts import list_in, part
from viewer.phrases import counted, listed, quoted
from viewer.rigs.arrays import Ints
from viewer.rigs.file_record import Json
from viewer.rigs.hierarchy import path_to_root
from viewer.rigs.humanoid import HUMAN_BONES, REQUIRED_BONES, SPINE_BONES, bone_above

_MODERN = "1.0"
MOST_WEIGHT = {0: 100.0, 1: 1.0}
"""Largest weight of a morph target in an expression, by version."""
_REQUIRED_META = ("name", "authors", "licenseUrl")


def check_character(
    source: Source, extensions: Mapping[str, object], version: int, parents: Ints
) -> None:
    """Report what a VRM character lacks or states twice; each place has a JSON pointer.

    ``parents``: (N,), of the nodes.
    """
    key = "VRMC_vrm" if version == 1 else "VRM"
    told, at = extensions[key], f"/extensions/{key}"
    if isinstance(extensions.get("VRM"), dict) and version == 1:
        source.warn(
            "G008.versions: expected one version of VRM, found 0.x besides 1.0: only 1.0 is read",
            "/extensions/VRM",
        )
    if version == 1:
        stated = part(told, "specVersion")
        if stated is None:
            source.warn('G008.no-version: expected specVersion "1.0", found none', at)
        elif stated != _MODERN:
            source.warn(
                'G008.version: expected specVersion "1.0", found {found}: read as 1.0',
                f"{at}/specVersion",
                found=quoted(str(stated)),
            )
    meta = part(told, "meta")
    if not isinstance(meta, dict):
        source.warn("G008.no-meta: expected meta data with authors and licence, found none", at)
    elif version == 1 and (missing := [name for name in _REQUIRED_META if not meta.get(name)]):
        source.warn(
            "G008.meta: expected {names} in the meta data, found none",
            f"{at}/meta",
            names=listed(missing),
        )
    _check_bones(source, told, version, f"{at}/humanoid/humanBones", parents)
    for bind, place, name in weighted_binds(told, version):
        if not is_weight(weight := bind["weight"], version):
            most = MOST_WEIGHT[version]
            source.warn(
                "G008.weight: expression {name}: expected a weight of 0 to {most:g}, found {found}",
                f"{at}/{place}",
                name=quoted(name),
                most=most,
                found=str(weight),
            )


def _check_bones(source: Source, told: object, version: int, at: str, parents: Ints) -> None:
    """Check that all required bones occur, each once and with its own node, below its parent."""
    given = given_bones(told, version)
    if missing := [bone for bone in REQUIRED_BONES if bone not in {bone for _, bone, _ in given}]:
        source.warn(
            "G008.bones: {n} missing: {names}",
            at,
            n=counted(len(missing), "required human bone"),
            names=listed(missing),
        )
    owners: dict[int, str] = {}
    seen: set[str] = set()
    for place, bone, node in given:
        if bone in seen:
            source.warn(wording.BONE_TWICE, f"{at}/{place}", bone=quoted(bone))
        elif type(node) is int and node in owners:
            other = owners[node]
            source.warn(
                "G008.one-node: human bones {other} and {bone}: expected different nodes, found "
                "node {node} for both",
                f"{at}/{place}",
                bone=quoted(bone),
                other=quoted(other),
                node=node,
            )
        elif type(node) is int:
            owners[node] = bone
        seen.add(bone)
    nodes = {bone: node for node, bone in owners.items() if 0 <= node < len(parents)}
    for place, bone, node in given:
        above = bone_above(bone)
        if above not in nodes or bone not in nodes or nodes[bone] != node:
            continue
        if nodes[above] not in path_to_root(parents, nodes[bone])[1:]:
            source.warn(
                "G008.bone-parent: human bone {bone}: expected a node below that of {above} (node "
                "{other}), found node {node}",
                f"{at}/{place}",
                bone=quoted(bone),
                above=quoted(above),
                other=nodes[above],
                node=nodes[bone],
            )
    for found in source.diagnostics:
        if found.key == "G001.repeated" and version == 1:
            for bone in found.values["names"]:
                if bone in HUMAN_BONES or bone in SPINE_BONES:
                    source.warn(wording.BONE_TWICE, f"{at}/{bone}", bone=quoted(bone))


def is_weight(weight: object, version: int) -> bool:
    """Return whether the weight of a morph target in an expression is within its limits."""
    if not isinstance(weight, int | float) or isinstance(weight, bool):
        return False
    return 0.0 <= weight <= MOST_WEIGHT[version]


def weighted_binds(told: object, version: int) -> Iterator[tuple[Json, str, str]]:
    """Yield the binds of morph targets, the place of each weight, and its expression's name."""
    if version == 0:
        for index, each in enumerate(list_in(told, "blendShapeMaster", "blendShapeGroups")):
            for row, bind in enumerate(list_in(each, "binds")):
                if part(bind, "weight") is not None:
                    place = f"blendShapeMaster/blendShapeGroups/{index}/binds/{row}/weight"
                    yield bind, place, str(part(each, "name"))
        return
    for kind in ("preset", "custom"):
        named = part(told, "expressions", kind)
        for name, each in named.items() if isinstance(named, dict) else ():
            for row, bind in enumerate(list_in(each, "morphTargetBinds")):
                if part(bind, "weight") is not None:
                    text = str(name).replace("~", "~0").replace("/", "~1")
                    place = f"expressions/{kind}/{text}/morphTargetBinds/{row}/weight"
                    yield bind, place, str(name)
