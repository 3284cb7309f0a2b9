"""Checks of skeletons: names, roots, rest transforms, locked DOFs, and poses beyond limits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from viewer.diagnostics import Diagnostic, Phrase
from viewer.linting._finding import Finding
from viewer.linting._subject import Subject
from viewer.phrases import agree, counted, listed, quoted, rounded
from viewer.rigs.arrays import Bools, Floats, largest_first
from viewer.rigs.inspection.faults import UNIT_ROTATION
from viewer.rigs.pose import Pose
from viewer.rigs.posing.dof_text import beyond_text
from viewer.rigs.skeleton import FIRST_ROTATION, Skeleton, dof_labels, joint_labels, shown_joints

_ROUNDING = 1e-9  # tolerance beyond a limit, radians or lengths
# Few joints rotate by more than two turns, and limits of more than two turns in degrees mean none.
# Two turns in a file may be rounded up, as in 12.57.
_TURNS = 12.6, 720.0
_ENDLESS = 100.0
_WHOLE = 0.005  # rounding of a whole number of turns


def check(subject: Subject) -> Iterator[Finding]:
    """Check the skeleton and the current pose of an actor."""
    skeleton, pose = subject.actor.figure.skeleton, subject.actor.own_pose
    if skeleton is None:
        return
    yield from _names(subject, skeleton)
    yield from _rest(subject, skeleton)
    yield from _limits(subject, skeleton, pose)


def _names(subject: Subject, skeleton: Skeleton) -> Iterator[Finding]:
    counts = Counter(skeleton.names)
    repeated = [j for j, name in enumerate(skeleton.names) if name and counts[name] > 1]
    if repeated:
        names = list(dict.fromkeys(skeleton.names[joint] for joint in repeated))
        shown = [Phrase("{name} ({n})", name=quoted(name), n=counts[name]) for name in names]
        yield subject.found(
            "S006.joints: {n} with duplicate names: {names}",
            n=counted(len(repeated), "joint"),
            names=listed(shown),
            part="skeleton",
            joints=repeated,
            at=("joints", repeated[0]),
        )
    nameless = [
        joint for joint in shown_joints(skeleton).tolist() if not skeleton.names[joint].strip()
    ]
    if nameless:
        yield subject.found(
            "S007.joints: {n} no name (first: joint {joint})",
            n=counted(len(nameless), "joint", "has", "have"),
            joint=nameless[0],
            # A format that needs no names leaves all of them out; single ones were forgotten.
            severity="note" if len(nameless) == skeleton.n_joints else "warning",
            part="skeleton",
            joints=nameless,
            at=("joints", nameless[0]),
        )
    roots = np.flatnonzero(skeleton.parents < 0)
    if len(roots) > 1:
        labels = joint_labels(skeleton)
        yield subject.found(
            "S008.roots: {n} joints have no parent: {names}",
            n=len(roots),
            names=listed([labels[joint] for joint in roots]),
            part="skeleton",
            joints=roots,
            at=("joints", int(roots[1])),
        )


def _rest(subject: Subject, skeleton: Skeleton) -> Iterator[Finding]:
    labels = joint_labels(skeleton)
    known = subject.valid("joints", skeleton.n_joints)
    lengths = np.linalg.norm(skeleton.rest_rotations, axis=1)
    odd = np.flatnonzero((np.abs(lengths - 1.0) > UNIT_ROTATION) & known)
    if len(odd):
        yield subject.found(
            "S009.rotations: {n} not normalised (first: length {length} at {joint})",
            n=counted(len(odd), "rest rotation", "is", "are"),
            joint=labels[odd[0]],
            length=rounded(float(lengths[odd[0]]), 4),
            part="skeleton",
            joints=odd,
            at=("joints", int(odd[0])),
        )
    flat = np.flatnonzero((skeleton.rest_scales <= 0.0).any(axis=1) & known)
    if len(flat):
        x, y, z = skeleton.rest_scales[flat[0]].tolist()
        yield subject.found(
            "S010.scales: {n} not positive (first: {x:zg} {y:zg} {z:zg} at {joint})",
            n=counted(len(flat), "rest scale", "is", "are"),
            joint=labels[flat[0]],
            x=x,
            y=y,
            z=z,
            part="skeleton",
            joints=flat,
            at=("joints", int(flat[0])),
        )


def _are_endless(low: Floats, high: Floats) -> Bools:
    """Return which limits (D,) are 100 radians or whole turns in both directions, as of wheels."""
    turns = high / (2.0 * np.pi)
    is_whole = (np.abs(turns - np.round(turns)) < _WHOLE) | (high == _ENDLESS)
    result: Bools = (low == -high) & is_whole
    return result


def _spinning(subject: Subject) -> list[int]:
    """Return the DOFs that the motion rotates by more than two turns, as those of wheels."""
    clip = subject.actor.joint_motion
    if clip is None or clip.kind != "curves":
        return []
    turned = {one.target: np.ptp(one.values) for one in clip.channels if len(one.values)}
    return [target for target, angle in turned.items() if angle > _TURNS[0]]


def _limits(subject: Subject, skeleton: Skeleton, pose: Pose | None) -> Iterator[Finding]:
    facts = [fact for _, fact in subject.actor.figure.facts if isinstance(fact, Diagnostic)]
    for fact in facts:
        joints = [] if fact.places is None else fact.places.tolist()
        at = ("joints", joints[0]) if joints else None
        yield subject.found(
            f"{fact.key}: {fact.sentence}",
            part="skeleton",
            joints=joints,
            at=at,
            **{**fact.values, **fact.texts},
        )
    low, high = skeleton.dof_limits.T
    if pose is not None:
        beyond = np.maximum(low - pose.dofs, pose.dofs - high)
        outside = np.flatnonzero(beyond > _ROUNDING)
        if len(outside):
            outside = largest_first(outside, beyond)
            worst = int(outside[0])
            yield subject.found(
                "S004.pose: {n} of the pose {are} limits: {dof}",
                n=counted(len(outside), "DOF"),
                dof=beyond_text(skeleton, worst, float(pose.dofs[worst])),
                part="skeleton",
                joints=np.unique(skeleton.dof_joints[outside]),
                at=("joints", int(skeleton.dof_joints[worst])),
                are=agree(len(outside), "is outside its", "are outside their"),
            )
    rotates = skeleton.dof_kinds >= FIRST_ROTATION
    sizes = np.where(rotates[:, None], np.abs(skeleton.dof_limits), 0.0)
    wide = ((sizes > _TURNS[0]) & (sizes <= _TURNS[1])).any(axis=1)
    degrees = np.setdiff1d(np.flatnonzero(wide), _spinning(subject))
    finite = degrees[~_are_endless(low[degrees], high[degrees])]
    if len(finite):
        # If one limit is in degrees, the others are, too; but the one named is no wheel's.
        first = int(finite[0])
        yield subject.found(
            "S014.limits: {n} limits of more than two turns, which look like degrees (first: "
            "{dof}, {low} to {high})",
            n=counted(len(degrees), "rotation", "has", "have"),
            dof=dof_labels(skeleton)[first],
            low=rounded(float(low[first])),
            high=rounded(float(high[first])),
            part="skeleton",
            joints=np.unique(skeleton.dof_joints[degrees]),
            at=("joints", int(skeleton.dof_joints[first])),
        )
    locked = np.flatnonzero(skeleton.locked)
    if len(locked):
        labels = dof_labels(skeleton)
        yield subject.found(
            "S005.dofs: {n} locked: {names}",
            n=counted(len(locked), "DOF", "is", "are", of=skeleton.n_dofs),
            all=skeleton.n_dofs,
            names=listed([labels[dof] for dof in locked]),
            part="skeleton",
            joints=np.unique(skeleton.dof_joints[locked]),
            at=("joints", int(skeleton.dof_joints[locked[0]])),
        )
