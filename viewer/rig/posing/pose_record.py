"""A pose on its own, as files and the clipboard hold it, and how a figure takes it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from viewer.diagnostics import Diagnostic
from viewer.errors import RigError, counted
from viewer.rig.arrays import Floats, Ints
from viewer.rig.coefficients import apply_coefficients
from viewer.rig.figure import Figure
from viewer.rig.geometry.rotation import rotation_vector_to_matrix
from viewer.rig.hands import Hand, hand_vectors
from viewer.rig.pose import Pose
from viewer.rig.posing.pose_vector import read_vector, set_joint_rotations, write_vector
from viewer.rig.retargeting.pose_transfer import (
    JointTurns,
    joint_turns,
    restore_beneath,
    shares_layout,
    turn_joints,
)
from viewer.rig.skeleton import DOF_KINDS, Skeleton, clamp_dofs, dof_labels, find_dof
from viewer.rig.smpl_family import members_by_numbers

__all__ = ["PARTS", "PosePartError", "PoseRecord", "apply_record", "record_of"]

PARTS = {
    "global_orient": ("pelvis", "wrist", "global"),
    "neck_pose": ("neck",),
    "jaw_pose": ("jaw",),
    "leye_pose": ("left_eye",),
    "reye_pose": ("right_eye",),
}
"""Rotation vectors of single joints under the names that smplx gives them."""

_BODY = 21  # joints of body_pose in models with fingers or a face; SMPL alone has two more
_LONGEST_BODY = 23
_SMALLEST, _LARGEST = 1e-6, 1e6  # scales that float32 can draw
_FARTHEST = 1e9  # figure units
_HAND_PARTS = {"left_hand_pose": "left", "right_hand_pose": "right", "hand_pose": ""}


@dataclass(frozen=True, slots=True, eq=False)
class PoseRecord:
    """What a pose file says; parts that it does not have leave the pose at rest.

    Attributes
    ----------
    dofs : mapping of str to float
        By label, ``"left_knee.x"``: lengths and radians.
    vector : (N,) or None
        The model's own pose numbers.
    parts : mapping of str to array
        Rotation vectors or hand coefficients by smplx's names: ``global_orient``,
        ``body_pose``, ``left_hand_pose`` …
    shape, expression : (N,) or None
        Weights of the first blend shapes of each group.
    translation : (3,) or None
        Of the figure, after skinning.
    scale : float or None
        Of the figure, after skinning.
    flat_hands : bool or None
        Whether hand poses leave the mean hand out. None: only coefficients add it.
    hand_coefficients : bool or None
        Whether hand poses are coefficients; None: all but 45 numbers are.
    turns : JointTurns or None
        What a figure with other DOFs takes in place of the numbers: its joints of the same names
        turn as much, and its place, size and shape stay. Figures with the same DOFs take all else,
        and the shapes that they have.
    line_of : callable or None
        Given a part and the name of a DOF in it, as ``PosePartError`` has them, returns the line of
        the file that the record comes from.
    """

    dofs: Mapping[str, float] = field(default_factory=dict)
    vector: Floats | None = None
    parts: Mapping[str, Floats] = field(default_factory=dict)
    shape: Floats | None = None
    expression: Floats | None = None
    translation: Floats | None = None
    scale: float | None = None
    flat_hands: bool | None = None
    hand_coefficients: bool | None = None
    turns: JointTurns | None = None
    line_of: Callable[[str, str], int | None] | None = None


class PosePartError(RigError):
    """A part of a pose that a figure does not take.

    Parameters
    ----------
    problem : RigError
        What is wrong.
    part : str
        ``"dofs"``, ``"vector"``, ``"shape"``, ``"expression"`` or a name in ``parts``.
    name : str
        Of the DOF, empty for other parts.
    """

    def __init__(self, problem: RigError, part: str, name: str = "") -> None:
        self.part, self.name = part, name
        super().__init__(problem.diagnostic or str(problem))


@contextmanager
def _part(part: str, name: str = "") -> Iterator[None]:
    """Note which part of a record it is that a figure does not take."""
    try:
        yield
    except RigError as problem:
        raise PosePartError(problem, part, name) from None


def record_of(figure: Figure, pose: Pose) -> PoseRecord:
    """Return a pose in words and in the model's own numbers, both complete.

    Parameters
    ----------
    figure : Figure
        With a skeleton.
    pose : Pose
        Of that figure.
    """
    skeleton = figure.skeleton
    assert skeleton is not None  # whoever has a pose has a skeleton
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
        turns=joint_turns(figure, pose),
    )


def apply_record(record: PoseRecord, figure: Figure, pose: Pose, cut: bool = False) -> list[str]:
    """Pose a figure by a record, in place.

    Parameters
    ----------
    record : PoseRecord
        What to take over.
    figure : Figure
        With a skeleton.
    pose : Pose
        Changed; what the record does not mention stays.
    cut : bool
        Leave coefficients out that a figure with shapes has not, as files made for its kin need,
        instead of refusing them. Records with ``turns`` need no asking.

    Returns
    -------
    list of str
        What could not be taken over exactly, one line each.

    Raises
    ------
    PosePartError
        If a part of the record does not fit this figure and it does not say how the joints are
        turned; the pose is then as it was.
    RigError
        If no joint of one figure is called as one of the other.
    """
    skeleton = figure.skeleton
    if skeleton is None:
        raise RigError(f"figure {figure.name} has no skeleton to pose")
    if record.turns is not None and not shares_layout(record.turns, figure):
        work, notes = turn_joints(record.turns, figure, pose)
        _take_over(work, pose)
        return notes + _left_as_they_were(record)
    work, notes = pose.copy(), []
    if record.dofs:
        notes += _apply_dofs(record, figure, work)
    elif record.vector is not None:
        with _part("vector"):
            notes += _apply_vector(record.vector, figure, work)
    for name, values in record.parts.items():
        with _part(name):
            notes += _apply_part(name, values, record, figure, work)
    has_shapes = figure.blend_shapes is not None and "shape" in figure.blend_shapes.groups
    # A pose that was made by a figure of the same skeleton is taken as far as it goes.
    cut = record.turns is not None or (cut and has_shapes)
    with _part("shape"):
        notes += apply_coefficients("shape", record.shape, figure, work, cut)
    with _part("expression"):
        notes += apply_coefficients("expression", record.expression, figure, work, cut)
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


def _left_as_they_were(record: PoseRecord) -> list[str]:
    """Return a line on what a record says that a figure with other DOFs does not take over."""
    moves = DOF_KINDS[:3]
    moved = [label for label, value in record.dofs.items() if value and label.endswith(moves)]
    shifts = record.turns is not None and record.turns.shifts.any()
    place = record.translation is not None and np.any(record.translation)
    shapes = (values is not None and np.any(values) for values in (record.shape, record.expression))
    left = {
        "where joints are moved to": bool(moved) or shifts,
        "the figure's place": place,
        "its size": record.scale not in (None, 1.0),
        "its shape": any(shapes),
    }
    words = [word for word, says in left.items() if says]
    return [f"left as they were: {', '.join(words)}"] if words else []


def _keep_drawable(before: Pose, pose: Pose) -> list[str]:
    """Undo a place or scale that no camera could show, and say so."""
    notes = []
    if not _SMALLEST <= pose.figure_scale <= _LARGEST:
        notes.append(
            f"scale: expected more than 0, found {pose.figure_scale:g}; "
            f"left at {before.figure_scale:g}"
            if pose.figure_scale <= 0.0
            else f"scale: expected {_SMALLEST:g} to {_LARGEST:g}, found {pose.figure_scale:g}; "
            f"left at {before.figure_scale:g}"
        )
        pose.figure_scale = before.figure_scale
    far = float(np.abs(pose.figure_translation).max())
    if far > _FARTHEST:
        notes.append(f"translation: expected at most {_FARTHEST:g}, found {far:g}; left as it was")
        pose.figure_translation = before.figure_translation.copy()
    return notes


def _apply_dofs(record: PoseRecord, figure: Figure, pose: Pose) -> list[str]:
    skeleton = figure.skeleton
    assert skeleton is not None
    for label, value in record.dofs.items():
        with _part("dofs", label):
            pose.dofs[_dof(figure, label)] = value
    if record.turns is not None:
        is_whole = len(record.dofs) == skeleton.n_dofs
        restore_beneath(skeleton, pose, record.turns, is_whole)
    notes = _beyond_limits(skeleton, pose.dofs)
    pose.dofs[:] = clamp_dofs(skeleton, pose.dofs)
    return notes


def _dof(figure: Figure, label: str) -> int:
    assert figure.skeleton is not None
    try:
        return find_dof(figure.skeleton, label)
    except RigError as problem:
        why = str(problem).removeprefix(f'"{label}": ')  # once is enough
        values = {"figure": figure.name, "found": label, "reason": why}
        raise RigError(Diagnostic("F002.pose-unknown-dof", values=values)) from None


def _beyond_limits(skeleton: Skeleton, dofs: Floats) -> list[str]:
    count = int((clamp_dofs(skeleton, dofs) != dofs).sum())
    which = counted(count, "DOF")
    were = "was beyond its" if count == 1 else "were beyond their"
    return [f"{which} of the pose {were} limits and clamped"] if count else []


def _apply_vector(vector: Floats, figure: Figure, pose: Pose) -> list[str]:
    """Take the model's own numbers, or the vector of another member of the SMPL family."""
    skeleton = figure.skeleton
    assert skeleton is not None
    layout = figure.pose_layout
    own = skeleton.n_dofs if layout is None else layout.n_numbers
    if len(vector) == own:
        read_vector(layout, skeleton, pose, vector)
        return _beyond_limits(skeleton, vector) if layout is None else []
    is_family = "pelvis" in skeleton.names and layout is not None and layout.translation < 0
    names = members_by_numbers().get(len(vector)) if is_family else None
    if names is None:
        values = {"expected": own, "figure": figure.name, "found": len(vector)}
        raise RigError(Diagnostic("F002.pose-vector", values=values))
    # Joints that this model has and the vector's model has not go to rest.
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
    which, was = counted(lost, "joint"), "was" if lost == 1 else "were"
    return [f"{which} of the pose that {figure.name} lacks {was} left out"] if lost else []


