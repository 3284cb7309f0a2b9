"""Matches between the joints of two skeletons, for retargeting."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from viewer.diagnostics import Diagnostic, Phrase
from viewer.errors import RigError
from viewer.rig.arrays import Ints
from viewer.rig.retargeting.joint_names import joint_meanings, plain_names
from viewer.rig.skeleton import Skeleton, joint_labels

__all__ = ["Matches", "match_joints"]

_LIMBS = ("left_hip left_knee", "right_hip right_knee", "left_shoulder left_elbow",
          "right_shoulder right_elbow")  # fmt: skip


@dataclass(frozen=True, slots=True)
class Matches:
    """The source joints that drive the joints of a target skeleton.

    Attributes
    ----------
    partners : (J,) int32
        Joint of the source for each joint of the target, -1 for none.
    names : tuple of J str
        SMPL names of the target's joints; empty if there is no equivalent.
    is_hierarchy : bool
        Whether both skeletons have the same names and hierarchy.
    notes : tuple of Diagnostic
        Messages about matched joints, joints at rest, and unused joints.
    """

    partners: Ints
    names: tuple[str, ...]
    is_hierarchy: bool
    notes: tuple[Diagnostic, ...]


def match_joints(
    source: Skeleton,
    target: Skeleton,
    mapping: Mapping[str, str] | None,
    titles: tuple[str, str],
) -> Matches:
    """Match joints by mapping, then by the meaning of names, then by equal names.

    Parameters
    ----------
    source, target : Skeleton
        The skeleton of the motion, and the skeleton to which it is retargeted.
    mapping : mapping of str to str, optional
        Joint names of the source to joint names of the target.
    titles : (str, str)
        Names of the two skeletons in messages.

    Raises
    ------
    RigError
        If too few joints match, or the mapping names a missing joint.
    """
    plain = _lower(source.names), _lower(target.names)
    meanings = tuple(joint_meanings(s) for s in (source, target))
    is_hierarchy = not mapping and _has_same_hierarchy(source, target, plain)
    partners = np.full(target.n_joints, -1, dtype=np.int32)
    if is_hierarchy:
        partners[:] = [plain[0].index(name) for name in plain[1]]
    else:
        for key, value in (mapping or {}).items():
            joint = _find(target, value, titles[1])
            partners[joint] = _find(source, key, titles[0])
        for names, allowed in ((meanings, ""), (plain, meanings)):
            _match_equal(partners, names, allowed)
    if not (is_hierarchy or mapping or _is_enough(partners, meanings, plain)):
        raise _misfit(source, target, partners, titles)
    return Matches(
        partners, meanings[1], is_hierarchy, tuple(_notes(source, target, partners, titles))
    )


def _lower(names: Sequence[str]) -> tuple[str, ...]:
    return tuple(name.lower() for name in plain_names(names))


def _has_same_hierarchy(
    source: Skeleton, target: Skeleton, plain: tuple[tuple[str, ...], ...]
) -> bool:
    """Return whether all joints have equal names and parents, in any order."""
    trees = []
    for skeleton, names in zip((source, target), plain, strict=True):
        above = [names[parent] if parent >= 0 else "" for parent in skeleton.parents]
        trees.append(dict(zip(names, above, strict=True)))
    return len(trees[0]) == source.n_joints and trees[0] == trees[1]


def _find(skeleton: Skeleton, name: str, title: str) -> int:
    found = [joint for joint, known in enumerate(skeleton.names) if known == name]
    if len(found) == 1:
        return found[0]
    values = {"joint": name, "figure": title, "n": len(found)}
    key = "F004.mapping-joints" if found else "F004.mapping-joint"
    raise RigError(Diagnostic(key, values=values))


def _match_equal(
    partners: Ints,
    names: tuple[tuple[str, ...], ...],
    meanings: tuple[tuple[str, ...], ...] | str,
) -> None:
    """Match joints with equal names whose meaning is unknown in both skeletons."""
    used = set(partners.tolist())
    known = {
        name: joint
        for joint, name in enumerate(names[0])
        if name and joint not in used and not (meanings and meanings[0][joint])
    }
    for joint, name in enumerate(names[1]):
        if partners[joint] < 0 and name in known and not (meanings and meanings[1][joint]):
            partners[joint] = known[name]


def _is_enough(
    partners: Ints, meanings: tuple[tuple[str, ...], ...], plain: tuple[tuple[str, ...], ...]
) -> bool:
    """Return whether the hips and a limb match, or at least half of the joints."""
    matched = {name for joint, name in enumerate(meanings[1]) if partners[joint] >= 0}
    if "pelvis" in matched and any(set(limb.split()) <= matched for limb in _LIMBS):
        return True
    count = int((partners >= 0).sum())
    return count >= max(2, min(map(len, plain)) / 2)


def _misfit(
    source: Skeleton, target: Skeleton, partners: Ints, titles: tuple[str, str]
) -> RigError:
    unused, idle = _left(source, target, partners)
    values = {
        "motion": titles[0],
        "figure": titles[1],
        "n": int((partners >= 0).sum()),
        "unused": unused,
        "idle": idle,
    }
    return RigError(Diagnostic("F004.joints-unmatched", values=values))


def _left(source: Skeleton, target: Skeleton, partners: Ints) -> tuple[list[str], list[str]]:
    used = set(partners.tolist())
    unused = [label for j, label in enumerate(joint_labels(source)) if j not in used]
    idle = joint_labels(target)
    return unused, [idle[j] for j in np.flatnonzero(partners < 0)]


def _notes(
    source: Skeleton, target: Skeleton, partners: Ints, titles: tuple[str, str]
) -> list[Diagnostic]:
    """Return messages about matched joints and unmatched ones."""
    moved, movers = joint_labels(target), joint_labels(source)
    pairs = [
        Phrase("joint-by-joint", joint=moved[joint], partner=movers[partner])
        for joint, partner in enumerate(partners)
        if partner >= 0 and target.names[joint] != source.names[partner]
    ]
    values = {
        "motion": titles[0],
        "figure": titles[1],
        "n": int((partners >= 0).sum()),
        "all": target.n_joints,
        "pairs": pairs,
    }
    key = "F007.joints-matched-as-follows" if pairs else "F007.joints-matched"
    notes = [Diagnostic(key, values=values)]
    unused, idle = _left(source, target, partners)
    if idle:
        notes.append(Diagnostic("F007.joints-at-rest", values={"names": idle}))
    if unused:
        values = {"motion": titles[0], "names": unused}
        notes.append(Diagnostic("F007.joints-without-partner", values=values))
    return notes
