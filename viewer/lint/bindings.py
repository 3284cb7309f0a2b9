"""Bind matrices: whether they can be inverted, and whether they fit the skeleton at rest."""

from __future__ import annotations

import numpy as np

from viewer.errors import counted
from viewer.lint._finding import Finding, Subject
from viewer.phrases import listed
from viewer.rig.arrays import Bools, Floats
from viewer.rig.figure import Figure
from viewer.rig.kinematics import world_matrices
from viewer.rig.pose import rest_pose
from viewer.rig.shape import rest_joints
from viewer.rig.skeleton import joint_labels

__all__ = ["are_singular", "check"]

_SINGULAR = 1e-12  # determinant relative to the product of the column lengths
_NEARLY = 1e6  # condition number
_AFFINE = 1e-6  # of the last row
_ELSEWHERE = 0.01  # of the figure's size: nearer than that is rounding of old files


def are_singular(matrices: Floats) -> Bools:
    """Return which matrices flatten space, so that nothing can be undone that they do.

    Parameters
    ----------
    matrices : (J, 4, 4)
        Affine; only their linear parts count.

    Returns
    -------
    (J,)
        True where the determinant is 0 beside the product of the column lengths.
    """
    linear = matrices[:, :3, :3]
    lengths = np.linalg.norm(linear, axis=1).prod(axis=1)
    return np.abs(np.linalg.det(linear)) <= _SINGULAR * lengths


def check(subject: Subject) -> list[Finding]:
    """Look at the inverse bind matrices of a figure with a skin."""
    skin = subject.actor.figure.skin
    if skin is None or skin.n_joints == 0:
        return []
    known = subject.sound("bindings", skin.n_joints)
    linear = np.where(known[:, None, None], skin.inverse_bind[:, :3, :3], np.eye(3))
    determinants = np.linalg.det(linear)
    flat = are_singular(linear)
    findings = _about(
        subject, "B002", flat, determinants, ("cannot be inverted",) * 2, "determinant"
    )
    conditions = np.zeros(len(linear))
    conditions[~flat] = np.linalg.cond(linear[~flat])
    findings += _about(
        subject, "B003", conditions > _NEARLY, conditions, ("can hardly be inverted",) * 2,
        "condition number",
    )  # fmt: skip
    mirrors = (determinants < 0.0) & ~flat
    findings += _about(subject, "B005", mirrors, determinants, ("mirrors", "mirror"), "determinant")
    off = np.abs(skin.inverse_bind[:, 3] - [0.0, 0.0, 0.0, 1.0]).max(axis=1) * known
    findings += _about(
        subject, "B006", off > _AFFINE, off, ("is not affine", "are not affine"), "error"
    )
    usable = known & ~flat & (off <= _AFFINE)
    return findings + _elsewhere(subject, subject.actor.figure, usable)


def _about(
    subject: Subject,
    code: str,
    wrong: np.ndarray,
    values: Floats,
    what: tuple[str, str],
    measure: str,
) -> list[Finding]:
    joints = np.flatnonzero(wrong)
    if len(joints) == 0:
        return []
    skeleton = subject.actor.figure.skeleton
    names = [f"#{joint}" for joint in joints]
    if skeleton is not None:
        labels = joint_labels(skeleton)
        names = [labels[joint] for joint in joints]
    return [
        subject.found(
            f"{code}.plain",
            message=f"{counted(len(joints), 'bind matrix', *what, of=len(values))}: {listed(names)} "
            f"({measure} {values[joints[0]]:.3g})",
            joints=joints,
            at=("bindings", int(joints[0])),
        )
    ]


def _elsewhere(subject: Subject, figure: Figure, usable: Bools) -> list[Finding]:
    """Compare where joints were bound with where the skeleton has them.

    Figures are bound with all DOFs at 0 or in their files' own pose; the nearer one counts.
    """
    skin, skeleton = figure.skin, figure.skeleton
    if skin is None or figure.mesh is None or skeleton is None:
        return []
    # Where one joint is not known, nobody knows where those below it are.
    known = subject.sound("joints", skeleton.n_joints)
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
    label = joint_labels(skeleton)[away[0]]
    rest = "it rests" if len(away) == 1 else "they rest"
    return [
        subject.found(
            "B004.plain",
            message=f"{counted(len(away), 'joint', 'was', 'were')} bound away from where {rest}, {label} "
            f"by {subject.length(distances[away[0]])}: at rest the mesh is not as it was bound",
            joints=away,
            at=("bindings", int(away[0])),
        )
    ]
