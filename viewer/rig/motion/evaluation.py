"""Evaluation of motions: posing of a single actor, and many frames of one actor as arrays."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.captures.points import PointClip, sample_points
from viewer.rig.constraints.evaluation import constrained
from viewer.rig.figure import Figure
from viewer.rig.geometry.quaternion import multiply
from viewer.rig.geometry.rotation import matrix_to_quaternion, quaternion_to_matrix
from viewer.rig.kinematics import joint_worlds
from viewer.rig.motion.clip import Clip, evaluate_all, sample
from viewer.rig.motion.sampled_clip import SampledClip, SampledRows, sample_rows
from viewer.rig.motion.timing import DEFAULT_RATE
from viewer.rig.motion.transform_clip import TransformClip
from viewer.rig.pose import Pose, dof_rotations, joint_rotations, local_matrices
from viewer.rig.posing.pose_vector import set_joint_rotations
from viewer.rig.scene import Actor, Motion, figure_pose
from viewer.rig.shape import joint_shifts, moved_rest_translations, rest_joints
from viewer.rig.skeleton import FIRST_ROTATION, Skeleton
from viewer.rig.transform_keys.rate import key_rate
from viewer.rig.transform_keys.sampling import apply_transforms, sample_transforms

JointMotion: TypeAlias = Clip | TransformClip | SampledClip
"""A motion that poses a skeleton rather than captured points."""


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """Many poses of one figure, in time order."""

    times: Floats
    """(F,). Seconds."""
    present: Bools
    """(F,) bool. Whether the actor is present; otherwise the row is undefined in the other
    arrays."""
    rotations: Floats
    """(F, J, 4). Each joint's complete rotation relative to its parent: unit quaternions (x, y, z,
    w)."""
    translations: Floats
    """(F, J, 3). Offsets from the joints' rest translations, DOFs included."""
    scales: Floats
    """(F, J, 3) or (1, J, 3). Local scale factors of the joints; a single row applies to all
    frames."""
    shape_weights: Floats
    """(F, S) or (1, S). Weights of the figure's blend shapes; a single row applies to all
    frames."""
    figure_translations: Floats
    figure_scales: Floats
    """(F, 3), (F,). Placement of the whole figure."""

    @property
    def n_frames(self) -> int:
        """Number of frames, F."""
        return len(self.times)


def time_span(actors: Iterable[Actor]) -> tuple[float, float]:
    """Return the seconds from the earliest start to the latest end of all clips."""
    spans = [
        (actor.clip.start + actor.offset, actor.clip.end + actor.offset)
        for actor in actors
        if actor.clip is not None
    ]
    return min((low for low, _ in spans), default=0.0), max(
        (high for _, high in spans), default=0.0
    )


def frame_rate(motion: Motion | None) -> float:
    """Return a motion's frames per second.

    Keyed transforms have the rate of their keys, DOF curves have ``DEFAULT_RATE``.
    """
    if isinstance(motion, TransformClip):
        return key_rate(motion)
    return motion.timing.frame_rate if isinstance(motion, SampledClip | PointClip) else DEFAULT_RATE


def scene_rate(actors: Iterable[Actor]) -> float:
    """Return the frames per second of a scene's timeline.

    This is the rate of its longest capture or, without captures, of its longest motion of keyed
    transforms.
    """
    clips = [actor.clip for actor in actors if actor.clip is not None]
    for kinds in ((SampledClip, PointClip), (TransformClip,)):
        own = [clip for clip in clips if isinstance(clip, kinds)]
        if own:
            return frame_rate(max(own, key=lambda clip: clip.end - clip.start))
    return DEFAULT_RATE


