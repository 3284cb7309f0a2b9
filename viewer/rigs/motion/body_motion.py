"""Motions of a body as the parameters of its model, and their conversion to clips of a figure.

``BodyMotion`` holds the rotation vectors and coefficients of the SMPL family, ``ParameterMotion``
the model parameters of MHR.
"""

from __future__ import annotations

from dataclasses import field, replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, note
from viewer.errors import RigError
from viewer.phrases import counted, listed
from viewer.rigs.arrays import Floats, freeze, freeze_fields
from viewer.rigs.bodies.smpl_family import ShapeSpace
from viewer.rigs.coefficients import apply_coefficients, space_misfit, unused_coefficients
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.geometry.quaternion import multiply, rotation_vector_to_quaternion
from viewer.rigs.geometry.rotation import matrix_to_quaternion, quaternion_to_matrix
from viewer.rigs.geometry.vectors import StatedUp
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.pose import Pose, joint_rotations, local_matrices
from viewer.rigs.shape import joint_shifts, rest_joints
from viewer.rigs.units import METRES


@dataclass(frozen=True, slots=True, eq=False)
class BodyMotion:
    """One person's rotation vectors by joint name, with translation, shape and hands."""

    name: str
    """Display name."""
    timing: Timing
    """Frame rate, and the row of each frame."""
    joint_names: tuple[str, ...]
    """Joints that ``vectors`` rotate, the root first."""
    vectors: Floats
    """(N, K, 3). Rotation vectors relative to the parent joint, radians."""
    translations: Floats
    """(N, 3). Translation of the body, metres."""
    about_origin: bool = False
    """True: the root rotates about the figure's origin, V = R X + T, as in EasyMocap. False: about
    the rest pelvis, V = R (X - J0) + J0 + T, as in SMPL."""
    shape: Floats | None = None
    expression: Floats | None = None
    """(N, S) or (1, S) or None. Coefficients; a single row applies to all frames."""
    hands: dict[str, Floats] = field(default_factory=dict)
    """mapping of "left", "right" or "" to (N, C). Coefficients of the hands' principal components,
    instead of finger joints."""
    flat_hands: bool = False
    """Whether ``hands`` are relative to the flat hand instead of the mean hand."""
    up: StatedUp = ""
    """World up axis; empty if unknown."""
    shape_space: ShapeSpace = ShapeSpace()
    """Model and gender of the body, as stated by the file."""
    world_rotations: Floats | None = None
    """(N, 3) or None. Rotation vectors that rotate the whole body about the figure's origin after
    ``vectors`` have posed it, V = W (R (X - J0) + J0) + T; requires ``about_origin`` to be
    False."""
    places_root: bool = False
    """Whether ``translations`` are the positions of the root joint, V = R (X - J0) + T; requires
    ``about_origin`` to be False and no ``world_rotations``."""

    def __post_init__(self) -> None:
        freeze_fields(self, vectors=(None, len(self.joint_names), 3))
        count = len(self.vectors)
        freeze_fields(self, translations=(count, 3), shape=(None, None), expression=(None, None))
        freeze_fields(self, world_rotations=(count, 3))

    @property
    def n_rows(self) -> int:
        """Number of frames with data, N."""
        return len(self.vectors)


@dataclass(frozen=True, slots=True, eq=False)
class ParameterMotion:
    """Model parameters of one person over time, as SAM 3D Body stores them for MHR."""

    name: str
    """Display name."""
    timing: Timing
    """Frame rate, and the row of each frame."""
    parameters: Floats
    """(N, P). ``mhr_model_params``: placement, pose and scales."""
    identity: Floats
    expression: Floats
    """(N, S), (N, E). ``shape_params`` and ``expr_params``."""
    places: Floats
    """(N, 3). Translations of the whole figure, metres."""

    def __post_init__(self) -> None:
        count = len(self.parameters)
        freeze_fields(self, parameters=(count, None), identity=(count, None))
        freeze_fields(self, expression=(count, None), places=(count, 3))


