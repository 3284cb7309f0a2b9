"""Names and values of the curves of a motion, for plotting."""

from __future__ import annotations

from functools import partial

import numpy as np

from viewer.data_classes import dataclass
from viewer.phrases import printable
from viewer.rigs.arrays import Floats
from viewer.rigs.blendshapes import BlendShapes
from viewer.rigs.captures.points import PointClip
from viewer.rigs.geometry.rotation import matrix_to_euler, quaternion_to_matrix
from viewer.rigs.memo import Memo
from viewer.rigs.motion.clip import Channel, Clip, evaluate_all
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.transform_clip import TransformClip
from viewer.rigs.scene import Actor
from viewer.rigs.skeleton import DOF_KINDS, FIRST_ROTATION, Skeleton, joint_labels, shown_joints
from viewer.rigs.transform_keys.euler_curves import rows_of

_AXES = "xyz"
_PREFIXES = {"translation": "t", "rotation": "", "scale": "s"}
_SHAPES, _SHAPE_NUMBER = "shapes", -2  # heading of the curves of blend shapes
_FIGURE = "figure"  # heading of the curves of the whole figure, as in the Joints panel
_MOST_POINTS = 2000
_PAGE = 500  # frames by which the visible part of a long motion advances

Points = tuple[Floats, Floats]


@dataclass(frozen=True, slots=True)
class Curve:
    """A curve of the plot, as an entry of the list."""

    group: str
    """Name of the joint or keypoint, used as heading."""
    number: int
    """Index of the joint or keypoint; -1 for the whole figure, -2 for blend shapes."""
    name: str
    """Name of the channel: ``"x"``, ``"ty"``, ``"sz"`` …, or of a blend shape."""
    axis: int
    """0 to 2 for x, y, z."""
    is_angle: bool
    """Whether the values are radians."""

    @property
    def label(self) -> str:
        """Name of joint and axis."""
        return f"{self.group}.{self.name}"

    @property
    def is_length(self) -> bool:
        """Whether the values have the figure's unit of length."""
        is_scale = self.name.startswith(_PREFIXES["scale"])
        return not (self.is_angle or is_scale or self.number == _SHAPE_NUMBER)


_of_skeleton: Memo[Skeleton, tuple[Curve, ...]] = Memo(kept=2)
_of_transforms: Memo[TransformClip, tuple[Curve, ...]] = Memo()
_points: Memo[SampledClip | PointClip, Points] = Memo(kept=64)
_parts: Memo[Clip, Clip] = Memo(kept=2)


def curves_of(actor: Actor) -> tuple[Curve, ...]:
    """Return the curves of an actor's motion; a row is an index into them.

    A keyed clip has a curve per DOF; keyed transforms have those of ``rows_of``. A sampled
    animation has the figure's position and each joint's angles about x, y and z (R = Rz Ry Rx);
    captured points have their coordinates.
    """
    skeleton, clip = actor.figure.skeleton, actor.clip
    if clip is not None and clip.kind == "points":
        points = actor.figure.points
        return tuple(
            Curve(printable(name, 60), number, _AXES[axis], axis, False)
            for number, name in enumerate(() if points is None else points.names)
            for axis in range(3)
        )
    if skeleton is None:
        return ()
    if actor.transforms is not None:
        make = partial(_transform_curves, actor, actor.transforms)
        return _of_transforms.get(actor.transforms, id(skeleton), make)
    if actor.captured is not None:
        return _of_skeleton.get(skeleton, "frames", lambda: _joint_curves(skeleton))
    return _of_skeleton.get(skeleton, "keys", lambda: _dof_curves(skeleton))


def _transform_curves(actor: Actor, clip: TransformClip) -> tuple[Curve, ...]:
    skeleton, shapes = actor.figure.require_skeleton(), actor.figure.blend_shapes
    labels = [printable(label, 60) for label in joint_labels(skeleton)]
    return tuple(
        Curve(labels[row.joint], row.joint, _PREFIXES[row.path] + _AXES[row.component],
              row.component, row.path == "rotation")
        if row.path != "weights"
        else Curve(_SHAPES, _SHAPE_NUMBER, printable(_shape_name(shapes, row.shape), 60),
                   row.component % 3, False)
        for row in rows_of(clip, skeleton)
    )  # fmt: skip


