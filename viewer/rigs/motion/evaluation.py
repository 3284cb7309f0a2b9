"""Evaluation of motions: poses at one time, and of one figure at many times as arrays.

Motions are sampled for both: ``Samples`` replace values of several poses, or of one pose in all
frames. ``pose_actors`` (``viewer.rigs.scene``) does the first for the actors of a scene.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Bools, Floats, Ints, span
from viewer.rigs.constraints.evaluation import constrained
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.geometry.quaternion import multiply
from viewer.rigs.geometry.rotation import matrix_to_quaternion, quaternion_to_matrix
from viewer.rigs.kinematics import joint_worlds
from viewer.rigs.motion.clip import Clip
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.samples import Samples, joint_samples
from viewer.rigs.motion.transform_clip import TransformClip
from viewer.rigs.pose import Pose, dof_rotations, joint_offsets, joint_rotations, rotate_joints
from viewer.rigs.shape import joint_shifts, moved_rest_translations, rest_joints
from viewer.rigs.skeleton import FIRST_ROTATION, Skeleton, clamp_dofs

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

    @property
    def arrays(self) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats]:
        """All arrays of the poses, in the order of ``SampledClip``."""
        places = self.figure_translations, self.figure_scales
        return self.rotations, self.translations, *places, self.shape_weights, self.scales


def set_poses(
    found: Samples, rows: NDArray[np.intp], skeleton: Skeleton, poses: Sequence[Pose]
) -> None:
    """Set some rows of samples in as many poses, in place."""
    dofs = np.stack([pose.dofs for pose in poses])
    parts = list[tuple[str, Ints | slice, Floats]]()
    if len(found.targets):
        dofs[:, found.targets] = found.dofs[rows]
    if len(found.rotated):
        turns = quaternion_to_matrix(found.rotations[rows])
        # Sliders keep to their limits; a motion is shown as it is, as exports write it.
        quaternions = rotate_joints(skeleton, dofs, found.rotated, turns, "quaternion")
        parts.append(("rotations", span(found.rotated), quaternions))
    elif len(found.targets):
        dofs = clamp_dofs(skeleton, dofs)
    if len(found.translated):
        offsets = _translate_joints(found, rows, skeleton, dofs)
        parts.append(("translations", span(found.translated), offsets))
    if len(found.scaled):
        parts.append(("scales", span(found.scaled), found.scales[rows]))
    if len(found.weighted):
        n_known = min(len(pose.shape_weights) for pose in poses)
        known = np.flatnonzero(found.weighted < n_known)
        weights = found.shape_weights[rows[:, None], known]
        parts.append(("shape_weights", span(found.weighted[known]), weights))
    parts.append(("dofs", slice(None), dofs))
    for name, columns, values in parts:
        for pose, row in zip(poses, values, strict=True):
            getattr(pose, name)[columns] = row
    for row, pose in zip(rows.tolist(), poses, strict=True):
        if found.figure_translations is not None:
            pose.figure_translation[:] = found.figure_translations[row]
        if found.figure_scales is not None:
            pose.figure_scale = float(found.figure_scales[row])


def _translate_joints(
    found: Samples, rows: NDArray[np.intp], skeleton: Skeleton, dofs: Floats
) -> Floats:
    """Set translation DOFs within their limits, in place; return what they leave: (T, N, 3)."""
    moves = np.flatnonzero(skeleton.dof_kinds < FIRST_ROTATION)
    if not len(moves):
        return found.translations[rows]
    moves = moves[np.isin(skeleton.dof_joints[moves], found.translated)]
    is_free = ~np.isin(moves, found.targets)
    free = moves[is_free]
    if not len(free) and not dofs[:, moves].any():
        return found.translations[rows]
    left = np.zeros((len(rows), skeleton.n_joints, 3))
    left[:, found.translated] = found.translations[rows]
    owners, axes = skeleton.dof_joints[moves], skeleton.dof_kinds[moves]
    # Of several DOFs along one axis, the first receives the offset.
    _, first = np.unique(owners * FIRST_ROTATION + axes, return_index=True)
    values = np.zeros((len(rows), len(moves)))
    values[:, first] = left[:, owners[first], axes[first]]
    dofs[:, free] = np.clip(values[:, is_free], *skeleton.dof_limits[free].T)
    by_joint = np.moveaxis(left, 0, -1)
    np.subtract.at(by_joint, (owners, axes), dofs[:, moves].T)
    return left[:, found.translated]


def frames_of(
    figure: Figure,
    motion: JointMotion,
    times: Floats,
    base: Pose | None = None,
    interpolate: bool = False,
) -> Frames:
    """Return a figure's poses at times (F,) of the motion's own clock.

    ``base`` provides what the motion does not set; the pose of the file if omitted.
    ``interpolate``: also across gaps. RigError without a skeleton, or if joint counts differ.
    """
    if figure.skeleton is None:
        raise RigError(f"figure {figure.name} has no skeleton to animate")
    if motion.timing is not None and motion.n_joints != figure.skeleton.n_joints:
        raise RigError(
            f"clip {motion.name} has {motion.n_joints} joints, but figure {figure.name} has "
            f"{figure.skeleton.n_joints}"
        )
    times = np.atleast_1d(np.asarray(times, dtype=np.float64))
    pose = figure_pose(figure) if base is None else base
    return _frames(figure, motion.sample(figure.skeleton, times, interpolate), times, pose)


def still_frames(
    figure: Figure, pose: Pose | None, is_present: bool = True, time: float = 0.0
) -> Frames:
    """Return one pose as frames; ``pose`` is None for a figure without a skeleton."""
    found, times = Samples(np.array([is_present])), np.array([time])
    if pose is not None and figure.skeleton is not None:
        return _frames(figure, found, times, pose)
    none, weights = np.zeros((1, 0, 3)), np.zeros((1, figure.n_shapes))
    place, scale = np.zeros(3), 1.0
    if pose is not None:
        weights[0, : len(pose.shape_weights)] = pose.shape_weights
        place, scale = pose.figure_translation.copy(), pose.figure_scale
    turns = np.zeros((1, 0, 4))
    return Frames(times, found.present, turns, none, none, weights, place[None], np.array([scale]))


def _frames(figure: Figure, found: Samples, times: Floats, pose: Pose) -> Frames:
    """Return a pose at many times, with the values of samples in place of its own."""
    skeleton, count = figure.require_skeleton(), len(times)
    dofs, turns = pose.dofs[None], matrix_to_quaternion(joint_rotations(skeleton, pose))[None]
    is_whole = len(found.rotated) == len(found.translated) == skeleton.n_joints
    if len(found.targets) and not is_whole:
        dofs = np.tile(pose.dofs, (count, 1))
        dofs[:, found.targets] = found.dofs
        dofs = clamp_dofs(skeleton, dofs)
        beneath = pose.rotations / np.linalg.norm(pose.rotations, axis=-1, keepdims=True)
        turns = multiply(beneath, matrix_to_quaternion(dof_rotations(skeleton, dofs)))
    offsets = joint_offsets(skeleton, dofs, pose.translations[None])
    own, last = pose.shape_weights, int(found.weighted.max(initial=-1))
    # Missing weights are treated as 0.
    weights = np.zeros((1, max(len(own), last + 1, figure.n_shapes)))
    weights[0, : len(own)] = own
    places, sizes = found.figure_translations, found.figure_scales
    frames = Frames(
        times,
        found.present,
        _repeated(_set(turns, found.rotated, found.rotations, count), count),
        _repeated(_set(offsets, found.translated, found.translations, count), count),
        _shared(_set(pose.scales[None].copy(), found.scaled, found.scales, count)),
        _shared(_set(weights, found.weighted, found.shape_weights, count)),
        np.tile(pose.figure_translation, (count, 1)) if places is None else places,
        np.full(count, pose.figure_scale) if sizes is None else sizes,
    )
    return _constrained(figure, frames)


def _set(rows: Floats, columns: Ints, values: Floats, count: int) -> Floats:
    """Return rows with other values in some columns; values of all columns are not copied."""
    if not len(columns):
        return rows
    if np.array_equal(columns, np.arange(rows.shape[1])):
        return values
    rows = _repeated(rows, count)
    rows[:, columns] = values
    return rows


def _repeated(rows: Floats, count: int) -> Floats:
    return rows if len(rows) == count else np.repeat(rows, count, axis=0)


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


def pose_of(figure: Figure, frames: Frames, frame: int) -> Pose:
    """Return one frame as a separate pose."""
    pose, part = figure_pose(figure), frames_between(frames, slice(frame, frame + 1))
    skeleton = figure.require_skeleton()
    found = joint_samples(
        skeleton,
        part.present,
        *part.arrays,
    )
    set_poses(found, np.zeros(1, dtype=np.intp), skeleton, [pose])
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


def root_translations(skeleton: Skeleton, frames: Frames) -> Floats:
    """Return the translations of the figure, and of its root if there is only one: (F, 3)."""
    roots = np.flatnonzero(skeleton.parents < 0)
    if len(roots) != 1:
        return frames.figure_translations
    own: Floats = frames.figure_scales[:, None] * frames.translations[:, roots[0]]
    return frames.figure_translations + own


def world_frames(figure: Figure, frames: Frames) -> Floats:
    """Return world matrices of all frames (F, J, 4, 4), with the figure's own scale and place."""
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
