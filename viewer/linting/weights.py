"""Checks of weights: sums and signs, vertices without weights, and the cost of pruning."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.diagnostics import Phrase
from viewer.linting._finding import Finding
from viewer.linting._subject import Subject
from viewer.phrases import counted, listed, optional
from viewer.rigs.arrays import Bools, largest_first
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.inspection.faults import are_singular, weight_faults
from viewer.rigs.motion.evaluation import frames_of, pose_of
from viewer.rigs.pose import Pose
from viewer.rigs.scene import Actor
from viewer.rigs.skeleton import FIRST_ROTATION, clamp_dofs, joint_labels
from viewer.rigs.skin import (
    Skin,
    idle_joints,
    influence_counts,
    merged,
    owners,
    stated_weights,
)
from viewer.rigs.skinning import Skinning, deform

# Poses in which the effect of fewer influences is measured
_COUNT = 4  # number of poses in addition to the rest pose and the current pose
_SWING = 0.6  # radians: roughly the largest rotation of most joints in a walk
_SEED = 5  # fixed, so that results are reproducible


def check(subject: Subject) -> Iterator[Finding]:
    """Check the weights of a figure with a skin."""
    figure = subject.actor.figure
    if figure.skin is None or figure.mesh is None:
        return
    # Weights missing from the file cannot be judged.
    known = subject.valid("weights", figure.skin.n_vertices)
    yield from subject.faults(weight_faults(figure, subject.invalid))
    yield from _idle_joints(subject, figure, figure.skin)
    yield from _doubled(subject, figure.skin, known)
    yield from _crowded(subject, figure, known)


def _idle_joints(subject: Subject, figure: Figure, skin: Skin) -> Iterator[Finding]:
    idle = idle_joints(stated_weights(skin), figure.skeleton)
    if len(idle) == 0 or subject.lacks("weights"):
        return  # the missing weights may refer to these joints
    labels = [_label(subject, int(joint)) for joint in idle]
    at = ("bindings", int(idle[0]))
    yield subject.found(
        "W006.joints: {n} no influence: {names}",
        n=counted(len(idle), "joint", "has", "have"),
        names=listed(labels),
        joints=idle,
        at=at,
    )


def _doubled(subject: Subject, skin: Skin, known: Bools) -> Iterator[Finding]:
    plain = merged(skin)
    fewer = np.flatnonzero((influence_counts(plain) != influence_counts(skin)) & known)
    if len(fewer) == 0:
        return
    yield subject.found(
        "W009.joints: {n} a joint more than once (first: vertex {vertex})",
        n=counted(len(fewer), "vertex", "lists", "list"),
        vertex=int(fewer[0]),
        vertices=fewer,
        at=("weights", int(fewer[0])),
    )


def _crowded(subject: Subject, figure: Figure, known: Bools) -> Iterator[Finding]:
    """Report more influences than engines support, with the error that pruning would cause."""
    skin = figure.skin
    assert skin is not None  # checked by the caller
    plain = merged(skin)
    used = np.bincount(owners(plain), plain.weights != 0.0, minlength=plain.n_vertices)
    used[~known] = 0.0
    can_pose = figure.is_attached and not subject.lacks("joints")
    for message, limit in (
        ("W007.influences: {n} more than 4 influences (maximum: {most}){cost}", 4),
        ("W008.influences: {n} more than 8 influences (maximum: {most}){cost}", 8),
    ):
        crowded = np.flatnonzero(used > limit)
        if len(crowded) == 0:
            continue
        cost: Phrase | str = ""
        if can_pose:
            cost, crowded = _cost(subject, skin, limit, crowded)
        yield subject.found(
            message,
            n=counted(len(crowded), "vertex", "has", "have"),
            most=int(used.max()),
            cost=optional("; {}", cost),
            vertices=crowded,
            at=("weights", int(crowded[0])),
        )


def _cost(
    subject: Subject, skin: Skin, limit: int, crowded: np.ndarray
) -> tuple[Phrase, np.ndarray]:
    """Return the error of pruning, and the vertices with the largest errors first."""
    figure = subject.actor.figure
    poses = _some_poses(subject.actor)
    whole, cut = Skinning(normalize=True), Skinning(max_influences=limit)
    errors = np.zeros(0 if figure.mesh is None else figure.mesh.n_vertices)
    for pose in poses:
        moved = deform(figure, pose, whole)[0] - deform(figure, pose, cut)[0]
        errors = np.maximum(errors, np.linalg.norm(moved, axis=1))
    is_known = (_posable(subject, skin) & np.isfinite(errors))[crowded]
    known, lost = crowded[is_known], crowded[~is_known]
    left_out = (
        Phrase(
            "{n} omitted because a required position or bind matrix is invalid",
            n=counted(len(lost), "vertex", "is", "are"),
        )
        if len(lost)
        else ""
    )
    if len(known) == 0:
        return Phrase(
            "the effect of pruning to {limit} is unknown: {left_out}",
            limit=limit,
            left_out=left_out,
        ), crowded
    known = largest_first(known, errors)
    cost = Phrase(
        "pruning to {limit} moves the mesh by up to {most} (vertex {vertex}), {mean} on "
        "average over these vertices, in {poses}{left_out}",
        limit=limit,
        most=subject.length(float(errors[known[0]])),
        vertex=int(known[0]),
        mean=subject.length(float(errors[known].mean())),
        poses=counted(len(poses), "pose"),
        left_out=optional("; {}", left_out),
    )
    return cost, np.concatenate([known, lost])


def _posable(subject: Subject, skin: Skin) -> Bools:
    """Return the vertices whose posed position is known, which are valid with all their joints."""
    lost = ~subject.valid("bindings", skin.n_joints) | are_singular(skin.inverse_bind)
    # A joint with weight 0 has no effect.
    holds = lost[skin.joints] & (skin.weights != 0.0)
    held = np.bincount(owners(skin), holds, minlength=skin.n_vertices)
    return subject.valid("positions", skin.n_vertices) & (held == 0)


def _label(subject: Subject, joint: int) -> str:
    skeleton = subject.actor.figure.skeleton
    return f"#{joint}" if skeleton is None else joint_labels(skeleton)[joint]


def _some_poses(actor: Actor) -> list[Pose]:
    """Return the rest pose, the current pose, and some poses of the clip, or else random ones."""
    figure, clip = actor.figure, actor.joint_motion
    assert figure.skeleton is not None  # checked by the callers
    rest = figure_pose(figure)
    poses = [rest, actor.pose]
    if clip is not None:
        times = np.linspace(clip.start, clip.end, _COUNT)
        frames = frames_of(figure, clip, times, actor.own_pose, interpolate=True)
        return poses + [
            pose_of(figure, frames, int(frame)) for frame in np.flatnonzero(frames.present)
        ]
    rng = np.random.default_rng(_SEED)
    is_rotation = figure.skeleton.dof_kinds >= FIRST_ROTATION
    for _ in range(_COUNT):
        pose = actor.pose.copy()
        pose.dofs[is_rotation] += rng.uniform(-_SWING, _SWING, int(is_rotation.sum()))
        pose.dofs[:] = clamp_dofs(figure.skeleton, pose.dofs)
        poses.append(pose)
    return poses
