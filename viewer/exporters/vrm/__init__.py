"""Exporter for VRM 1.0 characters: a ``.glb`` with human bones, meta data and more.

A figure from a VRM file keeps all data of its extensions, which the reader upgrades if they are of
version 0.x; such a figure is turned to face +z. Any other figure with the required human bones is
written at rest in a T-pose, in metres, facing +z. Specification:
``github.com/vrm-c/vrm-specification``.
"""

from __future__ import annotations

import copy
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic, Phrase, note, wording
from viewer.errors import RigError
from viewer.exporters import gltf
from viewer.exporters._exporter import Part, Selection
from viewer.exporters._options import ExportOptions, VrmMeta
from viewer.exporters.gltf.body import Body, Built
from viewer.exporters.gltf.document import Document, text_of
from viewer.exporters.vrm.canonical_pose import facing_front, in_t_pose, standing
from viewer.exporters.vrm.humanoid import human_bones
from viewer.exporters.vrm.kept_extensions import Maps, kept_extensions, kept_toon
from viewer.exporters.vrm.new_extension import made_character
from viewer.formats._vrm.bones import given_bones
from viewer.formats._vrm.checks import MOST_WEIGHT, is_weight, weighted_binds
from viewer.formats._vrm.parts import list_in, part, value_of
from viewer.formats._vrm.springs import EXTENDED
from viewer.formats._vrm.upgrade import LICENCE
from viewer.phrases import Remedy, agree, all_of, counted, listed, rounded
from viewer.rigs.arrays import Floats
from viewer.rigs.constraints.constraint import Constraint
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.file_record import Json, VrmRecord
from viewer.rigs.humanoid import REQUIRED_BONES
from viewer.rigs.pose import pose_key
from viewer.rigs.scene import Actor
from viewer.rigs.springs.spring_joints import Springs
from viewer.rigs.units import METRES, UNIT_NAMES

_STRAIGHT = 1e-4  # radians
_CONSTRAINT = "VRMC_node_constraint"
_SPRINGS = "VRMC_springBone"
_TOON = "VRMC_materials_mtoon"
_UNLIT = "KHR_materials_unlit"
_TRANSFORM = "KHR_texture_transform"
_AXES = "XYZ"


def export(selection: Selection, path: Path, options: ExportOptions) -> list[Diagnostic]:
    """Write a figure in its rest pose; see ``viewer.exporters.export``.

    ``meta``: name, authors and licence; those of the file if omitted or empty. Raises ``RigError``
    if the figure lacks a required bone, or its authors or licence are unknown. Raises
    ``OutputError`` if the file cannot be written.
    """
    actor = selection.part.actor
    figure, given = actor.figure, options.meta
    bones = human_bones(figure)
    record = None if figure.record is None else figure.record.vrm
    notes = _left_out(actor)
    still = replace(actor, own_pose=figure_pose(figure), clip=None, hidden_parts=frozenset())
    if record is not None:
        record, names = _repaired(record, bones)
        if names:
            notes.append(
                note(
                    "X005.vrm-repaired: corrected, because the VRM file violated the "
                    "specification: "
                    "{names}",
                    names=listed(names),
                    n=len(names),
                )
            )
        told = record.extensions["VRMC_vrm"].get("meta")
        authors, licence = part(told, "authors"), part(told, "licenseUrl")
        if not (authors and licence):
            authors = given.authors or tuple(authors or ())
            licence = given.licence or licence or ""
            checked_meta(replace(given, authors=authors, licence=licence), figure.name)
    if record is not None and record.old_members is not None:
        figure, record = _facing_front(figure, record, bones)
        still = replace(still, figure=figure, own_pose=figure_pose(figure))
        if lost := record.old_members:
            notes.append(
                note(
                    "X003.vrm-upgrade: {n} of the VRM 0.x file {have} no counterpart in VRM 1.0: "
                    "{names}",
                    names=listed([*lost], 8),
                    n=counted(len(lost), "member"),
                    have=agree(len(lost), "has", "have"),
                )
            )
    if record is not None:
        extend = partial(_add_kept, record, given)
        return gltf.write_poses(Selection([Part(still)]), path, options, extend) + notes
    added_meta = checked_meta(given, figure.name)
    pose = figure_pose(figure)
    pose.shape_weights = actor.pose.shape_weights.copy()
    figure, angle = in_t_pose(standing(figure, pose, bones), bones)
    still = replace(still, figure=figure, own_pose=figure_pose(figure))
    if angle > _STRAIGHT:
        notes.append(
            note(
                "X005.t-pose: the rest pose is a T-pose, as VRM requires: joints are rotated by up "
                "to {degrees} degrees",
                degrees=rounded(float(np.degrees(angle))),
            )
        )
    notes += _unit_notes(actor.figure)
    extend = partial(_add_made, bones, added_meta)
    return gltf.write_poses(Selection([Part(still)]), path, options, extend) + notes


