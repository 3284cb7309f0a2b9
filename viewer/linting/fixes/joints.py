"""Fixes of joints: names on the wrong side, and rotated and shifted bindings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.diagnostics import Diagnostic, note
from viewer.linting._finding import Finding
from viewer.linting._mirror import name_partners
from viewer.linting._subject import Subject
from viewer.linting.bindings import bone_directions
from viewer.phrases import listed
from viewer.rigs.geometry.rotation import angles_of_pairs, nearest_rotations
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.pose import rest_pose
from viewer.rigs.skeleton import joint_labels
from viewer.rigs.skin import moves_vertices

_SAME = np.radians(1.0)  # rotations that are equal up to rounding
_LITTLE = 1e-6


def fix(subject: Subject, finding: Finding) -> Diagnostic | None:
    """Replace the names of joints, or their inverse bind matrices; None if neither is possible."""
    if finding.code == "Y004":
        return _renamed(subject, finding)
    return _rebound(subject, finding)


def _renamed(subject: Subject, finding: Finding) -> Diagnostic | None:
    """Exchange the names of joints with those of their counterparts."""
    figure = subject.actor.figure
    skeleton = figure.require_skeleton()
    partners, wrong = name_partners(skeleton), set(finding.joints.tolist())
    pairs = {(min(j, int(partners[j])), max(j, int(partners[j]))) for j in wrong}
    if not all(a >= 0 and {a, b} <= wrong for a, b in pairs):
        return None  # only one of the two is on the wrong side
    names = [*skeleton.names]
    for a, b in pairs:
        names[a], names[b] = names[b], names[a]
    subject.actor.figure = replace(figure, skeleton=replace(skeleton, names=tuple(names)))
    return note(
        "X007.names: {figure}: Y004 fixed: names exchanged with those of the other side: {names}",
        figure=subject.actor.name,
        names=listed([skeleton.names[a] for a, _ in sorted(pairs)]),
    )


def _rebound(subject: Subject, finding: Finding) -> Diagnostic | None:
    """Bind joints so that they move the mesh at rest as most others do."""
    figure = subject.actor.figure
    skeleton, skin = figure.require_skeleton(), figure.require_skin()
    worlds = world_matrices(skeleton, rest_pose(skeleton))
    others = np.setdiff1d(np.flatnonzero(moves_vertices(skin)), finding.joints)
    moves = worlds[others] @ skin.inverse_bind[others]
    turns, _ = nearest_rotations(moves[:, :3, :3])
    angles = angles_of_pairs(turns)
    usual = int((angles < _SAME).sum(axis=1).argmax())
    joints, binds = finding.joints, skin.inverse_bind.copy()
    if (angles[usual] < _SAME).sum() >= 0.5 * len(others):
        binds[joints] = np.linalg.inv(worlds[joints]) @ moves[usual]
        said = "X007.bindings: {figure}: B007 fixed: bound at rest: {names}"
    else:  # bound in another pose: bones still leave their joints in the direction at rest
        used = np.flatnonzero(moves_vertices(skin))
        above, rest, bound = bone_directions(skin, skeleton, used)
        for joint in joints.tolist():
            own = above == joint
            # The little identity chooses the smallest of the rotations about a single bone.
            turn, _ = nearest_rotations(rest[own].T @ bound[own] + _LITTLE * np.eye(3))
            binds[joint, :3] = turn @ binds[joint, :3]
        said = "X007.bones: {figure}: B007 fixed: bones bound in the direction at rest: {names}"
    if np.abs(binds - skin.inverse_bind).max() < _LITTLE:
        return None
    subject.actor.figure = replace(figure, skin=replace(skin, inverse_bind=binds))
    labels = joint_labels(skeleton)
    return note(
        said,
        figure=subject.actor.name,
        names=listed([labels[joint] for joint in joints]),
    )
