"""Pose records: poses as stored in files and on the clipboard, and their application to figures."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import field

import numpy as np

from viewer.arguments import check_type
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase, note, wording
from viewer.errors import RigError
from viewer.phrases import agree, counted, listed
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.bodies.smpl_family import ShapeSpace, members_by_numbers
from viewer.rigs.coefficients import apply_coefficients
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix
from viewer.rigs.hands import Hand, hand_vectors
from viewer.rigs.pose import Pose, set_joint_rotations
from viewer.rigs.posing.pose_vector import read_vector, write_vector
from viewer.rigs.retargeting.pose_transfer import (
    JointRotations,
    has_layout_of,
    relative_rotations,
    restore_beneath,
    rotate_joints,
)
from viewer.rigs.skeleton import DOF_KINDS, Skeleton, clamp_dofs, dof_labels, find_dof

PARTS = {
    "global_orient": ("pelvis", "wrist", "global"),
    "neck_pose": ("neck",),
    "jaw_pose": ("jaw",),
    "leye_pose": ("left_eye",),
    "reye_pose": ("right_eye",),
}
"""Rotation vectors of single joints under the names used by smplx."""

_BODY, _LONGEST_BODY = 21, 23  # joints of body_pose in models with fingers or a face, and in SMPL
_SMALLEST, _LARGEST = 1e-6, 1e6  # range of scales that can be drawn in float32
_FARTHEST = 1e9  # largest translation, figure units
_HAND_PARTS = {"left_hand_pose": "left", "right_hand_pose": "right", "hand_pose": ""}


@dataclass(frozen=True, slots=True, eq=False)
class PoseRecord:
    """Contents of a pose file; missing parts remain at rest."""

    dofs: Mapping[str, float] = field(default_factory=dict)
    """Lengths and radians by label, such as ``"left_knee.x"``."""
    vector: Floats | None = None
    """(N,) or None. The model's own pose vector."""
    parts: Mapping[str, Floats] = field(default_factory=dict)
    """Rotation vectors or hand coefficients by smplx's names: ``global_orient``, ``body_pose``,
    ``left_hand_pose`` …."""
    shape: Floats | None = None
    expression: Floats | None = None
    """(N,) or None. Weights of the first blend shapes of each group."""
    translation: Floats | None = None
    """(3,) or None. Translation of the figure, after skinning."""
    scale: float | None = None
    """Scale of the figure, after skinning."""
    flat_hands: bool | None = None
    """Whether hand poses are relative to the flat hand; if None, the mean is added to coefficients
    only."""
    hand_coefficients: bool | None = None
    """Whether hand poses are coefficients; None means True unless there are 45 values."""
    joint_rotations: JointRotations | None = None
    """Used by figures with different DOFs instead of the DOF values: joints with the same names get
    the same rotations; placement, size and shape are unchanged. Figures with the same DOFs use
    all other parts, except coefficients of blend shapes that they lack."""
    shape_space: ShapeSpace = ShapeSpace()
    """Model and gender to which the shape coefficients belong, as stated by the file."""
    line_of: Callable[[str, str], int | None] | None = None
    """Returns the line in the source file, given a part and the name of a DOF in it, as in
    ``PosePartError``."""


class PosePartError(RigError):
    """A part of a pose that cannot be applied: ``part`` of the record, ``name`` of a DOF or ""."""

    def __init__(self, problem: RigError, part: str, name: str = "") -> None:
        self.part, self.name = part, name
        super().__init__(problem.diagnostic or str(problem))


@contextmanager
def _part(part: str, name: str = "") -> Iterator[None]:
    """Attribute errors to a part of a record."""
    try:
        yield
    except RigError as problem:
        raise PosePartError(problem, part, name) from None