def require(figure: Figure) -> None:
    """Raise RigError for a figure that lacks a required human bone."""
    human_bones(figure)


def _repaired(record: VrmRecord, bones: Mapping[str, int]) -> tuple[VrmRecord, list[str]]:
    """Return a record without invalid values, and the names of what was corrected."""
    told, names = copy.deepcopy(record.extensions["VRMC_vrm"]), list[str]()
    if told.get("specVersion") != "1.0":
        told["specVersion"] = "1.0"
        names.append("specVersion")
    if "VRM" in record.extensions:
        names.append("VRM 0.x besides 1.0")
    names += [f"human bone {bone}" for bone in _remove_bones(told, bones)]
    names += [f"weights of {name}" for name in dict.fromkeys(_limit_weights(told))]
    return replace(record, extensions={**record.extensions, "VRMC_vrm": told}), names


def _remove_bones(told: Json, bones: Mapping[str, int]) -> list[str]:
    """Remove the bones that are unknown, misplaced, or have the node of an earlier one."""
    removed: list[str] = []
    nodes: list[object] = []
    # Required bones come first, so that they keep a node that an optional bone also uses.
    rows = sorted(given_bones(told, 1), key=lambda row: row[1] not in REQUIRED_BONES)
    for _, bone, node in rows:
        if bone not in bones or node in nodes:
            removed.append(bone)
            del told["humanoid"]["humanBones"][bone]
        else:
            nodes.append(node)
    return removed


def _limit_weights(told: object) -> list[str]:
    """Limit the weights of expressions; return the names of those that were changed."""
    changed = []
    for bind, _, name in weighted_binds(told, 1):
        if not is_weight(bind["weight"], 1):
            weight = value_of(bind["weight"], 0.0)
            if weight is None:
                bind.clear()  # a bind without indices is not written, and counted as lost
                continue
            bind["weight"] = min(max(weight, 0.0), MOST_WEIGHT[1])
            changed.append(name)
    return changed


def _facing_front(
    figure: Figure, record: VrmRecord, bones: Mapping[str, int]
) -> tuple[Figure, VrmRecord]:
    """Return a VRM 0.x character that faces +z instead of -z, with the ends of its chains."""
    springs = figure.require_skeleton().springs
    figure, record = _with_ends(facing_front(figure, bones), record, springs)
    chains = copy.deepcopy(list_in(record.extensions.get(_SPRINGS), "springs"))
    for each in (each for chain in chains for each in chain["joints"] if "gravityDir" in each):
        # Gravity is the only vector in the space of the scene; others turn with their nodes.
        x, y, z = each["gravityDir"]
        each["gravityDir"] = [0.0 - x, y, 0.0 - z]
    if chains:
        told = {**record.extensions[_SPRINGS], "springs": chains}
        record = replace(record, extensions={**record.extensions, _SPRINGS: told})
    return figure, record


def _with_ends(
    figure: Figure, record: VrmRecord, springs: Springs | None
) -> tuple[Figure, VrmRecord]:
    """Return a figure with a joint for the end of each chain that ends in no joint."""
    rows = {} if springs is None else {joint: row for row, joint in enumerate(springs.joints)}
    chains = []
    tails: dict[int, Floats] = {}
    ends: dict[int, int] = {}
    for chain in list_in(record.extensions.get(_SPRINGS), "springs"):
        told = chain["joints"]
        own = [each for each in told if each["node"] in record.joints]
        last = record.joints[own[-1]["node"]] if own else -1
        if springs is not None and len(own) < len(told) and last in rows:
            end = told[len(own)]["node"]
            tails[last], ends[last] = springs.tails[rows[last]], end
            own.append({"node": end})
        chains.append({**chain, "joints": own or told})
    if not tails:
        return figure, record
    tails = dict(sorted(tails.items()))
    first = figure.require_skeleton().n_joints
    joints = {**record.joints} | {ends[last]: first + row for row, last in enumerate(tails)}
    told = {**record.extensions[_SPRINGS], "springs": chains}
    extensions = {**record.extensions, _SPRINGS: told}
    return _extended(figure, tails), replace(record, joints=joints, extensions=extensions)


