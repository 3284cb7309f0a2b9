"""Skeletons: names, roots, rest transforms, locked DOFs, and poses that leave the limits."""

from __future__ import annotations

import re
from collections import Counter

import numpy as np

from viewer.errors import counted, printable
from viewer.lint._finding import Finding, Subject
from viewer.phrases import listed
from viewer.rig.number_text import number_text
from viewer.rig.pose import Pose
from viewer.rig.posing.dof_text import beyond_text
from viewer.rig.skeleton import Skeleton, dof_label, joint_labels

__all__ = ["check"]

OUTSIDE = "pose outside limits"
"""Heading of the fact by which a reader says that it clamped the file's own pose."""

_UNIT = 1e-3  # of a quaternion's length: files of three digits
_ROUNDING = 1e-9  # radians or lengths beyond a limit


def check(subject: Subject) -> list[Finding]:
    """Look at the skeleton and the present pose of an actor."""
    skeleton, pose = subject.actor.figure.skeleton, subject.actor.pose
    if skeleton is None:
        return []
    return [
        *_names(subject, skeleton),
        *_rest(subject, skeleton),
        *_limits(subject, skeleton, pose),
    ]


def _names(subject: Subject, skeleton: Skeleton) -> list[Finding]:
    findings = []
    counts = Counter(skeleton.names)
    repeated = [j for j, name in enumerate(skeleton.names) if name and counts[name] > 1]
    if repeated:
        names = list(dict.fromkeys(skeleton.names[joint] for joint in repeated))
        shown = listed([f'"{printable(name, 40)}" ({counts[name]})' for name in names])
        findings.append(
            subject.found(
                "S006.plain",
                message=f"{counted(len(repeated), 'joint')} share their names with others: {shown}",
                part="skeleton",
                joints=repeated,
                at=("joints", repeated[0]),
            )
        )
    nameless = [joint for joint, name in enumerate(skeleton.names) if not name.strip()]
    if nameless:
        findings.append(
            subject.found(
                "S007.plain",
                message=f"{counted(len(nameless), 'joint', 'has', 'have')} no name, first joint "
                f"{nameless[0]}",
                part="skeleton",
                joints=nameless,
                at=("joints", nameless[0]),
            )
        )
    roots = np.flatnonzero(skeleton.parents < 0)
    if len(roots) > 1:
        labels = joint_labels(skeleton)
        findings.append(
            subject.found(
                "S008.plain",
                message=f"{len(roots)} joints have no parent: {listed([labels[j] for j in roots])}",
                part="skeleton",
                joints=roots,
                at=("joints", int(roots[1])),
            )
        )
    return findings


def _rest(subject: Subject, skeleton: Skeleton) -> list[Finding]:
    labels = joint_labels(skeleton)
    findings = []
    known = subject.sound("joints", skeleton.n_joints)
    lengths = np.linalg.norm(skeleton.rest_rotations, axis=1)
    odd = np.flatnonzero((np.abs(lengths - 1.0) > _UNIT) & known)
    if len(odd):
        findings.append(
            subject.found(
                "S009.plain",
                message=f"{counted(len(odd), 'rest rotation', 'is', 'are')} not of length 1, "
                f"{labels[odd[0]]} has {lengths[odd[0]]:.4g}",
                part="skeleton",
                joints=odd,
                at=("joints", int(odd[0])),
            )
        )
    flat = np.flatnonzero((skeleton.rest_scales <= 0.0).any(axis=1) & known)
    if len(flat):
        scale = " ".join(map(number_text, skeleton.rest_scales[flat[0]].tolist()))
        findings.append(
            subject.found(
                "S010.plain",
                message=f"{counted(len(flat), 'rest scale', 'is', 'are')} 0 or less, {labels[flat[0]]} has "
                f"{scale}",
                part="skeleton",
                joints=flat,
                at=("joints", int(flat[0])),
            )
        )
    return findings


def _named(skeleton: Skeleton, text: str) -> list[int]:
    """Return the joint of the DOF that a reader's words name, if it can be told."""
    labels = joint_labels(skeleton)
    found = re.match(r"\d+ DOFs?, (.+)\.\w+ is ", text)
    return [labels.index(found[1])] if found is not None and found[1] in labels else []


def _limits(subject: Subject, skeleton: Skeleton, pose: Pose | None) -> list[Finding]:
    findings = []
    for heading, text in subject.actor.figure.facts:
        if heading == OUTSIDE:
            joints = _named(skeleton, text)
            at = ("joints", joints[0]) if joints else None
            findings.append(
                subject.found("S004.plain", message=text, part="skeleton", joints=joints, at=at)
            )
    low, high = skeleton.dof_limits.T
    if pose is not None:
        beyond = np.maximum(low - pose.dofs, pose.dofs - high)
        outside = np.flatnonzero(beyond > _ROUNDING)
        if len(outside):
            outside = outside[np.argsort(-beyond[outside], kind="stable")]
            worst = outside[0]
            which = counted(len(outside), "DOF")
            are = "is outside its" if len(outside) == 1 else "are outside their"
            findings.append(
                subject.found(
                    "S004.plain",
                    message=f"{which} of the pose {are} limits: "
                    f"{beyond_text(skeleton, int(worst), float(pose.dofs[worst]))}",
                    part="skeleton",
                    joints=np.unique(skeleton.dof_joints[outside]),
                    at=("joints", int(skeleton.dof_joints[worst])),
                )
            )
    locked = np.flatnonzero(skeleton.locked)
    if len(locked):
        labels = [dof_label(skeleton, dof) for dof in locked[:6]]
        more = f" and {len(locked) - 6} more" * (len(locked) > 6)
        findings.append(
            subject.found(
                "S005.plain",
                message=f"{counted(len(locked), 'DOF', 'is', 'are', of=skeleton.n_dofs)} locked: "
                f"{', '.join(labels)}{more}",
                part="skeleton",
                joints=np.unique(skeleton.dof_joints[locked]),
                at=("joints", int(skeleton.dof_joints[locked[0]])),
            )
        )
    return findings