def _apply_part(
    name: str, values: Floats, record: PoseRecord, figure: Figure, pose: Pose
) -> list[str]:
    skeleton = figure.skeleton
    assert skeleton is not None
    values = np.asarray(values, dtype=np.float64).ravel()
    if name == "body_pose":
        return _apply_body(values, figure, pose)
    if name in _HAND_PARTS:
        return _apply_hand(_hand(figure, name), name, values, record, figure, pose)
    known = [joint for joint in PARTS[name] if joint in skeleton.names]
    if not known:
        if values.any():
            return [f"{name}: {figure.name} has no such joint, left out"]
        return []
    if len(values) != 3:
        raise _odd_length(name, 3, len(values))
    _turn(figure, pose, np.array([skeleton.names.index(known[0])], dtype=np.int32), values)
    return []


def _apply_body(values: Floats, figure: Figure, pose: Pose) -> list[str]:
    """Turn the joints after the root; the two hands of SMPL mean nothing to its kin."""
    skeleton = figure.skeleton
    assert skeleton is not None
    has_more = "left_wrist" in skeleton.names and "left_hand" not in skeleton.names
    own = _BODY if has_more else skeleton.n_joints - 1
    most = _LONGEST_BODY if has_more else own
    if len(values) % 3 or len(values) > 3 * most:
        numbers = {"most": most, "found": len(values)}
        raise RigError(Diagnostic("F002.pose-body", values=numbers))
    taken = values[: 3 * own]
    _turn(figure, pose, np.arange(1, len(taken) // 3 + 1, dtype=np.int32), taken)
    return [_left_out(values[3 * own :], own)] if values[3 * own :].any() else []


def _odd_length(name: str, expected: int, found: int) -> RigError:
    values = {"item": name, "expected": expected, "found": found}
    return RigError(Diagnostic("F002.pose-part", values=values))


def _left_out(rest: Floats, own: int) -> str:
    count = int(rest.reshape(-1, 3).any(axis=1).sum())
    was = "was" if count == 1 else "were"
    return f"{counted(count, 'joint')} of the pose beyond the body's {own} {was} left out"


def _hand(figure: Figure, name: str) -> Hand | None:
    return next((hand for hand in figure.hands if hand.side == _HAND_PARTS[name]), None)


def _apply_hand(
    hand: Hand | None,
    name: str,
    values: Floats,
    record: PoseRecord,
    figure: Figure,
    pose: Pose,
) -> list[str]:
    skeleton = figure.skeleton
    assert skeleton is not None
    side = _HAND_PARTS[name]
    if hand is None and side and len(figure.hands) == 1 and not figure.hands[0].side:
        hand = figure.hands[0]  # MANO is one hand, whatever its side is called
    first = f"{side}_index1" if side else "index1"
    if hand is None and len(values) == 45 and first in skeleton.names:
        start = skeleton.names.index(first)
        _turn(figure, pose, np.arange(start, start + 15, dtype=np.int32), values)
        return []
    if hand is None:
        if values.any():
            return [f"{name}: {figure.name} has no hand components, left out"]
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
    assert figure.skeleton is not None  # the callers looked
    rotations = rotation_vector_to_matrix(numbers.reshape(-1, 3))
    set_joint_rotations(figure.skeleton, pose, joints, rotations)