def body_clip(motion: BodyMotion, figure: Figure) -> tuple[SampledClip, list[Diagnostic]]:
    """Return a clip of a figure with the family's joint names, and notes about data not used.

    RigError if the figure has none of the joints; those without a vector stay at rest.
    """
    # The root of the file's model, to which its translations belong, relative to the figure's.
    offset = np.array(figure.shape_space.root_offset(motion.shape_space))
    motion, said = _in_space_of(motion, figure)
    skeleton = figure.skeleton
    if skeleton is None or motion.joint_names[0] not in skeleton.names:
        joint = motion.joint_names[0]
        names = {"motion": motion.name, "joint": joint, "figure": figure.name}
        raise RigError(
            note(
                "F004.body-joint: {motion} moves the joint {joint}, which {figure} does not have",
                **names,
            )
        )
    vectors: dict[int, Floats] = {}  # of each joint that moves
    lost = []
    for column, name in enumerate(motion.joint_names):
        if name in skeleton.names:
            vectors[skeleton.names.index(name)] = motion.vectors[:, column]
        elif motion.vectors[:, column].any():
            lost.append(name)
    notes = said + _put_hands(motion, figure, vectors)
    if lost:
        values = {"n": counted(len(lost), "joint"), "figure": figure.name, "names": listed(lost)}
        notes.append(
            note("F007.joints-left-out: {n} missing from {figure} omitted: {names}", **values)
        )
    weights, more = _weights(motion, figure)
    # One joint at a time, because long motions fill much of the memory.
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (motion.n_rows, skeleton.n_joints, 1))
    for row, turned in vectors.items():
        rotations[:, row] = rotation_vector_to_quaternion(turned)
    translations, origin_rotations = motion.translations, None
    if motion.world_rotations is not None:
        origin_rotations = rotation_vector_to_quaternion(motion.world_rotations)
        rotations[:, 0] = multiply(origin_rotations, rotations[:, 0])
    elif motion.about_origin:
        origin_rotations = rotations[:, 0]
    elif motion.places_root:
        translations = translations - root_positions(figure, weights)
    else:
        translations = translations + offset
    if origin_rotations is not None:
        # t = T - J0 + R J0: skinning rotates about the rest root J0 of the frame's own shape, the
        # file about the origin, so the vertices are exactly R X + T. A rotation W of the whole
        # world adds to the root's: W R, and t = T - J0 + W J0. The rotated J0 is that of the file.
        root = root_positions(figure, weights)
        matrices = quaternion_to_matrix(origin_rotations)
        rotated_roots = np.einsum("nab,nb->na", matrices, root + offset + 0.0 * translations)
        translations = translations - root + rotated_roots
    clip = SampledClip(
        motion.name,
        motion.timing,
        freeze(rotations),
        figure_translations=translations,
        shape_weights=weights,
    )
    return clip, notes + more


def parameter_clip(motion: ParameterMotion, figure: Figure) -> SampledClip:
    """Return a clip in metres; RigError unless the figure has these model parameters."""
    if len(motion.parameters) == 0:
        raise RigError("expected model parameters of at least one frame")
    skeleton = figure.require_skeleton()
    rows = zip(motion.parameters, motion.identity, motion.expression, strict=True)
    poses = [parameter_pose(figure, *row) for row in rows]
    rotations = np.stack([joint_rotations(skeleton, pose) for pose in poses])
    still = skeleton.rest_translations
    moves = np.stack([local_matrices(skeleton, pose)[:, :3, 3] - still for pose in poses])
    return SampledClip(
        motion.name,
        motion.timing,
        matrix_to_quaternion(rotations),
        translations=moves,
        figure_translations=motion.places,
        figure_scales=np.full(len(poses), METRES.get(figure.unit, 1.0)),
        shape_weights=np.stack([pose.shape_weights for pose in poses]),
        scales=np.stack([pose.scales for pose in poses]),
    )


