"""Matches between the joints of two skeletons, for retargeting."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Sequence

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase, note
from viewer.errors import RigError
from viewer.phrases import Remedy, counted, listed
from viewer.rigs.arrays import Ints
from viewer.rigs.retargeting.joint_map import UNMAPPED, JointMap, mapped_partners
from viewer.rigs.retargeting.joint_names import joint_meanings, joints_by_place
from viewer.rigs.skeleton import Skeleton, joint_labels

_LIMBS = ("left_hip left_knee", "right_hip right_knee", "left_shoulder left_elbow",
          "right_shoulder right_elbow")  # fmt: skip

_Names = tuple[tuple[str, ...], tuple[str, ...]]  # names of the source, and of the target

TIPS = {"wrist": ":hand", "ankle": ":foot"}
"""Ends of the names of joints that stand for the End Sites of forearms and shins."""


@dataclass(frozen=True, slots=True)
class Matches:
    """The source joints that drive the joints of a target skeleton."""

    partners: Ints
    """(J,) int32. Joint of the source for each joint of the target, -1 for none."""
    names: tuple[str, ...]
    """SMPL names of the target's joints; empty if there is no equivalent."""
    is_hierarchy: bool
    """Whether both skeletons have the same names and hierarchy."""
    notes: tuple[Diagnostic, ...]
    """Messages about matched joints, joints at rest, and unused joints."""
    origins: tuple[str, ...]
    """How each joint was matched: ``"map"`` by the joint map, ``"hierarchy"`` with the whole
    hierarchy, ``"humanoid"`` by the human bones that a file states, ``"name"`` by a known name,
    ``"place"`` by its position in the hierarchy, ``"same name"`` by an equal name; empty for
    unmatched joints."""


def match_joints(
    source: Skeleton,
    target: Skeleton,
    joint_map: JointMap | None,
    titles: tuple[str, str],
    is_complete: bool = True,
) -> Matches:
    """Match joints by a map, then by the meaning of names, then by equal names.

    A map that equals the automatic match changes nothing. RigError if too few match although
    ``is_complete``, or the map names a missing joint or one twice.
    """
    plain = _comparable(source.names), _comparable(target.names)
    meanings = joint_meanings(source), joint_meanings(target)
    own = _automatic(source, target, plain, meanings)
    partners, is_mapped = own, np.zeros(target.n_joints, dtype=bool)
    if joint_map is not None:
        partners = mapped_partners(joint_map, source, target, titles)
        is_mapped = partners != UNMAPPED
        _match_by_names(partners, plain, meanings)
    is_hierarchy = _has_same_hierarchy(source, target, plain) and np.array_equal(partners, own)
    is_enough = is_hierarchy or _is_enough(partners, meanings, plain)
    if is_complete and not (is_enough or (joint_map is not None and (partners >= 0).any())):
        raise _misfit(source, target, partners, titles)
    origins = _origins(source, target, partners, meanings)
    if is_hierarchy:
        origins = ["hierarchy"] * target.n_joints
    for joint in np.flatnonzero(is_mapped & (partners != own)).tolist():
        origins[joint] = "map"
    notes = tuple(_notes(source, target, partners, titles))
    return Matches(partners, meanings[1], is_hierarchy, notes, tuple(origins))


def _automatic(source: Skeleton, target: Skeleton, plain: _Names, meanings: _Names) -> Ints:
    """Return the source joint of each target joint without a map: (J,), -1 for none."""
    partners = np.full(target.n_joints, UNMAPPED, dtype=np.int32)
    if _has_same_hierarchy(source, target, plain):
        partners[:] = [plain[0].index(name) for name in plain[1]]
    else:
        _match_by_names(partners, plain, meanings)
    return partners


def _match_by_names(partners: Ints, plain: _Names, meanings: _Names) -> None:
    """Match the joints that are not in the map, in place; -1 for those without a match."""
    for names, known in ((meanings, None), (plain, meanings)):
        _match_equal(partners, names, known)
    partners[partners == UNMAPPED] = -1


def _origins(source: Skeleton, target: Skeleton, partners: Ints, meanings: _Names) -> list[str]:
    """Return how each joint is matched without a map; see ``Matches``."""
    is_stated = source.humanoid is not None or target.humanoid is not None
    placed = joints_by_place(source), joints_by_place(target)
    origins = []
    for joint, partner in enumerate(partners.tolist()):
        meaning = meanings[1][joint]
        if partner < 0 or not meaning or meaning != meanings[0][partner]:
            origins.append("" if partner < 0 else "same name")
        elif is_stated:
            origins.append("humanoid")
        else:
            is_placed = partner in placed[0] or joint in placed[1]
            origins.append("place" if is_placed else "name")
    return origins


