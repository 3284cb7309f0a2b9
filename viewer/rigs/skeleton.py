"""A hierarchy of joints with a table of degrees of freedom (DOFs)."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Bools, Floats, Ints, freeze_fields
from viewer.rigs.bodies.joint_posing import JointPosing
from viewer.rigs.checked_fields import checked
from viewer.rigs.memo import Memo

if TYPE_CHECKING:
    from viewer.rigs.constraints.constraint import Constraint
    from viewer.rigs.humanoid import Humanoid
    from viewer.rigs.springs.spring_joints import Springs

DOF_KINDS = ("tx", "ty", "tz", "x", "y", "z")
"""Kinds of DOF by code: translations along x, y, z, then rotations about x, y, z."""

FIRST_ROTATION = 3
"""Kinds less than this are translations, all others rotations."""


@checked
@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Skeleton:
    """Joints as parallel arrays, parents before children."""

    names: tuple[str, ...]
    """Names, which may repeat or be empty: joints are identified by index."""
    parents: Ints
    """(J,) int32. Index of the parent, smaller than the joint's own; -1 for a root."""
    rest_translations: Floats
    rest_rotations: Floats
    rest_scales: Floats
    """(J, 3), (J, 4), (J, 3). Local transform before any DOF: lengths, quaternions (x, y, z, w),
    factors."""
    dof_joints: Ints
    dof_kinds: Ints
    """(D,) int32. Joint of each DOF, and its index into ``DOF_KINDS``. The first rotation row of a
    joint is applied first."""
    rest_dofs: Floats
    """(D,). Values of the pose stored in the file: lengths or radians, within the limits."""
    dof_limits: Floats
    """(D, 2). Smallest and largest value; -inf and inf if unlimited."""
    boxes: Floats | None = None
    """(J, 2, 3) or None. Lowest and highest corner of the box drawn for each joint, in joint
    space."""
    boxes_from_bones: bool = False
    """Whether a reader made the boxes, each from its joint to the next ones or to the far end of
    the last bone. They are parallel to the joint's axes, so they do not fit oblique bones:
    pictures show bones by default."""
    auxiliary: Bools | None = None
    """(J,) bool or None. Joints that are not in the file: a reader added them to represent a
    transform or a second binding exactly. They have no DOFs, and ``shown_joints`` omits them:
    lists, pictures and messages show the nearest ancestor in their place. None if there are
    none."""
    humanoid: Humanoid | None = None
    """Joints with the standard names of human bones, if the file states them."""
    constraints: tuple[Constraint, ...] = ()
    """Constraints of joints that follow others, in the order of evaluation; at most one per
    joint."""
    springs: Springs | None = None
    """Joints that are simulated as springs while a motion plays."""
    posing: JointPosing | None = None
    """Rules by which joints follow the DOFs instead of rotating about x, y and z."""

    def __post_init__(self) -> None:
        joints = len(self.names)
        freeze_fields(self, np.int32, parents=(joints,))
        freeze_fields(self, rest_translations=(joints, 3), rest_rotations=(joints, 4))
        freeze_fields(self, rest_scales=(joints, 3))
        freeze_fields(self, np.int32, dof_joints=(None,))
        freeze_fields(self, np.int32, dof_kinds=(self.n_dofs,))
        freeze_fields(self, rest_dofs=(self.n_dofs,), boxes=(joints, 2, 3))
        freeze_fields(self, np.bool_, auxiliary=(joints,))
        try:
            limits = np.array(self.dof_limits, dtype=np.float64)
        except (TypeError, ValueError):
            limits = np.zeros(0)
        if limits.shape != (self.n_dofs, 2) or np.isnan(limits).any():
            raise RigError(f"dof_limits: expected shape {self.n_dofs} x 2 without NaN")
        limits.flags.writeable = False
        object.__setattr__(self, "dof_limits", limits)
        self._check_order()
        self._check_dofs()

    def _check_order(self) -> None:
        if len(self.names) == 0:
            raise RigError("a skeleton needs at least one joint")
        misplaced = np.flatnonzero(self.parents >= np.arange(self.n_joints))
        if len(misplaced) or self.parents.min() < -1:
            joint = int(misplaced[0]) if len(misplaced) else int(self.parents.argmin())
            raise RigError(
                f"joint {joint_label(self, joint)}: expected a parent before it, "
                f"found {self.parents[joint]}"
            )

    def _check_dofs(self) -> None:
        for name, values, end in (
            ("dof_joints", self.dof_joints, self.n_joints),
            ("dof_kinds", self.dof_kinds, len(DOF_KINDS)),
        ):
            wrong = np.flatnonzero((values < 0) | (values >= end))
            if len(wrong):
                raise RigError(f"{name}: expected 0 to {end - 1}, found {values[wrong[0]]}")
        wrong = np.flatnonzero(self.dof_limits[:, 0] > self.dof_limits[:, 1])
        if len(wrong):
            low, high = self.dof_limits[wrong[0]]
            raise RigError(
                f"dof_limits of {dof_label(self, wrong[0])}: expected a minimum not above the "
                f"maximum, found {low:g} and {high:g}"
            )
        zero = np.flatnonzero(~self.rest_rotations.any(axis=1))
        if len(zero):
            raise RigError(
                f"rest_rotations of joint {joint_label(self, zero[0])}: expected a quaternion, "
                "found 0 0 0 0"
            )

    @property
    def n_joints(self) -> int:
        """Number of joints, J."""
        return len(self.names)

    @property
    def n_dofs(self) -> int:
        """Number of degrees of freedom, D."""
        return len(self.dof_joints)

    @property
    def locked(self) -> Bools:
        """Mask of the DOFs with equal limits, which never move: (D,) bool."""
        return self.dof_limits[:, 0] == self.dof_limits[:, 1]


