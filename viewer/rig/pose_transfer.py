"""A pose carried to another figure whose joints have the same names.

Joints are matched by name and take over their partner's turn away from the rest pose, measured in
the figure's axes, so that DOF orders, rest rotations and joints in between may differ. With the
world rotations W of the pose and W0 of the skeleton with every DOF at 0,

    W_target = C W_source W0_source^T C^T W0_target

where C turns the source's up axis into the target's.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from viewer.errors import RigError, printable
from viewer.rig.arrays import Floats, Ints
from viewer.rig.figure import Figure
from viewer.rig.joint_turning import nearest_dofs
from viewer.rig.pose import Pose, joint_rotations, rest_pose
from viewer.rig.skeleton import Skeleton

__all__ = ["joints_by_name", "shares_dofs", "transfer_pose"]

_LISTED = 12  # names in a note
_INEXACT = 1e-4  # radians: a turn that is missed by less is met
_SAME_REST = 1e-6


def shares_dofs(source: Figure, target: Figure) -> bool:
    """Return whether a pose's numbers mean the same to both figures.

    Parameters
    ----------
    source, target : Figure
        With skeletons or without.
    """
    one, other = source.skeleton, target.skeleton
    if one is None or other is None:
        return False
    if one is other:
        return source.n_shapes == target.n_shapes
    return (
        one.names == other.names
        and np.array_equal(one.parents, other.parents)
        and np.array_equal(one.dof_joints, other.dof_joints)
        and np.array_equal(one.dof_kinds, other.dof_kinds)
        and np.allclose(one.rest_rotations, other.rest_rotations, rtol=0.0, atol=_SAME_REST)
        and (source.n_shapes, source.up) == (target.n_shapes, target.up)
    )


def joints_by_name(source: Skeleton, target: Skeleton) -> Ints:
    """Return each target joint's partner: the source joint with its name.

    Parameters
    ----------
    source, target : Skeleton
        Names that are empty, or that repeat in either, match nothing.

    Returns
    -------
    (J,) int32
        Joints of the source for the J joints of the target; -1 for none.
    """
    counts, others = Counter(source.names), Counter(target.names)
    place = {name: joint for joint, name in enumerate(source.names)}
    return np.array(
        [
            place[name] if name and counts[name] == others[name] == 1 else -1
            for name in target.names
        ],
        dtype=np.int32,
    )


def transfer_pose(
    source: Figure, pose: Pose, target: Figure, start: Pose
) -> tuple[Pose, list[str]]:
    """Return a figure's pose with the joints turned as another figure's are.

    Parameters
    ----------
    source : Figure
        With a skeleton.
    pose : Pose
        Of the source; left as it is.
    target : Figure
        With a skeleton.
    start : Pose
        Of the target; left as it is. What has no partner stays as it is there, as do place,
        size and shape.

    Returns
    -------
    pose : Pose
        Of the target, within its limits.
    notes : list of str
        The joints that the target lacks, and those that cannot turn that way, one line each.

    Raises
    ------
    RigError
        If no joint of one is called as one of the other.
    """
    one, other = source.skeleton, target.skeleton
    if one is None or other is None:
        raise RigError(f"figure {(target if other is None else source).name} has no skeleton")
    partners = joints_by_name(one, other)
    found = np.flatnonzero(partners >= 0)
    if not len(found):
        raise RigError(f"no joint of {source.name} is called as one of {target.name}")
    turn = _up_turn(source.up, target.up)
    deltas = _turned(one, pose) @ np.swapaxes(_turned(one, _unturned(one)), 1, 2)
    deltas = turn @ deltas[partners[found]] @ turn.T
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


def _notes(source: Figure, target: Figure, partners: Ints, missed: list[int]) -> list[str]:
    one, other = source.skeleton, target.skeleton
    assert one is not None and other is not None  # the caller looked
    used = set(partners.tolist())
    lacking = [name or f"#{joint}" for joint, name in enumerate(one.names) if joint not in used]
    notes = []
    if lacking:
        notes.append(f"{target.name} has no joint called {_listed(lacking)}")
    if missed:
        names = _listed([other.names[joint] for joint in missed])
        notes.append(f"turned as far as their DOFs and limits allow: {names}")
    return notes


def _listed(names: list[str]) -> str:
    shown = ", ".join(printable(name, 40) for name in names[:_LISTED])
    more = len(names) - _LISTED
    return f"{shown} and {more} more" if more > 0 else shown


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
