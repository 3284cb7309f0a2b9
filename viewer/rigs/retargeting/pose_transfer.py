"""Transfer of a pose to another figure whose joints have the same names.

Joints are matched by name and get the matching joint's rotation relative to the rest pose, in the
figure's axes, so DOF orders, rest rotations and intermediate joints may differ. With the
world rotations W of the pose and W0 of the skeleton with all DOFs at 0,

    W_target = C W_source W0_source^T C^T W0_target

where C rotates the source's up axis to the target's, and also its left if the file of either states
human bones: their joints match by these bones, and the figures may face different directions. Of
the source, only the rotations W_source W0_source^T are needed: they accompany a pose in files and
on the clipboard. Figures with the source's skeleton get its DOFs, base rotations and translations
instead.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import field

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase, note, wording
from viewer.errors import RigError
from viewer.phrases import listed, printable
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import (
    matrix_to_quaternion,
    quaternion_to_matrix,
    rotation_vector_to_matrix,
    up_rotation,
)
from viewer.rigs.geometry.vectors import Up, axis_vector
from viewer.rigs.kinematics import rest_world_rotations, world_matrices, world_rotations
from viewer.rigs.pose import Pose, joint_rotations, zero_pose
from viewer.rigs.posing.joint_rotation import nearest_dofs
from viewer.rigs.retargeting.joint_names import joint_meanings
from viewer.rigs.skeleton import Skeleton

_INEXACT = 1e-4  # error in radians below which a rotation is treated as reached
_REST_DIGITS = 5  # number of decimals to which equal rest rotations agree


@dataclass(frozen=True, slots=True, eq=False)
class JointRotations:
    """Joint rotations of a posed figure, independent of its DOFs."""

    figure: str
    """Name of the figure."""
    names: tuple[str, ...]
    """Names of the joints."""
    relative: Floats
    """(J, 4). Rotations relative to the rest pose, in the figure's axes: quaternions (x, y, z,
    w)."""
    shifts: Floats
    """(J, 3). Translations in addition to the DOFs, in the parent joint's frame."""
    up: Up
    """The figure's up axis, ``"y"`` or ``"z"``."""
    layout: str
    """Result of ``dof_layout``: figures with the same layout use the DOF values directly."""
    rotations: Floats | None = None
    """(J, 4) or None. Base rotations, before the DOFs, as in ``Pose``; None for the rest pose's."""
    meanings: tuple[str, ...] = ()
    """For a figure whose file states human bones, their names in the SMPL family; otherwise
    empty."""
    left: Floats = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    """(3,). The figure's left, a horizontal direction; measured for figures with meanings."""
    scales: Floats | None = None
    """(J, 3) or None. Local scale factors, as in ``Pose``; None for the rest pose's."""


def relative_rotations(figure: Figure, pose: Pose) -> JointRotations:
    """Return the joint rotations of a posed figure."""
    skeleton = figure.require_skeleton()
    relative = world_rotations(skeleton.parents, joint_rotations(skeleton, pose)) @ np.swapaxes(
        rest_world_rotations(skeleton), 1, 2
    )
    return JointRotations(
        figure.name,
        skeleton.names,
        matrix_to_quaternion(relative),
        pose.translations.copy(),
        figure.up,
        dof_layout(figure),
        None if np.array_equal(pose.rotations, skeleton.rest_rotations) else pose.rotations.copy(),
        () if skeleton.humanoid is None else joint_meanings(skeleton),
        left_of(figure),
        None if np.array_equal(pose.scales, skeleton.rest_scales) else pose.scales.copy(),
    )


def dof_layout(figure: Figure) -> str:
    """Return a digest of the meaning of DOFs, without blend shapes: if equal, values fit."""
    import hashlib

    skeleton = figure.require_skeleton()
    # Adding 0 replaces -0 by 0.
    rest = quaternion_to_matrix(skeleton.rest_rotations).round(_REST_DIGITS) + 0.0
    parts = (
        repr((skeleton.names, figure.up)).encode("utf-8", "surrogatepass"),
        *(
            array.astype(np.int32).tobytes()
            for array in (skeleton.parents, skeleton.dof_joints, skeleton.dof_kinds)
        ),
        rest.tobytes(),
    )
    return hashlib.sha256(b"|".join(parts)).hexdigest()[:16]


def has_layout_of(source: JointRotations, figure: Figure) -> bool:
    """Return whether a pose's DOFs, not only its joint rotations, can be applied to a figure."""
    skeleton = figure.require_skeleton()
    # Files may be edited by hand: an equal digest does not guarantee lists of the right length.
    return source.layout == dof_layout(figure) and source.names == skeleton.names


def restore_beneath(skeleton: Skeleton, pose: Pose, source: JointRotations, is_whole: bool) -> None:
    """Restore the rotations, translations and scales beneath the DOFs, in place.

    A motion may scale joints, or rotate them about axes without DOFs. ``is_whole``: joints that
    ``source`` lacks go to rest. Its world rotations are out of date once DOFs are edited.
    """
    if source.rotations is not None:
        pose.rotations[:] = source.rotations
    elif is_whole:
        pose.rotations[:] = skeleton.rest_rotations
    if is_whole or source.shifts.any():
        pose.translations[:] = source.shifts
    if source.scales is not None:
        pose.scales[:] = source.scales
    elif is_whole:
        pose.scales[:] = skeleton.rest_scales