def record_of(figure: Figure, pose: Pose, gender: str = "") -> PoseRecord:
    """Return a complete pose both by DOF names and as the model's pose vector.

    Parameters
    ----------
    figure
        Figure with a skeleton.
    pose
        Pose of that figure.
    gender
        Gender of the body, as stated by its file; that of the figure if empty.
    """
    check_type("figure", figure, Figure)
    check_type("pose", pose, Pose)
    check_type("gender", gender, str)
    skeleton = figure.require_skeleton()
    groups = figure.blend_shapes.groups if figure.blend_shapes else ()
    weights = np.zeros(len(groups))
    weights[: len(pose.shape_weights)] = pose.shape_weights
    is_shape = np.array([group == "shape" for group in groups], dtype=bool)
    return PoseRecord(
        dofs=dict(zip(dof_labels(skeleton), pose.dofs.tolist(), strict=True)),
        vector=write_vector(figure.pose_layout, skeleton, pose),
        shape=weights[is_shape] if is_shape.any() else None,
        expression=weights[~is_shape] if (~is_shape).any() else None,
        translation=pose.figure_translation.copy(),
        scale=pose.figure_scale,
        joint_rotations=relative_rotations(figure, pose),
        shape_space=_own_space(figure, gender),
    )


def _own_space(figure: Figure, gender: str) -> ShapeSpace:
    """Return the space of a figure's shapes; no model for shapes that do not come from one."""
    shapes, own = figure.blend_shapes, figure.shape_space
    # Shapes of models are numbered; those of the bundled body are named after their effects.
    is_model = shapes is None or "stature" not in shapes.names
    return ShapeSpace(own.model if is_model else "", gender or own.gender)


def apply_record(
    record: PoseRecord, figure: Figure, pose: Pose, drop_excess: bool = False
) -> list[Diagnostic]:
    """Apply a record to a figure's pose, in place.

    Parameters
    ----------
    record
        The record to apply.
    figure
        Figure with a skeleton.
    pose
        Modified, except for properties that are not in the record.
    drop_excess
        Ignore coefficients that the figure does not have, as in files of related models, instead of
        raising an error. They are always ignored in records with ``joint_rotations``.

    Returns
    -------
    list of Diagnostic
        Messages about data that could not be applied exactly.

    Raises
    ------
    PosePartError
        If a part of the record does not fit this figure and it has no joint rotations;
        the pose is then unchanged.
    RigError
        If the figures have no joint name in common.
    """
    check_type("record", record, PoseRecord)
    check_type("figure", figure, Figure)
    check_type("pose", pose, Pose)
    skeleton = figure.skeleton
    if skeleton is None:
        raise RigError(note(wording.POSE, figure=figure.name))
    if record.joint_rotations is not None and not has_layout_of(record.joint_rotations, figure):
        work, notes = rotate_joints(record.joint_rotations, figure, pose)
        _take_over(work, pose)
        return notes + _left_as_they_were(record)
    work = pose.copy()
    notes = []
    if record.dofs:
        notes += _apply_dofs(record, figure, work)
    elif record.vector is not None:
        with _part("vector"):
            notes += _apply_vector(record.vector, figure, work)
    for name, values in record.parts.items():
        with _part(name):
            notes += _apply_part(name, values, record, figure, work)
    has_shapes = figure.blend_shapes is not None and "shape" in figure.blend_shapes.groups
    # Everything possible is applied from a pose of a figure with the same skeleton.
    drop_excess = record.joint_rotations is not None or (drop_excess and has_shapes)
    with _part("shape"):
        notes += apply_coefficients("shape", record.shape, figure, work, drop_excess)
    with _part("expression"):
        notes += apply_coefficients("expression", record.expression, figure, work, drop_excess)
    if record.translation is not None:
        work.figure_translation = np.array(record.translation, dtype=np.float64)
    if record.scale is not None:
        work.figure_scale = float(record.scale)
    notes += _keep_drawable(pose, work)
    _take_over(work, pose)
    return notes


def _take_over(work: Pose, pose: Pose) -> None:
    for name in Pose.__slots__:
        setattr(pose, name, getattr(work, name))


def _left_as_they_were(record: PoseRecord) -> list[Diagnostic]:
    """Return a message about parts of a record that do not apply if the DOFs differ."""
    moves = DOF_KINDS[:3]
    moved = [label for label, value in record.dofs.items() if value and label.endswith(moves)]
    rotations = record.joint_rotations
    shifts = rotations is not None and rotations.shifts.any()
    place = record.translation is not None and np.any(record.translation)
    shapes = (values is not None and np.any(values) for values in (record.shape, record.expression))
    left = {
        "joint translations": bool(moved) or shifts,
        "figure translation": place,
        "figure scale": record.scale not in (None, 1.0),
        "joint scales": rotations is not None and rotations.scales is not None,
        "figure shape": any(shapes),
    }
    names = [Phrase(key) for key, says in left.items() if says]
    return (
        [note("F007.left-as-they-were: unchanged: {names}", names=listed(names))] if names else []
    )