def pose_actor(actor: Actor, time: float, interpolate: bool = False) -> None:
    """Pose an actor by its clip at one time of the scene's clock, in place.

    ``actor``: actor whose ``pose``, ``points`` and ``is_present`` are modified, unless it has no
    clip. ``time``: seconds; the actor's own ``offset`` is subtracted. ``interpolate``: interpolate
    across gaps of captures instead of marking the actor as absent.
    """
    clip, skeleton, own = actor.clip, actor.figure.skeleton, time - actor.offset
    if isinstance(clip, PointClip):
        actor.points = sample_points(clip, own, interpolate)
        actor.is_present = actor.points is not None
    elif isinstance(clip, SampledClip) and skeleton is not None and actor.pose is not None:
        rows = sample_rows(clip, np.array([own]), interpolate)
        actor.is_present = bool(rows.present[0])
        if actor.is_present:
            _apply(rows, 0, skeleton, actor.pose)
    elif isinstance(clip, Clip) and skeleton is not None and actor.pose is not None:
        sample(clip, skeleton, own, out=actor.pose)
    elif isinstance(clip, TransformClip) and skeleton is not None and actor.pose is not None:
        apply_transforms(sample_transforms(clip, np.array([own])), 0, skeleton, actor.pose)
    if actor.springs is not None and actor.is_present:
        actor.springs.swing(actor, own)


def _apply(rows: SampledRows, row: int, skeleton: Skeleton, pose: Pose) -> None:
    joints: Ints = np.arange(skeleton.n_joints, dtype=np.int32)
    moves = skeleton.dof_kinds < FIRST_ROTATION
    pose.dofs[moves] = np.clip(0.0, *skeleton.dof_limits[moves].T)
    set_joint_rotations(skeleton, pose, joints, quaternion_to_matrix(rows.rotations[row]))
    place_pose(pose, rows, row)


def place_pose(pose: Pose, rows: SampledRows, row: int) -> None:
    """Apply a clip's data at one time, except joint rotations, to a pose in place."""
    if rows.translations is not None:
        pose.translations[:] = rows.translations[row]
    if rows.scales is not None:
        pose.scales[:] = rows.scales[row]
    if rows.figure_translations is not None:
        pose.figure_translation[:] = rows.figure_translations[row]
    if rows.figure_scales is not None:
        pose.figure_scale = float(rows.figure_scales[row])
    if rows.shape_weights is not None:
        count = min(len(pose.shape_weights), rows.shape_weights.shape[1])
        pose.shape_weights[:count] = rows.shape_weights[row, :count]


def frames_of(
    figure: Figure,
    motion: JointMotion,
    times: Floats,
    base: Pose | None = None,
    interpolate: bool = False,
) -> Frames:
    """Return a figure's poses at many times.

    ``times``: (F,), seconds on the motion's own clock. ``base``: provides shape and placement if
    the motion has none; the values in the file if omitted. Raises ``RigError`` if the figure has no
    skeleton, or the joint counts differ.
    """
    skeleton = figure.skeleton
    if skeleton is None:
        raise RigError(f"figure {figure.name} has no skeleton to animate")
    times = np.atleast_1d(np.asarray(times, dtype=np.float64))
    pose = figure_pose(figure) if base is None else base
    if isinstance(motion, Clip):
        return _constrained(figure, _keyed_frames(skeleton, motion, times, pose))
    if isinstance(motion, TransformClip):
        return _constrained(figure, _transform_frames(skeleton, motion, times, pose))
    if motion.n_joints != skeleton.n_joints:
        raise RigError(
            f"clip {motion.name} has {motion.n_joints} joints, but figure {figure.name} has "
            f"{skeleton.n_joints}"
        )
    rows, count = sample_rows(motion, times, interpolate), len(times)
    still = np.zeros((count, skeleton.n_joints, 3))
    place = np.tile(pose.figure_translation, (count, 1))
    weights = pose.shape_weights[None] if rows.shape_weights is None else rows.shape_weights
    scales = np.full(count, pose.figure_scale)
    found = Frames(
        times,
        rows.present,
        rows.rotations,
        still if rows.translations is None else rows.translations,
        _shared(pose.scales[None].copy() if rows.scales is None else rows.scales),
        _shared(weights),
        place if rows.figure_translations is None else rows.figure_translations,
        scales if rows.figure_scales is None else rows.figure_scales,
    )
    return _constrained(figure, found)