def _extended(figure: Figure, tails: Mapping[int, Floats]) -> Figure:
    """Return a figure with an additional joint below each of these, at these positions (3,)."""
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


def _unit_notes(figure: Figure) -> list[Diagnostic]:
    """Return a note about lengths that are converted, or whose unit is unknown."""
    if figure.unit not in METRES:
        return [note(wording.UNIT_UNKNOWN_METRES, figure=figure.name)]
    if METRES[figure.unit] != 1.0:
        return [note(wording.UNIT_CONVERTED, unit=UNIT_NAMES[figure.unit])]
    return []


def _left_out(actor: Actor) -> list[Diagnostic]:
    """Return notes about pose and motions, which are not part of a VRM character."""
    notes, figure = [], actor.figure
    if actor.clip is not None or figure.animations:
        n = max(len(figure.animations), 1)
        notes.append(
            note(
                "X003.vrm-motions: {n} omitted: VRM files store no motion; write motions as .glb",
                n=counted(n, "animation", "is", "are"),
            )
        )
    elif actor.own_pose is not None:
        own = figure_pose(figure)
        own.shape_weights = actor.own_pose.shape_weights
        if pose_key(own) != pose_key(actor.own_pose):
            notes.append(
                Diagnostic(
                    "X003.vrm-pose: the current pose is omitted: VRM files store the rest pose"
                )
            )
    return notes


def _add_kept(
    record: VrmRecord, meta: VrmMeta, document: Document, body: Body, built: Built
) -> list[Diagnostic]:
    """Add the extensions of the figure's own file; return notes about lost references."""
    maps = Maps(record, document, built)
    extensions = kept_extensions(maps)
    _keep_shading(record, document, maps)
    data = extensions["VRMC_vrm"]
    data["meta"] = _changed_meta(data["meta"], meta)
    if not data["meta"].get("name"):
        data["meta"]["name"] = text_of(body.figure.name)
    _add(document, body, built, extensions)
    colliders = list_in(extensions.get(_SPRINGS), "colliders")
    if any(part(each, "extensions", EXTENDED) is not None for each in colliders):
        document.declare(EXTENDED)
    return [_written(data, extensions), *_lost(maps.lost)]


def _keep_shading(record: VrmRecord, document: Document, maps: Maps) -> None:
    """Add the file's toon extensions to its materials, and keep only its unlit extensions."""
    for own, written in maps.materials.items():
        given = record.toon.get(own, {})
        item = document.root["materials"][written].setdefault("extensions", {})
        if _UNLIT not in given:
            item.pop(_UNLIT, None)
        if _TOON in given:
            item[_TOON] = kept_toon(given[_TOON], maps)
            document.declare(_TOON)
            extensions = (part(each, "extensions") for each in item[_TOON].values())
            if any(isinstance(each, dict) and _TRANSFORM in each for each in extensions):
                document.declare(_TRANSFORM)
        if _UNLIT in given:
            item[_UNLIT] = given[_UNLIT]
            document.declare(_UNLIT)
        if not item:
            del document.root["materials"][written]["extensions"]
    items = document.root.get("materials", ())
    is_used = any(_UNLIT in item.get("extensions", {}) for item in items)
    used = document.root.get("extensionsUsed", [])
    if _UNLIT in used and not is_used:
        used.remove(_UNLIT)