def joints_by_name(source: Sequence[str], target: Sequence[str]) -> Ints:
    """Return the source joint of each target joint's name (J,); -1 for empty and repeated names."""
    counts, others = Counter(source), Counter(target)
    place = {name: joint for joint, name in enumerate(source)}
    return np.array(
        [place[name] if name and counts[name] == others[name] == 1 else -1 for name in target],
        dtype=np.int32,
    )


def rotate_joints(
    source: JointRotations, target: Figure, start: Pose
) -> tuple[Pose, list[Diagnostic]]:
    """Return ``start`` with joints rotated like another figure's, within limits, and notes.

    RigError if the figures have no joint name in common.
    """
    other = target.skeleton
    if other is None:
        raise RigError(note(wording.POSE, figure=target.name))
    # The source joint of each target joint, by name, then by stated bones; -1 for none.
    partners = joints_by_name(source.names, other.names)
    if source.meanings or other.humanoid is not None:
        # Other figures may have the names of the SMPL family.
        theirs = source.meanings or source.names
        mine = other.names if other.humanoid is None else joint_meanings(other)
        meant = joints_by_name(theirs, mine)
        is_free = (partners < 0) & ~np.isin(meant, partners)
        partners = np.where(is_free, meant, partners)
    found = np.flatnonzero(partners >= 0)
    if not len(found):
        values = {"pose": source.figure or Phrase("the pose"), "figure": target.name}
        raise RigError(
            note(
                "F004.no-common-joint: {pose} and {figure} have no joint names in common", **values
            )
        )
    to_target = up_rotation(source.up, target.up)
    if source.meanings or other.humanoid is not None:
        up = axis_vector(target.up)
        to_target = _arc(to_target @ source.left, left_of(target), up) @ to_target
    deltas = to_target @ quaternion_to_matrix(source.relative[partners[found]]) @ to_target.T
    rest = rest_world_rotations(other)
    wanted = dict(zip(found.tolist(), deltas @ rest[found], strict=True))
    moved, missed = start.copy(), []
    world = np.empty((other.n_joints, 3, 3))
    present = joint_rotations(other, start)
    for joint, parent in enumerate(other.parents.tolist()):
        # The target rotation of the parent preserves local rotations; the limited one would not.
        above = world[parent] if parent >= 0 else np.eye(3)
        world[joint] = wanted.get(joint, above @ present[joint])
        if joint in wanted:
            moved.rotations[joint] = other.rest_rotations[joint]
            fitted = nearest_dofs(other, moved, joint, above.T @ world[joint])
            moved.dofs[:] = fitted.dofs
            if fitted.error > _INEXACT:
                missed.append(joint)
    return moved, _notes(source, target, partners, missed)


def left_of(figure: Figure) -> Floats:
    """Return the left (3,): -x for characters of VRM 0.x, which face -z; +x without human bones."""
    skeleton, usual = figure.require_skeleton(), np.array([1.0, 0.0, 0.0])
    if skeleton.humanoid is None:
        return usual
    place = {name: joint for joint, name in enumerate(joint_meanings(skeleton)) if name}
    pairs = [
        (place[f"left_{part}"], place[f"right_{part}"])
        for part in ("hip", "shoulder", "collar", "elbow", "wrist")
        if {f"left_{part}", f"right_{part}"} <= set(place)
    ]
    if not pairs:
        return usual
    points = world_matrices(skeleton, zero_pose(skeleton))[:, :3, 3]
    sides = sum((points[left] - points[right] for left, right in pairs), np.zeros(3))
    sides["xyz".index(figure.up)] = 0.0
    largest = int(np.abs(sides).argmax())
    # Fronts are along an axis; a twisted pair of shoulders must not rotate the pose.
    return np.sign(sides[largest]) * np.eye(3)[largest] if sides.any() else usual


def _arc(start: Floats, end: Floats, up: Floats) -> Floats:
    """Return the rotation about the up axis from one horizontal axis to another: (3, 3)."""
    angle = np.arctan2(np.cross(start, end) @ up, start @ end)
    return rotation_vector_to_matrix(angle * up)


def _notes(
    source: JointRotations, target: Figure, partners: Ints, missed: list[int]
) -> list[Diagnostic]:
    """Return messages about the transferred joints."""
    skeleton = target.require_skeleton()
    used = set(partners[partners >= 0].tolist())
    whose = printable(source.figure) or "the pose"
    values: dict[str, object] = {"n": len(used), "all": len(source.names), "figure": whose}
    notes = [note("F007.joints-taken-over: transferred {n} of {all} joints of {figure}", **values)]
    lacking = [name or f"#{joint}" for joint, name in enumerate(source.names) if joint not in used]
    if lacking:
        values = {
            "figure": target.name,
            "names": listed([printable(name, 40) for name in lacking], 12),
        }
        notes.append(note("F007.joints-lacking: {figure} has no joint named {names}", **values))
    if missed:
        values = {"names": listed([printable(skeleton.names[joint], 40) for joint in missed], 12)}
        notes.append(
            note("F007.joints-limited: rotated as far as DOFs and limits allow: {names}", **values)
        )
    return notes
