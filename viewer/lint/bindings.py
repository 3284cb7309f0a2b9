"""Checks of bind matrices: invertibility, and agreement with the skeleton at rest."""

from __future__ import annotations

import numpy as np

from viewer.lint._finding import Finding
from viewer.lint._subject import Subject
from viewer.rig.arrays import Bools, Floats
from viewer.rig.figure import Figure
from viewer.rig.kinematics import world_matrices
from viewer.rig.pose import rest_pose
from viewer.rig.shape import rest_joints
from viewer.rig.skeleton import joint_labels

# Maximum determinant of a singular matrix, relative to the product of its column lengths.
_SINGULAR = 1e-12
_NEARLY = 1e6  # minimum condition number of an ill-conditioned matrix
_AFFINE = 1e-6  # maximum absolute error of the last row
# Fraction of the figure's size: smaller differences are rounding errors of old files.
_ELSEWHERE = 0.01


def are_singular(matrices: Floats) -> Bools:
    """Return which matrices are singular.

    ``matrices``: (J, 4, 4), affine; only their linear parts are used. Returns (J,), true if the
    determinant is 0 relative to the product of the column lengths.
    """
    linear = matrices[:, :3, :3]
    lengths = np.linalg.norm(linear, axis=1).prod(axis=1)
    return np.abs(np.linalg.det(linear)) <= _SINGULAR * lengths


def check(subject: Subject) -> list[Finding]:
    """Check the inverse bind matrices of a figure with a skin."""
    skin = subject.actor.figure.skin
    if skin is None or skin.n_joints == 0:
        return []
    known = subject.valid("bindings", skin.n_joints)
    linear = np.where(known[:, None, None], skin.inverse_bind[:, :3, :3], np.eye(3))
    determinants = np.linalg.det(linear)
    flat = are_singular(linear)
    conditions = np.zeros(len(linear))
    conditions[~flat] = np.linalg.cond(linear[~flat])
    reflected = (determinants < 0.0) & ~flat
    off = np.abs(skin.inverse_bind[:, 3] - [0.0, 0.0, 0.0, 1.0]).max(axis=1) * known
    findings = [
        *_about(subject, "B002.singular", flat, determinants),
        *_about(subject, "B003.ill-conditioned", conditions > _NEARLY, conditions),
        *_about(subject, "B005.reflected", reflected, determinants),
        *_about(subject, "B006.not-affine", off > _AFFINE, off),
    ]
    usable = known & ~flat & (off <= _AFFINE)
    return findings + _elsewhere(subject, subject.actor.figure, usable)


def _about(subject: Subject, key: str, wrong: Bools, values: Floats) -> list[Finding]:
    """Report joints with invalid bind matrices, and the value of the first."""
    joints = np.flatnonzero(wrong)
    if len(joints) == 0:
        return []
    skeleton = subject.actor.figure.skeleton
    names = [f"#{joint}" for joint in joints]
    if skeleton is not None:
        labels = joint_labels(skeleton)
        names = [labels[joint] for joint in joints]
    first = int(joints[0])
    return [
        subject.found(
            key,
            n=len(joints),
            all=len(values),
            names=names,
            value=float(values[first]),
            joints=joints,
            at=("bindings", first),
        )
    ]


def _elsewhere(subject: Subject, figure: Figure, usable: Bools) -> list[Finding]:
    """Compare the joints' bind positions with those of the skeleton.

    Figures are bound with all DOFs at 0 or in their files' own pose; the closer one is used.
    """
    skin, skeleton = figure.skin, figure.skeleton
    if skin is None or figure.mesh is None or skeleton is None:
        return []
    # If the position of a joint is unknown, so are the positions of the joints below it.
    known = subject.valid("joints", skeleton.n_joints)
    for joint, parent in enumerate(skeleton.parents.tolist()):
        known[joint] &= parent < 0 or bool(known[parent])
    known &= usable
    matrices = np.where(usable[:, None, None], skin.inverse_bind, np.eye(4))
    bound = np.linalg.inv(matrices)[:, :3, 3]
    own = world_matrices(skeleton, rest_pose(skeleton))[:, :3, 3]
    both = [np.linalg.norm(bound - joints, axis=1) for joints in (rest_joints(figure), own)]
    distances = min((np.where(known, part, 0.0) for part in both), key=np.max)
    away = np.flatnonzero(distances > _ELSEWHERE * subject.size())
    if len(away) == 0:
        return []
    away = away[np.argsort(-distances[away], kind="stable")]
    first = int(away[0])
    return [
        subject.found(
            "B004.joints",
            n=len(away),
            joint=joint_labels(skeleton)[first],
            distance=subject.length(float(distances[first])),
            joints=away,
            at=("bindings", first),
        )
    ]