def _add_made(
    bones: Mapping[str, int], meta: Json, document: Document, body: Body, built: Built
) -> list[Diagnostic]:
    """Add the extension of a figure from another format."""
    extensions = {"VRMC_vrm": made_character(body, built, bones, meta)}
    _add(document, body, built, extensions)
    notes = [_written(extensions["VRMC_vrm"], extensions)]
    if meta["licenseUrl"] != LICENCE:
        notes.append(
            note(
                "X005.vrm-licence: programs may refuse a VRM 1.0 file with a licence other than "
                "{licence}",
                licence=LICENCE,
            )
        )
    return notes


def _add(document: Document, body: Body, built: Built, extensions: Mapping[str, object]) -> None:
    """Add root extensions, and the constraints of nodes."""
    document.root["extensions"] = dict(extensions)
    document.declare(*extensions)
    skeleton = body.figure.require_skeleton()
    joints = built.tree.joints
    for each in skeleton.constraints:
        item = {"specVersion": "1.0", "constraint": {each.kind: _item(each, joints)}}
        extended = document.root["nodes"][joints[each.joint]].setdefault("extensions", {})
        extended[_CONSTRAINT] = item
        document.declare(_CONSTRAINT)


def _written(data: Json, extensions: Mapping[str, object]) -> Diagnostic:
    """Return a note that counts the contents of the extensions."""
    bones = data["humanoid"]["humanBones"]
    n_expressions = sum(_size(part(data, "expressions", kind)) for kind in ("preset", "custom"))
    n_chains = _size(part(extensions.get(_SPRINGS), "springs"))
    parts = [
        Phrase("{n}", n=counted(len(bones), "human bone")),
        Phrase("{n}", n=counted(n_expressions, "expression")),
    ]
    parts.append(Phrase("{n}", n=counted(n_chains, "spring chain")))
    return note("X001.vrm: VRM 1.0: {parts}", parts=all_of(parts))


def _size(data: object) -> int:
    """Return the number of members of parsed JSON; 0 if it is neither a list nor an object."""
    return len(data) if isinstance(data, list | dict) else 0


_LOST = {
    "bones": "human bone",
    "annotations": "first-person setting",
    "morph-binds": "morph target bind",
    "material-binds": "material bind",
    "textures": "texture",
    "colliders": "collider",
    "spring-joints": "spring joint",
    "centers": "spring centre",
}
"""Names of references that could not be kept."""


def _lost(lost: Counter[str]) -> list[Diagnostic]:
    """Return a note about references that could not be kept, if there are any."""
    parts = [
        Phrase("{n}", n=counted(count, _LOST[kind]))
        for kind, count in sorted(lost.items())
        if count
    ]
    return (
        [
            note(
                "X003.vrm-lost: references of the VRM file to parts that are not written: {parts}",
                parts=all_of(parts),
            )
        ]
        if parts
        else []
    )


def _item(each: Constraint, joints: list[int]) -> Json:
    item: Json = {"source": joints[each.source], "weight": each.weight}
    axis = max(range(3), key=lambda index: abs(each.axis[index]))
    if each.kind == "roll":
        item["rollAxis"] = _AXES[axis]
    elif each.kind == "aim":
        item["aimAxis"] = ("Positive" if each.axis[axis] > 0.0 else "Negative") + _AXES[axis]
    return item


def checked_meta(meta: VrmMeta, figure: str) -> Json:
    """Return meta data for a new VRM 1.0; without authors or a licence it raises RigError."""
    if not any(meta.authors) or not meta.licence:
        raise RigError(
            note(
                "F004.vrm-meta: {figure} cannot be written as VRM without author and licence: "
                "{remedy}",
                figure=figure,
                licence=LICENCE,
                remedy=Remedy(
                    "use viewer convert",
                    f"add --vrm-author NAME and --vrm-licence URL, such as {LICENCE} (the "
                    f"strictest permissions)",
                ),
            )
        )
    return {
        "name": text_of(meta.name or figure),
        "authors": [text_of(author) for author in meta.authors if author],
        "licenseUrl": text_of(meta.licence),
    }


def _changed_meta(data: Json, meta: VrmMeta) -> Json:
    """Return a file's meta data with the requested changes; empty ones keep those of the file."""
    changed = dict(data)
    if meta.name:
        changed["name"] = text_of(meta.name)
    listed = [text_of(author) for author in meta.authors if author]
    if listed:
        changed["authors"] = listed
    if meta.licence:
        changed["licenseUrl"] = text_of(meta.licence)
    return changed