def _comparable(names: Sequence[str]) -> tuple[str, ...]:
    """Return unique names in which case, symbols and the width of letters do not matter.

    >>> _comparable(["Left Leg", "left_leg", ""])
    ('left_leg', 'left_leg#2', '#1')
    """
    counts: Counter[str] = Counter()
    found = []
    for name in names:
        text = re.sub(r"\W", "_", unicodedata.normalize("NFKC", name).casefold())
        text = text if text.strip("_") else ""
        counts[text] += 1
        found.append(text if text and counts[text] == 1 else f"{text}#{counts[text]}")
    return tuple(found)


def _has_same_hierarchy(source: Skeleton, target: Skeleton, plain: _Names) -> bool:
    """Return whether all joints have equal names and parents, in any order; tips may be missing."""
    trees = []
    for skeleton, names in zip((source, target), plain, strict=True):
        above = [names[parent] if parent >= 0 else "" for parent in skeleton.parents]
        trees.append(dict(zip(names, above, strict=True)))
    if len(trees[0]) != source.n_joints:
        return False
    tips = {plain[0][joint] for joint in _tips(source)} - {*trees[1]}
    return {name: above for name, above in trees[0].items() if name not in tips} == trees[1]


def _tips(skeleton: Skeleton) -> set[int]:
    """Return joints that stand for the End Sites of their parents."""
    names, parents = skeleton.names, skeleton.parents
    return {
        joint
        for joint, parent in enumerate(parents)
        if parent >= 0 and names[joint] in [names[parent] + tip for tip in TIPS.values()]
    }


def _match_equal(partners: Ints, names: _Names, meanings: _Names | None) -> None:
    """Match joints with equal names; with ``meanings``, those whose meaning is unknown in both."""
    used = set(partners.tolist())
    known = {
        name: joint
        for joint, name in enumerate(names[0])
        # Unnamed joints are "#1", "#2" …, and have nothing in common.
        if name[:1] not in ("", "#") and joint not in used and not (meanings and meanings[0][joint])
    }
    for joint, name in enumerate(names[1]):
        is_open = partners[joint] == UNMAPPED and not (meanings and meanings[1][joint])
        if is_open and name in known:
            partners[joint] = known[name]


def _is_enough(partners: Ints, meanings: _Names, plain: _Names) -> bool:
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
        "n": counted(int((partners >= 0).sum()), "matching joint"),
        "unused": listed(unused),
        "idle": listed(idle),
        "remedy": Remedy(
            "in the Joint match panel", "in the Joint match panel or with --joint-map"
        ),
    }
    return RigError(
        note(
            "F004.joints-unmatched: {motion} does not match {figure}: expected hips and a leg "
            "or an arm in both, found {n}; not recognised in {motion}: {unused}; in {figure}: "
            "{idle}; match them {remedy}",
            **values,
        )
    )


def _left(source: Skeleton, target: Skeleton, partners: Ints) -> tuple[list[str], list[str]]:
    used = {*partners.tolist(), *_tips(source)}
    unused = [label for j, label in enumerate(joint_labels(source)) if j not in used]
    idle = joint_labels(target)
    return unused, [idle[j] for j in np.flatnonzero(partners < 0)]


def _notes(
    source: Skeleton, target: Skeleton, partners: Ints, titles: tuple[str, str]
) -> list[Diagnostic]:
    """Return messages about matched and unmatched joints."""
    moved, movers = joint_labels(target), joint_labels(source)
    pairs = [
        Phrase("{joint} by {partner}", joint=moved[joint], partner=movers[partner])
        for joint, partner in enumerate(partners)
        if partner >= 0 and target.names[joint] != source.names[partner]
    ]
    values = {
        "motion": titles[0],
        "figure": titles[1],
        "n": int((partners >= 0).sum()),
        "all": target.n_joints,
        "pairs": listed(pairs),
    }
    key = (
        "F007.joints-matched-as-follows: {motion} drives {n} of {all} joints of {figure}: {pairs}"
        if pairs
        else "F007.joints-matched: {motion} drives {n} of {all} joints of {figure}"
    )
    notes = [note(key, **values)]
    unused, idle = _left(source, target, partners)
    if idle:
        notes.append(
            note("F007.joints-at-rest: joints kept at rest: {names}", names=listed(idle, 12))
        )
    if unused:
        values = {"motion": titles[0], "names": listed(unused, 12)}
        notes.append(
            note(
                "F007.joints-without-partner: joints of {motion} that drive nothing: {names}",
                **values,
            )
        )
    return notes