def _keep_drawable(before: Pose, pose: Pose) -> list[Diagnostic]:
    """Restore the placement or scale if it cannot be drawn; return messages about it."""
    notes = []
    scale = pose.figure_scale
    if not _SMALLEST <= scale <= _LARGEST:
        fault = Phrase(
            "scale: expected {low:g} to {high:g}, found {found:g}",
            low=_SMALLEST,
            high=_LARGEST,
            found=scale,
        )
        if scale <= 0.0:
            fault = Phrase("scale: expected a positive number, found {found:g}", found=scale)
        kept = {"fault": fault, "scale": before.figure_scale}
        notes.append(note("F007.scale-kept: {fault}; kept at {scale:g}", **kept))
        pose.figure_scale = before.figure_scale
    far = float(np.abs(pose.figure_translation).max())
    if far > _FARTHEST:
        fault = Phrase(
            "translation: expected at most {most:g}, found {found:g}", most=_FARTHEST, found=far
        )
        notes.append(note("F007.translation-kept: {fault}; unchanged", fault=fault))
        pose.figure_translation = before.figure_translation.copy()
    return notes


def _apply_dofs(record: PoseRecord, figure: Figure, pose: Pose) -> list[Diagnostic]:
    skeleton = figure.require_skeleton()
    for label, value in record.dofs.items():
        with _part("dofs", label):
            pose.dofs[_dof(figure, label)] = value
    if record.joint_rotations is not None:
        is_whole = len(record.dofs) == skeleton.n_dofs
        restore_beneath(skeleton, pose, record.joint_rotations, is_whole)
    before = pose.dofs.copy()
    pose.dofs[:] = clamp_dofs(skeleton, before)
    return _beyond_limits(skeleton, before)


def _dof(figure: Figure, label: str) -> int:
    try:
        return find_dof(figure.require_skeleton(), label)
    except RigError as problem:
        # The label is removed here, as the caller adds it.
        why = str(problem).removeprefix(f'"{label}": ')
        values = {"figure": figure.name, "found": label, "reason": why}
        raise RigError(
            note(
                'F002.pose-unknown-dof: expected a DOF of {figure}, found "{found}": {reason}',
                **values,
            )
        ) from None


def _beyond_limits(skeleton: Skeleton, dofs: Floats) -> list[Diagnostic]:
    count = int((clamp_dofs(skeleton, dofs) != dofs).sum())
    return (
        [
            note(
                "F007.pose-clamped: {n} of the pose clamped to {their} limits",
                n=counted(count, "DOF"),
                their=agree(count, "its", "their"),
            )
        ]
        if count
        else []
    )


def _apply_vector(vector: Floats, figure: Figure, pose: Pose) -> list[Diagnostic]:
    """Apply the pose vector of the model, or of another member of the SMPL family."""
    skeleton = figure.require_skeleton()
    layout = figure.pose_layout
    own = skeleton.n_dofs if layout is None else layout.n_numbers
    if figure.parameters is not None and len(vector) == figure.parameters.count:
        figure.parameters.apply(skeleton, pose, vector)
        return []
    if len(vector) == own:
        read_vector(layout, skeleton, pose, vector)
        return _beyond_limits(skeleton, vector) if layout is None else []
    is_family = "pelvis" in skeleton.names and layout is not None and layout.translation < 0
    names = members_by_numbers().get(len(vector)) if is_family else None
    if names is None:
        values = {"expected": own, "figure": figure.name, "found": len(vector)}
        raise RigError(
            note(
                "F002.pose-vector: expected {expected} pose values for {figure}, found {found}",
                **values,
            )
        )
    # Joints that the model of the vector lacks are reset to rest.
    joints = np.arange(skeleton.n_joints, dtype=np.int32)
    wanted = np.zeros((skeleton.n_joints, 3))
    rows = vector.reshape(-1, 3)
    lost = 0
    for name, row in zip(names, rows, strict=True):
        if name in skeleton.names:
            wanted[skeleton.names.index(name)] = row
        else:
            lost += bool(row.any())
    _turn(figure, pose, joints, wanted.ravel())
    values = {"n": counted(lost, "joint"), "figure": figure.name}
    return (
        [
            note(
                "F007.pose-joints-left-out: {n} of the pose omitted: missing from {figure}",
                **values,
            )
        ]
        if lost
        else []
    )


