"""A pose carried to another figure whose joints have the same names.

Joints are matched by name and take over their partner's turn away from the rest pose, measured in
the figure's axes, so that DOF orders, rest rotations and joints in between may differ. With the
world rotations W of the pose and W0 of the skeleton with every DOF at 0,

    W_target = C W_source W0_source^T C^T W0_target

where C turns the source's up axis into the target's. The turns W_source W0_source^T are all that
has to be known of the source: they go with a pose into files and onto the clipboard. Figures with
the source's skeleton take its DOFs instead, and what it has beneath them.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from viewer.diagnostics import Diagnostic
from viewer.errors import RigError, printable
from viewer.rig.arrays import Floats, Ints
from viewer.rig.figure import Figure
from viewer.rig.geometry.rotation import matrix_to_quaternion, quaternion_to_matrix
from viewer.rig.pose import Pose, joint_rotations, rest_pose
from viewer.rig.posing.joint_rotation import nearest_dofs
from viewer.rig.skeleton import Skeleton

__all__ = [
    "JointTurns",
    "dof_layout",
    "joint_turns",
    "joints_by_name",
    "restore_beneath",
    "shares_layout",
    "turn_joints",
]

_INEXACT = 1e-4  # radians: a turn that is missed by less is met
_REST_DIGITS = 5  # of rest rotations that count as the same


@dataclass(frozen=True, slots=True, eq=False)
class JointTurns:
    """How the joints of a posed figure are turned, whatever its DOFs are.

    Attributes
    ----------
    figure : str
        What the figure is called.
    names : tuple of J str
        Of its joints.
    turns : (J, 4)
        Away from the rest pose, in the figure's axes: quaternions (x, y, z, w).
    shifts : (J, 3)
        Translations beside the DOFs, within the parent joint, lengths.
    up : str
        The figure's up axis, ``"y"`` or ``"z"``.
    layout : str
        As ``dof_layout`` gives it: where it is the same, the DOFs' values count, not the turns.
    rotations : (J, 4) or None
        Beneath the DOFs, as a ``Pose`` has them; None: those of the rest pose.
    """

    figure: str
    names: tuple[str, ...]
    turns: Floats
    shifts: Floats
    up: str
    layout: str
    rotations: Floats | None = None


def joint_turns(figure: Figure, pose: Pose) -> JointTurns:
    """Return how a figure's joints are turned.

    Parameters
    ----------
    figure : Figure
        With a skeleton.
    pose : Pose
        Of that figure.
    """
    skeleton = figure.require_skeleton()
    turns = _turned(skeleton, pose) @ np.swapaxes(_turned(skeleton, _unturned(skeleton)), 1, 2)
    return JointTurns(
        figure.name,
        skeleton.names,
        matrix_to_quaternion(turns),
        pose.translations.copy(),
        figure.up,
        dof_layout(figure),
        None if np.array_equal(pose.rotations, skeleton.rest_rotations) else pose.rotations.copy(),
    )


def dof_layout(figure: Figure) -> str:
    """Return a word that two figures share if a pose's DOFs mean the same to both.

    Blend shapes do not count: how many a file has of them changes no joint's turn.

    Parameters
    ----------
    figure : Figure
        With a skeleton.
    """
    skeleton = figure.require_skeleton()
    rest = quaternion_to_matrix(skeleton.rest_rotations).round(_REST_DIGITS) + 0.0  # no -0
    parts = (
        repr((skeleton.names, figure.up)).encode("utf-8", "surrogatepass"),
        *(
            array.astype(np.int32).tobytes()
            for array in (skeleton.parents, skeleton.dof_joints, skeleton.dof_kinds)
        ),
        rest.tobytes(),
    )
    return hashlib.sha256(b"|".join(parts)).hexdigest()[:16]


def shares_layout(source: JointTurns, figure: Figure) -> bool:
    """Return whether a figure takes the DOFs of a pose, and not only the turns of its joints.

    Parameters
    ----------
    source : JointTurns
        Of the pose.
    figure : Figure
        With a skeleton.
    """
    skeleton = figure.require_skeleton()
    # Files are edited by hand: the word alone does not make their lists as long as the skeleton.
    return source.layout == dof_layout(figure) and source.names == skeleton.names


def restore_beneath(skeleton: Skeleton, pose: Pose, source: JointTurns, is_whole: bool) -> None:
    """Give a pose the source's rotations and shifts beneath its DOFs, in place.

    They are beside the rest pose where a motion turns a joint about more axes than its DOFs have.
    The turns are not looked at: what they say of the DOFs is out of date once these are edited.

    Parameters
    ----------
    skeleton : Skeleton
        Of a figure with the source's layout.
    pose : Pose
        Its DOFs are left alone.
    source : JointTurns
        What lies beneath the DOFs of its pose.
    is_whole : bool
        Whether the source's pose is taken with every DOF: joints of which it says nothing then go
        to rest, instead of staying as they are.
    """
    if source.rotations is not None:
        pose.rotations[:] = source.rotations
    elif is_whole:
        pose.rotations[:] = skeleton.rest_rotations
    if is_whole or source.shifts.any():
        pose.translations[:] = source.shifts


def joints_by_name(source: Sequence[str], target: Sequence[str]) -> Ints:
    """Return each target joint's partner: the source joint with its name.

    Parameters
    ----------
    source, target : sequence of str
        Names of joints; those that are empty, or that repeat in either, match nothing.

    Returns
    -------
    (J,) int32
        Joints of the source for the J joints of the target; -1 for none.
    """
    counts, others = Counter(source), Counter(target)
    place = {name: joint for joint, name in enumerate(source)}
    return np.array(
        [place[name] if name and counts[name] == others[name] == 1 else -1 for name in target],
        dtype=np.int32,
    )


def turn_joints(source: JointTurns, target: Figure, start: Pose) -> tuple[Pose, list[Diagnostic]]:
    """Return a figure's pose with the joints turned as another figure's are.

    Parameters
    ----------
    source : JointTurns
        Of the other figure's pose.
    target : Figure
        With a skeleton.
    start : Pose
        Of the target; left as it is. What has no partner stays as it is there, as do place,
        size and shape, and where joints are moved to.

    Returns
    -------
    pose : Pose
        Of the target, within its limits.
    notes : list of Diagnostic
        How many joints were taken over, which the target lacks, and which cannot turn that way.

    Raises
    ------
    RigError
        If no joint of one is called as one of the other.
    """
    other = target.skeleton
    if other is None:
        raise RigError(f"figure {target.name} has no skeleton to pose")
    partners = joints_by_name(source.names, other.names)
    found = np.flatnonzero(partners >= 0)
    if not len(found):
        whose = printable(source.figure) or "the pose"
        raise RigError(f"no joint of {whose} is called as one of {target.name}")
    turn = _up_turn(source.up, target.up)
    deltas = turn @ quaternion_to_matrix(source.turns[partners[found]]) @ turn.T
    rest = _turned(other, _unturned(other))
    wanted = dict(zip(found.tolist(), deltas @ rest[found], strict=True))
    moved, missed = _turn_joints(other, start, wanted)
    return moved, _notes(source, target, partners, missed)


def _turn_joints(
    skeleton: Skeleton, start: Pose, wanted: dict[int, Floats]
) -> tuple[Pose, list[int]]:
    """Turn joints to world rotations; return the pose, and the joints that cannot get there."""
    pose, missed = start.copy(), []
    world = np.empty((skeleton.n_joints, 3, 3))
    present = joint_rotations(skeleton, start)
    for joint, parent in enumerate(skeleton.parents.tolist()):
        # Above is what was wanted, not what a limit left: local rotations are carried over.
        above = world[parent] if parent >= 0 else np.eye(3)
        world[joint] = wanted.get(joint, above @ present[joint])
        if joint in wanted:
            pose.rotations[joint] = skeleton.rest_rotations[joint]
            turned = nearest_dofs(skeleton, pose, joint, above.T @ world[joint])
            pose.dofs[:] = turned.dofs
            if turned.error > _INEXACT:
                missed.append(joint)
    return pose, missed


def _notes(
    source: JointTurns, target: Figure, partners: Ints, missed: list[int]
) -> list[Diagnostic]:
    """Return what became of the joints."""
    skeleton = target.skeleton
    assert skeleton is not None  # the caller looked
    used = set(partners[partners >= 0].tolist())
    whose = printable(source.figure) or "the pose"
    values: dict[str, object] = {"n": len(used), "all": len(source.names), "figure": whose}
    notes = [Diagnostic("F007.joints-taken-over", values=values)]
    lacking = [name or f"#{joint}" for joint, name in enumerate(source.names) if joint not in used]
    if lacking:
        values = {"figure": target.name, "names": [printable(name, 40) for name in lacking]}
        notes.append(Diagnostic("F007.joints-lacking", values=values))
    if missed:
        values = {"names": [printable(skeleton.names[joint], 40) for joint in missed]}
        notes.append(Diagnostic("F007.joints-limited", values=values))
    return notes


def _unturned(skeleton: Skeleton) -> Pose:
    pose = rest_pose(skeleton)
    pose.dofs[:] = 0.0
    return pose


def _turned(skeleton: Skeleton, pose: Pose) -> Floats:
    """Return every joint's rotation in the figure's axes: (J, 3, 3)."""
    world = joint_rotations(skeleton, pose)
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            world[joint] = world[parent] @ world[joint]
    return world


def _up_turn(source: str, target: str) -> Floats:
    """Return the matrix from one figure's axes to the other's: y up to z up is (x, -z, y)."""
    to_z = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    if source == target:
        return np.eye(3)
    return to_z if target == "z" else to_z.T