def _constrained(figure: Figure, frames: Frames) -> Frames:
    """Return the frames with constraints applied: joints follow their sources."""
    skeleton = figure.require_skeleton()
    if not skeleton.constraints:
        return frames
    places = rest_translations_of(figure, frames.shape_weights) + frames.translations
    # Rows of frames in which nobody is present may be zeros.
    lengths = np.linalg.norm(frames.rotations, axis=-1, keepdims=True)
    turns = frames.rotations / np.where(lengths > 0.0, lengths, 1.0)
    first = (np.swapaxes(rows, 0, 1) for rows in (turns, places, frames.scales))
    return replace(frames, rotations=np.swapaxes(constrained(skeleton, *first), 0, 1))


def _shared(rows: Floats) -> Floats:
    """Return a single row if all rows are equal."""
    return rows[:1] if len(rows) > 1 and (rows == rows[0]).all() else rows


def _keyed_frames(skeleton: Skeleton, clip: Clip, times: Floats, pose: Pose) -> Frames:
    count = len(times)
    targets, values = evaluate_all(clip, times)
    dofs = np.tile(pose.dofs, (count, 1))
    dofs[:, targets] = values
    dofs = np.clip(dofs, *skeleton.dof_limits.T)
    beneath = pose.rotations / np.linalg.norm(pose.rotations, axis=-1, keepdims=True)
    rotations = multiply(beneath, matrix_to_quaternion(dof_rotations(skeleton, dofs)))
    translations = np.tile(pose.translations, (count, 1, 1))
    for dof in np.flatnonzero(skeleton.dof_kinds < FIRST_ROTATION):
        translations[:, skeleton.dof_joints[dof], skeleton.dof_kinds[dof]] += dofs[:, dof]
    return Frames(
        times,
        np.ones(count, dtype=np.bool_),
        rotations,
        translations,
        pose.scales[None].copy(),
        pose.shape_weights[None].copy(),
        np.tile(pose.figure_translation, (count, 1)),
        np.full(count, pose.figure_scale),
    )


def _transform_frames(skeleton: Skeleton, clip: TransformClip, times: Floats, pose: Pose) -> Frames:
    count, found = len(times), sample_transforms(clip, times)
    rotations = np.tile(matrix_to_quaternion(joint_rotations(skeleton, pose)), (count, 1, 1))
    rotations[:, found.rotated] = found.rotations
    still = local_matrices(skeleton, pose)[:, :3, 3] - skeleton.rest_translations
    translations = np.tile(still, (count, 1, 1))
    moved = skeleton.rest_translations[found.translated]
    translations[:, found.translated] = found.translations - moved
    scales, weights = pose.scales[None].copy(), pose.shape_weights[None].copy()
    if len(found.scaled):
        scales = np.tile(scales, (count, 1, 1))
        scales[:, found.scaled] = found.scales
    if len(found.weighted):
        weights = np.tile(weights, (count, 1))
        weights[:, found.weighted] = found.weights
    return Frames(
        times,
        np.ones(count, dtype=np.bool_),
        rotations,
        translations,
        _shared(scales),
        _shared(weights),
        np.tile(pose.figure_translation, (count, 1)),
        np.full(count, pose.figure_scale),
    )


def pose_of(figure: Figure, frames: Frames, frame: int) -> Pose:
    """Return one frame as a separate pose."""
    pose = figure_pose(figure)
    row = SampledRows(
        frames.present,
        frames.rotations,
        frames.translations,
        frames.figure_translations,
        frames.figure_scales,
        np.broadcast_to(frames.shape_weights, (frames.n_frames, frames.shape_weights.shape[1])),
        np.broadcast_to(frames.scales, frames.translations.shape),
    )
    _apply(row, frame, figure.require_skeleton(), pose)
    return pose