def _apply_part(
    name: str, values: Floats, record: PoseRecord, figure: Figure, pose: Pose
) -> list[Diagnostic]:
    skeleton = figure.require_skeleton()
    values = np.asarray(values, dtype=np.float64).ravel()
    if name == "body_pose":
        return _apply_body(values, figure, pose)
    if name in _HAND_PARTS:
        hand = next((hand for hand in figure.hands if hand.side == _HAND_PARTS[name]), None)
        return _apply_hand(hand, name, values, record, figure, pose)
    known = [joint for joint in PARTS[name] if joint in skeleton.names]
    if not known:
        if values.any():
            return [
                note(
                    "F007.part-left-out: {part} omitted: {figure} has no such joint",
                    part=name,
                    figure=figure.name,
                )
            ]
        return []
    if len(values) != 3:
        raise _odd_length(name, 3, len(values))
    _turn(figure, pose, np.array([skeleton.names.index(known[0])], dtype=np.int32), values)
    return []


def _apply_body(values: Floats, figure: Figure, pose: Pose) -> list[Diagnostic]:
    """Rotate the joints after the root; other models have no equivalent of SMPL's hand joints."""
    skeleton = figure.require_skeleton()
    has_more = "left_wrist" in skeleton.names and "left_hand" not in skeleton.names
    own = _BODY if has_more else skeleton.n_joints - 1
    most = _LONGEST_BODY if has_more else own
    if len(values) % 3 or len(values) > 3 * most:
        numbers = {"most": most, "found": counted(len(values), "number")}
        raise RigError(
            note(
                "F002.pose-body: body_pose: expected 3 numbers per joint for at most {most} "
                "joints, found {found}",
                **numbers,
            )
        )
    taken = values[: 3 * own]
    _turn(figure, pose, np.arange(1, len(taken) // 3 + 1, dtype=np.int32), taken)
    return [_left_out(values[3 * own :], own)] if values[3 * own :].any() else []


def _odd_length(name: str, expected: int, found: int) -> RigError:
    values = {"item": name, "expected": expected, "found": found}
    return RigError(
        note("F002.pose-part: {item}: expected {expected} numbers, found {found}", **values)
    )


def _left_out(rest: Floats, own: int) -> Diagnostic:
    count = int(rest.reshape(-1, 3).any(axis=1).sum())
    return note(
        "F007.body-joints-left-out: {n} in the pose beyond the body's {own} omitted",
        n=counted(count, "joint"),
        own=own,
    )


def _apply_hand(
    hand: Hand | None,
    name: str,
    values: Floats,
    record: PoseRecord,
    figure: Figure,
    pose: Pose,
) -> list[Diagnostic]:
    skeleton = figure.require_skeleton()
    side = _HAND_PARTS[name]
    if hand is None and side and len(figure.hands) == 1 and not figure.hands[0].side:
        hand = figure.hands[0]  # MANO is a model of one hand, left or right
    first = f"{side}_index1" if side else "index1"
    if hand is None and len(values) == 45 and first in skeleton.names:
        start = skeleton.names.index(first)
        _turn(figure, pose, np.arange(start, start + 15, dtype=np.int32), values)
        return []
    if hand is None:
        if values.any():
            return [
                note(
                    "F007.hand-part-left-out: {part} omitted: {figure} has no hand components",
                    part=name,
                    figure=figure.name,
                )
            ]
        return []
    as_coefficients = record.hand_coefficients
    if as_coefficients is None:
        as_coefficients = len(values) != 45
    flat = record.flat_hands if record.flat_hands is not None else not as_coefficients
    if as_coefficients:
        vectors = hand_vectors(hand, values, flat)
    elif len(values) == 45:
        vectors = (values + (0.0 if flat else hand.mean)).reshape(-1, 3)
    else:
        raise _odd_length(name, 45, len(values))
    _turn(figure, pose, hand.joints, vectors.ravel())
    return []


def _turn(figure: Figure, pose: Pose, joints: Ints, numbers: Floats) -> None:
    rotations = rotation_vector_to_matrix(numbers.reshape(-1, 3))
    set_joint_rotations(figure.require_skeleton(), pose, joints, rotations)