def ball_skeleton(names: tuple[str, ...], parents: Ints, joints: Floats) -> Skeleton:
    """Return unlimited ball joints at (J, 3), with DOFs about x, y and z and no rest rotations."""
    count = len(parents)
    above = np.where(parents[:, None] >= 0, joints[parents], 0.0)
    return Skeleton(
        names=names,
        parents=parents,
        rest_translations=joints - above,
        rest_rotations=np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)),
        rest_scales=np.ones((count, 3)),
        dof_joints=np.repeat(np.arange(count, dtype=np.int32), 3),
        dof_kinds=np.tile(np.arange(3, 6, dtype=np.int32), count),
        rest_dofs=np.zeros(3 * count),
        dof_limits=np.tile([-np.inf, np.inf], (3 * count, 1)),
    )


def scaled_skeleton(skeleton: Skeleton, factor: float) -> Skeleton:
    """Return a skeleton with rest translations and boxes times a factor; its DOFs stay."""
    boxes = None if skeleton.boxes is None else skeleton.boxes * factor
    return replace(skeleton, rest_translations=skeleton.rest_translations * factor, boxes=boxes)


def clamp_dofs(skeleton: Skeleton, dofs: Floats) -> Floats:
    """Clamp DOF values (..., D) to their limits."""
    return np.clip(dofs, skeleton.dof_limits[:, 0], skeleton.dof_limits[:, 1])


_labels: Memo[Skeleton, tuple[str, ...]] = Memo()


def joint_labels(skeleton: Skeleton) -> tuple[str, ...]:
    """Return unique labels: "knee", "knee#5" if several have that name, "#5" if unnamed.

    Auxiliary joints have the label of the joint that is shown in their place.
    """
    return _labels.get(skeleton, (), lambda: _made_labels(skeleton))


def _made_labels(skeleton: Skeleton) -> tuple[str, ...]:
    counts = Counter(skeleton.names)
    labels = tuple(
        name if name and counts[name] == 1 else f"{name}#{joint}"
        for joint, name in enumerate(skeleton.names)
    )
    if skeleton.auxiliary is None:
        return labels
    return tuple(labels[joint] for joint in shown_joint_of(skeleton).tolist())


