"""Joint marks drawn over the image (X-ray bones, axes, names), and the joint at a pixel."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from viewer.data_classes import dataclass
from viewer.phrases import printable
from viewer.rendering.colors import joint_colors
from viewer.rendering.options import DisplayOptions
from viewer.rendering.overlay.annotation import LABEL_COLOR, Annotation, Labels
from viewer.rendering.overlay.segments import Segments, SegmentStyle, dots, joined
from viewer.rendering.projection import picture_scale, project, project_segments
from viewer.rendering.view import View
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.kinematics import posed_skeleton
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.pose import placement_matrix
from viewer.rigs.scene import Actor
from viewer.rigs.shape import shaped_skeleton
from viewer.rigs.skeleton import Skeleton, joint_labels, shown_joints, shown_parents
from viewer.rigs.srgb import encode_srgb

HIGHLIGHT = (1.0, 0.77, 0.16, 1.0)
"""Colour of the selected joint, sRGB and opacity."""

_AXIS_COLORS = ((0.95, 0.36, 0.33), (0.42, 0.83, 0.36), (0.36, 0.58, 1.0))  # x, y, z; sRGB
_AXIS_FRACTION = 0.4  # length of axes, as a fraction of the distance to the nearest connected joint
# Minimum and maximum length of axes, as fractions of the skeleton's size.
_AXIS_LIMITS = 0.005, 0.05
_DOT, _BONE, _AXIS = 7.0, 3.0, 2.0  # diameter and widths in an image of standard height, pixels
_OUTLINE = 2.0
_DARK = (0.05, 0.06, 0.08, 0.85)
_DOT_REACH, _BONE_REACH = 8.0, 4.0  # maximum distances from the pointer, pixels
_LONGEST_NAME = 40  # maximum number of characters of a name
_LATE_RANK = 1000  # rank of unselected joints, so that other labels take precedence


def joint_annotation(
    actors: Sequence[Actor],
    options: DisplayOptions,
    size: tuple[int, int],
    selected: tuple[int, int],
) -> Annotation | None:
    """Return the marks at the joints of all actors; None if there are no joints."""
    marks, scale = joint_marks_of(actors), picture_scale(size)
    parts: list[Segments] = []
    for one in marks:  # the topmost last
        joint = selected[1] if one.actor == selected[0] else -1
        if options.xray:
            parts.append(bone_segments(one, joint, scale))
        if options.joint_axes:
            parts.append(axis_segments(one, scale))
        parts += joint_dots(one, joint, scale)
    if not parts:
        return None
    labels = name_labels(marks, selected) if options.joint_names else None
    return Annotation(joined(parts), SegmentStyle(on_top=options.xray), labels)


@dataclass(frozen=True, slots=True, eq=False)
class JointMarks:
    """One actor's joints."""

    actor: int
    """Index in the scene."""
    skeleton: Skeleton
    """Skeleton of its figure."""
    matrices: Floats
    """(J, 4, 4). Matrices from joint space to scene space."""

    @property
    def points(self) -> Floats:
        """Positions of the joints, (J, 3), scene space."""
        return self.matrices[:, :3, 3]

    @property
    def bones(self) -> tuple[Ints, Ints]:
        """Shown joints with a parent, and their parents: (N,) and (N,)."""
        parents, shown = shown_parents(self.skeleton), shown_joints(self.skeleton)
        children = shown[parents[shown] >= 0]
        return children, parents[children]


def joint_marks_of(actors: Sequence[Actor]) -> list[JointMarks]:
    """Return the joints of all drawn actors that have a skeleton."""
    found = []
    for index, actor in enumerate(actors):
        skeleton, pose = actor.figure.skeleton, actor.own_pose
        if skeleton is None or pose is None or not actor.is_drawn:
            continue
        shape = shaped_skeleton(actor.figure, pose.shape_weights)
        placement = actor.placement @ placement_matrix(pose)
        matrices = placement @ posed_skeleton(shape, pose).world
        found.append(JointMarks(index, skeleton, matrices))
    return found


def bone_segments(marks: JointMarks, selected: int, scale: float) -> Segments:
    """Return a line from each parent to its child, in the colour of the parent's box."""
    points, (children, above) = marks.points, marks.bones
    colors = _colors(marks.skeleton, selected)[above]
    # A dark outline makes each bone visible on any background.
    starts = np.concatenate([points[above], points[above]])
    ends = np.concatenate([points[children], points[children]])
    dark = np.broadcast_to(_DARK, colors.shape)
    widths = np.full(2 * len(children), scale * _BONE)
    widths[: len(children)] += scale * _OUTLINE
    return Segments(starts, ends, np.concatenate([dark, colors]), widths)


def joint_dots(marks: JointMarks, selected: int, scale: float) -> list[Segments]:
    """Return a dark-rimmed dot at each joint; the parameters are those of ``bone_segments``."""
    shown = shown_joints(marks.skeleton)
    colors, points = _colors(marks.skeleton, selected)[shown], marks.points[shown]
    parts = [dots(points, np.array(_DARK), scale * (_DOT + _OUTLINE))]
    parts.append(dots(points, colors, scale * _DOT))
    if selected >= 0:
        chosen = marks.points[selected : selected + 1]
        parts.append(dots(chosen, np.array(_DARK), scale * (1.5 * _DOT + _OUTLINE)))
        parts.append(dots(chosen, np.array(HIGHLIGHT), scale * 1.5 * _DOT))
    return parts