def parameter_pose(
    figure: Figure, parameters: Floats, identity: Floats, expression: Floats
) -> Pose:
    """Return the pose that SAM 3D Body stores for MHR: its points are 0.01 (x, -y, -z) of ours.

    ``parameters`` (P,): placement, pose, scales; ``identity``, ``expression``: missing ends are 0.
    RigError unless the figure has these model parameters.
    """
    if figure.parameters is None:
        raise RigError(f"figure {figure.name} has no model parameters")
    pose = figure_pose(figure)
    figure.parameters.apply(figure.require_skeleton(), pose, np.asarray(parameters, np.float64))
    for group, values in (("shape", identity), ("expression", expression)):
        apply_coefficients(group, np.asarray(values, np.float64), figure, pose, cut=False)
    return pose


def _in_space_of(motion: BodyMotion, figure: Figure) -> tuple[BodyMotion, list[Diagnostic]]:
    """Return a motion without coefficients that mean nothing to a figure, and a message."""
    misfit = space_misfit(motion.shape_space, figure)
    if misfit is None or misfit.key == "C019.gender":
        return motion, [misfit] if misfit else []
    parts = (motion.shape, motion.expression)
    is_lost = any(part is not None and part.any() for part in parts)
    return replace(motion, shape=None, expression=None), [misfit] if is_lost else []


def root_positions(figure: Figure, weights: Floats) -> Floats:
    """Return the rest position of the root joint of many shapes: (N, 3) for weights (N, S)."""
    return rest_joints(figure)[0] + joint_shifts(figure, weights)[:, 0]


def rest_roots(figure: Figure, shape: Floats | None) -> Floats:
    """Return the rest position of the root joint for shape coefficients (N, S): (N, 3)."""
    groups = figure.blend_shapes.groups if figure.blend_shapes else ()
    weights = np.zeros((1 if shape is None else len(shape), len(groups)))
    if shape is not None:
        columns = [index for index, name in enumerate(groups) if name == "shape"]
        used = min(len(columns), shape.shape[1])
        weights[:, columns[:used]] = shape[:, :used]
    return root_positions(figure, weights)


def _put_hands(motion: BodyMotion, figure: Figure, vectors: dict[int, Floats]) -> list[Diagnostic]:
    """Add the fingers' rotation vectors by joint; return messages about omitted data."""
    notes: list[Diagnostic] = []
    known = {hand.side: hand for hand in figure.hands}
    for side, coefficients in motion.hands.items():
        hand = known.get(side) or (known.get("") if len(known) == 1 else None)
        if hand is None:
            if coefficients.any():
                values = {"side": side or "only", "figure": figure.name}
                notes.append(
                    note(
                        "F007.hand-left-out: {side} hand omitted: {figure} has no hand components",
                        **values,
                    )
                )
            continue
        used = min(coefficients.shape[1], len(hand.components))
        if coefficients[:, used:].any():
            values = {"most": used, "figure": figure.name}
            notes.append(
                note(
                    "F007.hand-components-left-out: hand components beyond the {most} of {figure} "
                    "omitted",
                    **values,
                )
            )
        fingers = coefficients[:, :used] @ hand.components[:used]
        if not motion.flat_hands:
            fingers = fingers + hand.mean
        fingers = fingers.reshape(len(fingers), -1, 3)
        vectors |= {int(joint): fingers[:, row] for row, joint in enumerate(hand.joints)}
    return notes


def _weights(motion: BodyMotion, figure: Figure) -> tuple[Floats, list[Diagnostic]]:
    """Return the blend shape weights of every frame, or one row if they are constant."""
    notes: list[Diagnostic] = []
    groups = figure.blend_shapes.groups if figure.blend_shapes else ()
    given = {"shape": motion.shape, "expression": motion.expression}
    rows = max([1, *(len(part) for part in given.values() if part is not None)])
    weights = np.zeros((rows, len(groups)))
    for group, values in given.items():
        if values is None:
            continue
        columns = [index for index, name in enumerate(groups) if name == group]
        used = min(len(columns), values.shape[1])
        weights[:, columns[:used]] = values[:, :used]
        notes += unused_coefficients(group, values, len(columns), figure.name)
    return weights, notes