def _shape_name(shapes: BlendShapes | None, shape: int) -> str:
    return f"shape {shape}" if shapes is None else shapes.names[shape]


def _dof_curves(skeleton: Skeleton) -> tuple[Curve, ...]:
    labels = [printable(label, 60) for label in joint_labels(skeleton)]
    return tuple(
        Curve(labels[joint], joint, DOF_KINDS[kind], kind % 3, kind >= FIRST_ROTATION)
        for joint, kind in zip(
            skeleton.dof_joints.tolist(), skeleton.dof_kinds.tolist(), strict=True
        )
    )


def _joint_curves(skeleton: Skeleton) -> tuple[Curve, ...]:
    groups = [(_FIGURE, -1, False)]
    labels = joint_labels(skeleton)
    groups += [(printable(labels[j], 60), j, True) for j in shown_joints(skeleton).tolist()]
    return tuple(
        Curve(group, number, _AXES[axis], axis, is_angle)
        for group, number, is_angle in groups
        for axis in range(3)
    )


def channel_of(clip: Clip, row: int) -> Channel | None:
    """Return the channel that drives a DOF, None if there is none."""
    # Files usually list a channel for every DOF, in the same order.
    if row < len(clip.channels) and clip.channels[row].target == row:
        return clip.channels[row]
    return next((channel for channel in clip.channels if channel.target == row), None)


def keyed_values(clip: Clip, rows: tuple[int, ...], times: Floats) -> Floats:
    """Return the values of curves of a clip at many times: (T, C); 0 without a channel."""

    def chosen() -> Clip:
        channels = (channel_of(clip, row) for row in rows)
        return Clip(clip.name, tuple(filter(None, channels)), clip.start, clip.end)

    targets, values = evaluate_all(_parts.get(clip, rows, chosen), times)
    result = np.zeros((len(times), len(rows)))
    for column, target in enumerate(targets.tolist()):
        result[:, rows.index(target)] = values[:, column]
    return result


def sampled_points(clip: SampledClip | PointClip, row: int, low: float, high: float) -> Points:
    """Return times and values (P,) of at most 2000 frames: NaN in gaps, angles without jumps."""
    timing = clip.timing
    first, step = 0, 1
    if timing.n_frames > _MOST_POINTS:
        seen = max((high - low) * timing.frame_rate, 1.0)
        # Steps are powers of two, so that zooming slightly keeps the same points.
        while step * (_MOST_POINTS - 2 * _PAGE) < min(seen, timing.n_frames):
            step *= 2
        page = step * _PAGE
        start = (low - timing.start) * timing.frame_rate
        first = int(np.clip(np.floor(start / page) * page, 0, timing.n_frames))
    return _points.get(clip, (row, first, step), lambda: _line(clip, row, first, step))


def _line(clip: SampledClip | PointClip, row: int, first: int, step: int) -> Points:
    timing = clip.timing
    frames = np.arange(first, min(first + step * _MOST_POINTS, timing.n_frames), step)
    rows = timing.rows[frames]
    present = rows >= 0
    values = np.full(len(frames), np.nan)
    if clip.points is not None:
        seen = clip.points[rows[present], row // 3]
        values[present] = np.where(seen[:, 3] > 0.0, seen[:, row % 3], np.nan)
    elif row < 3:
        values[present] = _places(clip, rows[present])[:, row]
    else:
        joint, axis = divmod(row - 3, 3)
        angles = matrix_to_euler(quaternion_to_matrix(clip.rotations[rows[present], joint]))
        values[present] = np.unwrap(angles[:, axis])
    return timing.start + frames / timing.frame_rate, values


def _places(clip: SampledClip, rows: np.ndarray) -> Floats:
    """Return the position of the whole figure, including the root's translation: (N, 3)."""
    places = np.zeros((len(rows), 3))
    if clip.figure_translations is not None:
        places += clip.figure_translations[rows]
    if clip.translations is not None:
        places += clip.translations[rows, 0]
    return places