def axis_segments(marks: JointMarks, scale: float) -> Segments:
    """Return the x, y and z axis of each joint: red, green, blue."""
    # Their length is a fraction of the distance to the nearest parent or child, so that the axes of
    # finger joints do not overlap.
    shown = shown_joints(marks.skeleton)
    points, count = marks.points[shown], len(shown)
    lengths = _axis_lengths(marks)[shown]
    axes = unit(np.swapaxes(marks.matrices[shown, :3, :3], 1, 2))
    starts = np.repeat(points[:, None], 3, axis=1)
    ends = starts + lengths[:, None, None] * axes
    colors = np.ones((count, 3, 4))
    colors[..., :3] = _AXIS_COLORS
    widths = np.full(3 * count, scale * _AXIS)
    return Segments(starts.reshape(-1, 3), ends.reshape(-1, 3), colors.reshape(-1, 4), widths)


def _axis_lengths(marks: JointMarks) -> Floats:
    """Return the length of each joint's axes: (J,), scene units."""
    points, (children, above) = marks.points, marks.bones
    size = box_size(bounding_box(points)) or 1.0
    apart = np.linalg.norm(points[children] - points[above], axis=1)
    apart[apart < 1e-6 * size] = np.inf  # coincident joints are ignored
    nearest = np.full(len(points), np.inf)
    np.minimum.at(nearest, children, apart)
    np.minimum.at(nearest, above, apart)
    return np.clip(_AXIS_FRACTION * nearest, _AXIS_LIMITS[0] * size, _AXIS_LIMITS[1] * size)


def _colors(skeleton: Skeleton, selected: int) -> Floats:
    """Return the colours of the joints' boxes: (J, 4), sRGB and opacity."""
    colors = np.ones((skeleton.n_joints, 4))
    colors[:, :3] = encode_srgb(joint_colors(skeleton.n_joints))
    if selected >= 0:
        colors[selected] = HIGHLIGHT
    return colors


def name_labels(marks: Sequence[JointMarks], selected: tuple[int, int]) -> Labels:
    """Return the joints' names: the selected joint first, then nearer joints."""
    shown = [shown_joints(one.skeleton) for one in marks]
    texts = [
        printable(labels[joint], _LONGEST_NAME)
        for one, joints in zip(marks, shown, strict=True)
        for labels in (joint_labels(one.skeleton),)
        for joint in joints.tolist()
    ]
    if not texts:
        return Labels((), np.zeros((0, 3)), np.zeros(0, dtype=np.int32), np.zeros((0, 3)))
    is_chosen = np.concatenate(
        [
            (joints == selected[1]) & (one.actor == selected[0])
            for one, joints in zip(marks, shown, strict=True)
        ]
    )
    points = np.concatenate([one.points[joints] for one, joints in zip(marks, shown, strict=True)])
    colors = np.where(is_chosen[:, None], HIGHLIGHT[:3], LABEL_COLOR)
    return Labels(tuple(texts), points, np.where(is_chosen, 0, _LATE_RANK).astype(np.int32), colors)


def joint_at(
    marks: Sequence[JointMarks],
    view: View,
    size: tuple[int, int],
    pixel: tuple[float, float],
    with_bones: bool,
) -> tuple[int, int, Floats] | None:
    """Return the actor and joint whose dot or bone is at a pixel, and its point (3,)."""
    best: tuple[float, float, int, int, Floats] | None = None
    scale = picture_scale(size)
    for one in marks:
        # Distances are 0 to 1 for dots and 1 to 2 for bones: dots are drawn over bones.
        seen = project(view, size, one.points)
        away = np.linalg.norm(seen.pixels - pixel, axis=1) / (scale * _DOT_REACH)
        away[~seen.seen | (away > 1.0)] = np.inf
        if one.skeleton.auxiliary is not None:
            away[one.skeleton.auxiliary] = np.inf
        joints: Ints = np.arange(len(away), dtype=np.int32)
        if with_bones:
            beside, parents = _beside_bones(one, view, size, pixel)
            beside = 1.0 + beside / (scale * _BONE_REACH)
            away = np.concatenate([away, np.where(beside > 2.0, np.inf, beside)])
            joints = np.concatenate([joints, parents])
        nearest = int(away.argmin())
        found = float(away[nearest]), float(seen.depths[joints[nearest]])
        if np.isfinite(found[0]) and (best is None or found < best[:2]):
            joint = int(joints[nearest])
            best = (*found, one.actor, joint, one.points[joint])
    return None if best is None else best[2:]


def _beside_bones(
    marks: JointMarks, view: View, size: tuple[int, int], pixel: tuple[float, float]
) -> tuple[Floats, Ints]:
    """Return the distance of a pixel from each bone, and the joints that rotate them."""
    children, above = marks.bones
    ends, seen = project_segments(view, size, marks.points[above], marks.points[children])
    along = ends[:, 1] - ends[:, 0]
    to_pixel = np.asarray(pixel) - ends[:, 0]
    squares = (along**2).sum(axis=1)
    fraction = (to_pixel * along).sum(axis=1) / np.where(squares > 0.0, squares, 1.0)
    nearest = np.clip(fraction, 0.0, 1.0)[:, None] * along
    away = np.linalg.norm(to_pixel - nearest, axis=1)
    away[~seen] = np.inf
    return away, above
