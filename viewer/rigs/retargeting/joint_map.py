"""Joint maps: user-defined assignment of source joints to the joints of a target skeleton."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.errors import RigError
from viewer.near_names import name_hint
from viewer.phrases import quoted
from viewer.rigs.arrays import Ints
from viewer.rigs.skeleton import Skeleton, joint_labels, shown_joints

UNMAPPED = -2
"""Entry of ``mapped_partners`` for joints that are not in the map."""


@dataclass(frozen=True, slots=True)
class JointMap:
    """Target joints by label, each at most once, and their source joints; others match by names."""

    pairs: tuple[tuple[str, str], ...]
    """Labels of a target joint and of its source joint, as in ``joint_labels``; the second is empty
    for a joint that stays at rest."""
    path: Path | None = None
    """The file, for messages."""
    lines: tuple[int, ...] = ()
    """Line of each pair in the file; empty without a file."""


def joint_map_of(partners: Ints, source: Skeleton, target: Skeleton) -> JointMap:
    """Return a map of every joint of a match ``partners`` (J,), those at rest (-1) included."""
    sources, targets = joint_labels(source), joint_labels(target)
    pairs = [
        (targets[joint], sources[partners[joint]] if partners[joint] >= 0 else "")
        for joint in shown_joints(target).tolist()
    ]
    return JointMap(tuple(pairs))


def mapped_partners(
    joint_map: JointMap, source: Skeleton, target: Skeleton, titles: tuple[str, str]
) -> Ints:
    """Return each target joint's source (J,): -1 stays at rest, -2 is not listed; else RigError."""
    partners = np.full(target.n_joints, UNMAPPED, dtype=np.int32)
    joints = _joints_by_label(source), _joints_by_label(target)
    for row, (mine, theirs) in enumerate(joint_map.pairs):
        line = joint_map.lines[row] if joint_map.lines else None
        at = joint_map.path, line
        joint = _find(joints[1], target, mine, titles[1], at)
        if partners[joint] != UNMAPPED:
            values = {"joint": quoted(mine), "figure": titles[1]}
            raise RigError(
                Diagnostic(
                    "F004.mapping-again: expected each joint of {figure} at most once, found "
                    "{joint} "
                    "again",
                    *at,
                    values=values,
                )
            )
        partners[joint] = _find(joints[0], source, theirs, titles[0], at) if theirs else -1
    return partners


def _joints_by_label(skeleton: Skeleton) -> dict[str, int]:
    labels = joint_labels(skeleton)
    return {labels[joint]: joint for joint in shown_joints(skeleton).tolist()}


def _find(
    joints: dict[str, int],
    skeleton: Skeleton,
    name: str,
    title: str,
    at: tuple[Path | None, int | None],
) -> int:
    """Return the joint with a label; ``at`` is the file and line for messages."""
    if name in joints:
        return joints[name]
    same = [label for label, joint in joints.items() if skeleton.names[joint] == name]
    values = {
        "joint": quoted(name),
        "figure": title,
        "n": len(same),
        "near": name_hint(name, same or joints),
    }
    key = (
        "F004.mapping-joints: expected one joint of {figure}, found {joint}, a name shared "
        "by {n}; {near}"
        if same
        else "F004.mapping-joint: expected a joint of {figure}, found {joint}; {near}"
    )
    raise RigError(Diagnostic(key, *at, values=values))
