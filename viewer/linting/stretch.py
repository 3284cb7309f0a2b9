"""Checks of motions for bones that change their length, and joints that change their size."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.linting._finding import Finding
from viewer.linting._subject import Indices, Subject, Track, track_of, travelling_joints
from viewer.phrases import counted, listed, rounded
from viewer.rigs.arrays import Bools, Floats, largest_first
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.vectors import lengths_of
from viewer.rigs.retargeting.joint_names import joint_meanings
from viewer.rigs.skeleton import Skeleton, joint_labels
from viewer.rigs.skin import moves_vertices

_STRETCHED = 0.15  # minimum relative change of a bone: more than that of shoulders and soft tissue
_SCALED = 0.1  # minimum relative change of a joint's scale
_SHORT = 0.02  # relative size of bones that are too short for their length to matter
_MANY = 0.25  # fraction of the bones above which a clip has the proportions of another figure


def check(subject: Subject) -> Iterator[Finding]:
    """Check the bones of limbs and chains, and the scales of all joints."""
    track, skeleton = track_of(subject), subject.actor.figure.skeleton
    if track is None or skeleton is None or not track.present.any():
        return
    rest = np.linalg.norm(skeleton.rest_translations, axis=1)
    bones = _chain_bones(subject.actor.figure, skeleton)
    bones &= rest * track.scale > _SHORT * track.size
    bones[travelling_joints(track, skeleton)] = False
    moved = np.flatnonzero(bones & track.translations.any(axis=(0, 2)))
    own = track.translations[:, moved] + skeleton.rest_translations[moved]
    lengths = lengths_of(own) / rest[moved]
    yield from _changed(
        subject,
        track,
        lengths,
        moved,
        _STRETCHED,
        int(bones.sum()),
        "bone",
        "C022.bones: {n} length: {names} (most: {joint}, to {ratio} times that at rest at frame "
        "{frame})",
    )
    factors = track.scales / np.where(skeleton.rest_scales > 0.0, skeleton.rest_scales, 1.0)
    if len(track.times) > 1 and (factors != 1.0).any():
        joints = np.arange(skeleton.n_joints)
        factors = np.broadcast_to(factors, (len(track.times), *factors.shape[1:]))
        # The axis that changes most stands for the joint.
        axes = np.abs(np.log(np.maximum(factors, 1e-12))).argmax(axis=2)
        scales = np.take_along_axis(factors, axes[..., None], axis=2)[..., 0]
        yield from _changed(
            subject,
            track,
            scales,
            joints,
            _SCALED,
            skeleton.n_joints,
            "joint",
            "C023.scales: {n} size: {names} (most: {joint}, to {ratio} times that at rest at frame "
            "{frame})",
        )


def _chain_bones(figure: Figure, skeleton: Skeleton) -> Bools:
    """Return which joints end a bone of a limb or chain: (J,).

    Its length is the distance to a parent that has a parent and no second branch: a shoulder on
    the chest and a foot below the root (as IK controls are) have no bone of their own. The bones of
    a hand without a wrist branch off at the elbow, and neck and head at a chest with shoulders.
    """
    parents = skeleton.parents
    n_below = np.zeros(len(parents), dtype=np.int64)
    np.add.at(n_below, parents[parents >= 0], 1)
    branches = np.zeros(len(parents), dtype=np.int64)
    np.add.at(branches, parents[(parents >= 0) & (n_below > 0)], 1)
    above = np.where(parents >= 0, parents, 0)
    meanings = joint_meanings(skeleton)
    bends = np.array([each.endswith(("_elbow", "_knee")) for each in meanings])
    is_head = np.isin(meanings, ("neck", "head"))
    own = (branches[above] <= 1) | bends[above] | is_head
    bones: Bools = (parents >= 0) & (parents[above] >= 0) & own
    bones &= (n_below > 0) | (n_below[above] == 1) | is_head
    if figure.skin is not None and figure.is_attached:
        moves = moves_vertices(figure.skin)
        bones &= moves & moves[above]
    elif figure.mesh is None:
        bones &= _of_body(skeleton)
    return bones


def _of_body(skeleton: Skeleton) -> Bools:
    """Return which joints have a known name, or one below them has: (J,); all, if none is known."""
    # Without a skin, controls of inverse kinematics and slots for props look like bones.
    known = np.array([bool(meaning) for meaning in joint_meanings(skeleton)])
    if not known.any():
        return ~known
    for joint in range(skeleton.n_joints - 1, 0, -1):
        if known[joint] and skeleton.parents[joint] >= 0:
            known[skeleton.parents[joint]] = True
    return known


def _changed(
    subject: Subject,
    track: Track,
    ratios: Floats,
    joints: Indices,
    least: float,
    total: int,
    noun: str,
    message: str,
) -> Iterator[Finding]:
    """Report joints (N,) whose size relative to rest (F, N) is not 1 in some frame."""
    logs = np.abs(np.log(np.maximum(ratios, 1e-12)))
    logs[~track.present] = 0.0
    most = logs.max(axis=0, initial=0.0)
    columns = np.flatnonzero(most > np.log1p(least))
    if len(columns) == 0:
        return
    columns = largest_first(columns, most)
    highest = logs[:, columns].max(axis=1)
    rows = np.flatnonzero(highest > np.log1p(least))
    rows = largest_first(rows, highest)
    each = track.of_each(rows)
    labels = joint_labels(subject.actor.figure.require_skeleton())
    yield subject.found(
        message,
        n=counted(len(columns), noun, "changes its", "change their"),
        names=listed([labels[joint] for joint in joints[columns]]),
        joint=labels[int(joints[columns[0]])],
        ratio=rounded(float(ratios[rows[0], columns[0]]), 2),
        frame=int(track.numbers[rows[0]]),
        severity="note" if len(columns) > max(1.0, _MANY * total) else "warning",
        part="clip",
        joints=joints[columns],
        frames=track.numbers[each],
        times=track.times[each],
        at=("frames", int(rows[0])),
    )
