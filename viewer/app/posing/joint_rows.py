"""Rows of the Joints panel: joints, their DOFs, and other values."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from viewer.phrases import printable
from viewer.rig.hierarchy import depth_first
from viewer.rig.memo import Memo
from viewer.rig.skeleton import Skeleton, joint_labels, shown_joints, shown_parents

__all__ = ["OWN_NUMBERS", "SCALE", "TRANSLATION", "Rows", "joint_rows", "row_labels"]

Rows: TypeAlias = tuple[tuple[int, int, int], ...]

OWN_NUMBERS = -2
"""Value used instead of a DOF for the row with the raw pose values of the body model."""

TRANSLATION, SCALE = -3, -4
"""Values used instead of a DOF for the rows with the translation and the scale of a joint."""

_LONGEST = 60  # maximum length of a name in characters
_known_labels: Memo[Skeleton, tuple[str, ...]] = Memo()
_known_rows: Memo[Skeleton, Rows] = Memo(kept=4)


def row_labels(skeleton: Skeleton) -> tuple[str, ...]:
    """Return the displayed labels of all joints."""

    def make() -> tuple[str, ...]:
        return tuple(printable(label, _LONGEST) for label in joint_labels(skeleton))

    return _known_labels.get(skeleton, None, make)


def joint_rows(
    skeleton: Skeleton,
    opened: frozenset[int],
    wanted: str,
    has_own: bool = False,
    moved: frozenset[int] = frozenset(),
) -> Rows:
    """Return the listed rows as (joint, DOF or -1 for the joint's own row, depth).

    Parameters
    ----------
    skeleton : Skeleton
        Joints and DOFs.
    opened : frozenset of int
        Joints whose DOFs and children are listed.
    wanted : str
        If not empty, only joints whose name contains it are listed, without hierarchy.
    has_own : bool
        Whether a row with the file's own numbers, ``OWN_NUMBERS``, follows each joint's DOFs.
    moved : frozenset of int
        Joints with rows for ``TRANSLATION`` and ``SCALE`` after their DOFs.
    """
    key = (opened, wanted, has_own, moved)
    return _known_rows.get(skeleton, key, lambda: _rows(skeleton, *key))


def _rows(
    skeleton: Skeleton, opened: frozenset[int], wanted: str, has_own: bool, moved: frozenset[int]
) -> Rows:
    dofs: list[list[int]] = [[] for _ in range(skeleton.n_joints)]
    for dof, joint in enumerate(skeleton.dof_joints.tolist()):
        dofs[joint].append(dof)
    for joint in range(skeleton.n_joints):
        dofs[joint] += [TRANSLATION, SCALE] if joint in moved else []
        dofs[joint] += [OWN_NUMBERS] if has_own else []
    listed: list[tuple[int, int, int]] = []
    depths, visible = [0] * skeleton.n_joints, [True] * skeleton.n_joints
    labels, parents = row_labels(skeleton), shown_parents(skeleton).tolist()
    for joint in shown_joints(skeleton).tolist():
        parent = parents[joint]
        if wanted:
            visible[joint] = wanted.lower() in labels[joint].lower()
        elif parent >= 0:
            depths[joint] = depths[parent] + 1
            visible[joint] = visible[parent] and parent in opened
        if visible[joint]:
            listed.append((joint, -1, depths[joint]))
            if wanted or joint in opened:
                listed += [(joint, dof, depths[joint] + 1) for dof in dofs[joint]]
    # In a skeleton, parents come before their children, but not always immediately before.
    place = np.argsort(depth_first(skeleton.parents)).tolist()
    return tuple(sorted(listed, key=lambda row: place[row[0]]))
