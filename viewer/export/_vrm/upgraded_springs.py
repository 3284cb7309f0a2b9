"""Spring bones of VRM 0.x as those of VRM 1.0.

In version 0.x all joints below a bone swing, each towards its first child, and the last one towards
a point 7 cm further. In version 1.0 a chain is a list of joints; the last one only ends it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from viewer.formats._vrm.json_parts import is_index, listed, part
from viewer.formats._vrm.numbers import rows_of, value_of
from viewer.rig.arrays import Floats, Ints
from viewer.rig.figure import Figure
from viewer.rig.file_record import VrmRecord
from viewer.rig.springs.springs import Springs

__all__ = ["upgraded_springs", "with_ends"]

_DOWN = {"x": 0.0, "y": -1.0, "z": 0.0}


def with_ends(
    figure: Figure, record: VrmRecord, springs: Springs | None
) -> tuple[Figure, VrmRecord]:
    """Return a figure with an end joint below the last joint of each chain, and its record.

    In the record, the nodes of end joints are additional to those of the file.

    ``springs``: those of the figure as read, which include the swinging points.
    """
    skeleton = figure.require_skeleton()
    children = _children(record.joints, skeleton.parents)
    groups = listed(part(record.extensions, "VRM", "secondaryAnimation"), "boneGroups")
    starts = [
        record.joints[bone]
        for group in groups
        for bone in listed(group, "bones")
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


def upgraded_springs(
    data: Any, figure: Figure, record: VrmRecord, lost: list[str]
) -> dict[str, Any]:
    """Return ``VRMC_springBone``; empty if there are no springs.

    ``data``: ``secondaryAnimation``.
    ``figure``, ``record``: from ``with_ends``.
    ``lost``: extended by the chains whose first joint the figure does not have, and by groups and
    colliders with invalid numbers.
    """
    parents = figure.require_skeleton().parents
    children = _children(record.joints, parents)
    nodes = {joint: node for node, joint in record.joints.items()}
    colliders, groups, places = _colliders(data, lost)
    springs = []
    for index, group in enumerate(listed(data, "boneGroups")):
        swing = _swing(group)
        if swing is None:
            lost.append(f"secondaryAnimation.boneGroups[{index}]")
            continue
        shared = _shared(group, places, len(listed(data, "colliderGroups")))
        for bone in listed(group, "bones"):
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
    used = [n for n in listed(group, "colliderGroups") if is_index(n, count) and n in places]
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
    for index, each in enumerate(listed(data, "colliderGroups")):
        own = []
        for number, sphere in enumerate(listed(each, "colliders")):
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