def joint_label(skeleton: Skeleton, joint: int) -> str:
    """Return the label of one joint, as in ``joint_labels``."""
    return joint_labels(skeleton)[joint]


def shown_joints(skeleton: Skeleton) -> Ints:
    """Return the joints that are shown, without auxiliary ones: (N,) int32."""
    joints: Ints = np.arange(skeleton.n_joints, dtype=np.int32)
    return joints if skeleton.auxiliary is None else joints[~skeleton.auxiliary]


def shown_joint_of(skeleton: Skeleton) -> Ints:
    """Return the joint shown for each joint (J,): itself, or an auxiliary one's ancestor."""
    shown: Ints = np.arange(skeleton.n_joints, dtype=np.int32)
    if skeleton.auxiliary is not None:
        for joint in np.flatnonzero(skeleton.auxiliary).tolist():
            # Parents come first, so their entries are already final.
            shown[joint] = shown[skeleton.parents[joint]]
    return shown


def shown_parents(skeleton: Skeleton) -> Ints:
    """Return the shown joint above each joint, -1 for none: (J,) int32."""
    if skeleton.auxiliary is None:
        return skeleton.parents
    parents = shown_joint_of(skeleton)[skeleton.parents]
    return np.where(skeleton.parents < 0, np.int32(-1), parents)


def dof_label(skeleton: Skeleton, dof: int) -> str:
    """Return the label of a DOF, as on the command line: ``"knee.x"``, ``"root.ty"``."""
    return f"{joint_label(skeleton, skeleton.dof_joints[dof])}.{DOF_KINDS[skeleton.dof_kinds[dof]]}"


def dof_labels(skeleton: Skeleton) -> list[str]:
    """Return the labels of all DOFs, as from ``dof_label``, in linear time."""
    joints = joint_labels(skeleton)
    owners, kinds = skeleton.dof_joints.tolist(), skeleton.dof_kinds.tolist()
    return [f"{joints[joint]}.{DOF_KINDS[kind]}" for joint, kind in zip(owners, kinds, strict=True)]


def find_dof(skeleton: Skeleton, label: str) -> int:
    """Return the row of the DOF "NAME.KIND" or "#INDEX.KIND", case-insensitive."""
    joint_text, dot, kind = label.rpartition(".")
    if not dot or kind.lower() not in DOF_KINDS:
        raise RigError(f'"{label}": expected JOINT.KIND with KIND one of {", ".join(DOF_KINDS)}')
    joint = find_joint(skeleton, joint_text)
    code = DOF_KINDS.index(kind.lower())
    rows = np.flatnonzero((skeleton.dof_joints == joint) & (skeleton.dof_kinds == code))
    if len(rows) == 0:
        own = [DOF_KINDS[code] for code in skeleton.dof_kinds[skeleton.dof_joints == joint]]
        has = f"it has {', '.join(own)}" if own else "it has none"
        raise RigError(f"joint {joint_label(skeleton, joint)} has no DOF {kind.lower()}; {has}")
    return int(rows[0])


def find_joint(skeleton: Skeleton, text: str) -> int:
    """Return the joint called "NAME", "NAME#INDEX" or "#INDEX", case-insensitive."""
    name, hash_sign, index = text.rpartition("#")
    if hash_sign and index.isdecimal() and len(index) < 10 and int(index) < skeleton.n_joints:
        joint = int(index)
        if skeleton.names[joint].lower() == name.lower() or not name:
            return joint
    found = [joint for joint, name in enumerate(skeleton.names) if name == text]
    found = found or [j for j, name in enumerate(skeleton.names) if name.lower() == text.lower()]
    if len(found) == 1:
        return found[0]
    if found:
        labels = ", ".join(joint_label(skeleton, joint) for joint in found[:4])
        raise RigError(f'"{text}" is the name of {len(found)} joints: use one of {labels}')
    from viewer.near_names import name_hint

    raise RigError(f'no joint is called "{text}"; {name_hint(text, joint_labels(skeleton))}')