def frames_between(frames: Frames, rows: slice | NDArray[np.intp]) -> Frames:
    """Return some of the frames; scales or a shape shared by all frames remain a single row."""
    weights, scales = frames.shape_weights, frames.scales
    return Frames(
        frames.times[rows],
        frames.present[rows],
        frames.rotations[rows],
        frames.translations[rows],
        scales if len(scales) == 1 else scales[rows],
        weights if len(weights) == 1 else weights[rows],
        frames.figure_translations[rows],
        frames.figure_scales[rows],
    )


def world_frames(figure: Figure, frames: Frames) -> Floats:
    """Return every joint's world matrix in every frame; all frames are computed together.

    Returns (F, J, 4, 4), joint space to figure space, including the figure's own scale and
    translation.
    """
    skeleton = figure.require_skeleton()
    frames = _constrained(figure, frames)
    linear = quaternion_to_matrix(frames.rotations)
    if (frames.scales != 1.0).any():
        linear *= frames.scales[:, :, None, :]
    offsets = rest_translations_of(figure, frames.shape_weights) + frames.translations
    world = joint_worlds(skeleton.parents, linear, offsets)
    if (frames.figure_scales != 1.0).any():
        world[..., :3, :] *= frames.figure_scales[:, None, None, None]
    world[..., :3, 3] += frames.figure_translations[:, None]
    return world


def rest_translations_of(figure: Figure, shape_weights: Floats) -> Floats:
    """Return the rest translations for many shapes: (F, J, 3) for weights (F, S)."""
    skeleton = figure.require_skeleton()
    if not shape_weights.any():
        return skeleton.rest_translations[None]
    shifts = joint_shifts(figure, shape_weights)
    return moved_rest_translations(skeleton, rest_joints(figure) + shifts)


def joint_positions(figure: Figure, frames: Frames) -> Floats:
    """Return the joints' positions in every frame, as ``world_frames`` does, but faster.

    For a joint with the rotation R and translation t, whose parent has the world rotation Q and the
    position p, these are Q R and p + Q t. The frames are the last axis, so that few operations
    multiply the matrices of all frames.

    Returns (F, J, 3), positions in figure space, including the figure's own scale and translation.
    """
    skeleton = figure.require_skeleton()
    if skeleton.constraints or (frames.scales != 1.0).any():
        return world_frames(figure, frames)[..., :3, 3]
    offsets = rest_translations_of(figure, frames.shape_weights) + frames.translations
    world = _rigid_matrices(frames.rotations, offsets)
    terms = np.empty((3, *world.shape[1:]))  # row, summed axis, column, frame
    for joint, parent in enumerate(skeleton.parents.tolist()):
        if parent >= 0:
            above = world[parent]
            np.multiply(above[:, :3, None], world[joint], out=terms)
            np.add.reduce(terms, axis=1, out=world[joint])
            world[joint, :, 3] += above[:, 3]
    positions = world[:, :, 3].transpose(2, 0, 1) * frames.figure_scales[:, None, None]
    return np.asarray(positions + frames.figure_translations[:, None])


def _rigid_matrices(rotations: Floats, offsets: Floats) -> Floats:
    """Return the matrices of rotations (F, J, 4) and translations (F, J, 3): (J, 3, 4, F)."""
    x, y, z, w = np.ascontiguousarray(rotations.transpose(2, 1, 0))
    scale = 2.0 / (x * x + y * y + z * z + w * w)
    found = np.empty((len(x), 3, 4, x.shape[1]))
    a, b, c, w = scale * x, scale * y, scale * z, scale * w
    for axis, square in enumerate((b * y + c * z, a * x + c * z, a * x + b * y)):
        np.subtract(1.0, square, out=found[:, axis, axis])
    for row, column, product, turn in (
        (0, 1, a * y, w * z),
        (2, 0, a * z, w * y),
        (1, 2, b * z, w * x),
    ):
        np.subtract(product, turn, out=found[:, row, column])
        np.add(product, turn, out=found[:, column, row])
    found[:, :, 3] = offsets.transpose(1, 2, 0)
    return found
