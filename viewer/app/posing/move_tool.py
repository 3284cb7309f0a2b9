"""Move tool: a joint dragged in the image plane, and arrows that translate the root.

A joint with parents follows the pointer by inverse kinematics, solved from the last pose of the
drag, so that small movements of the pointer change it little. Roots, and joints with translation
DOFs, are translated.
"""

from __future__ import annotations

import numpy as np

from viewer.app.core.view_frame import Place, ViewFrame
from viewer.app.posing.posed_joint import Orientation, PosedJoint
from viewer.app.posing.posing import Outcome
from viewer.data_classes import dataclass
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.number_text import number_text
from viewer.rigs.pose import Pose
from viewer.rigs.posing.inverse_kinematics import Reaching, chain_above
from viewer.rigs.skeleton import Skeleton, joint_label

LENGTH = 72.0
"""Length of the arrows, points."""

_REACH = 7.0  # distance in points within which an arrow can be grabbed
_SHORTEST = 12.0  # points: arrows that appear shorter point almost at the eye
_BARE = 14.0  # points from the joint within which an arrow belongs to the joint's handle
_MET = 1e-3  # remaining distance above which it is shown, relative to the figure's size


@dataclass(frozen=True, slots=True, eq=False)
class Arrow:
    """A direction in which a joint can be translated."""

    axis: Floats
    """Unit vector, scene space: (3,)."""
    color: int
    """0, 1, 2 for x, y, z."""


def longest_chain(skeleton: Skeleton, joint: int) -> int:
    """Return the number of joints above a joint that can rotate."""
    return len(chain_above(skeleton, joint, skeleton.n_joints)) if joint >= 0 else 0


def used_chain(skeleton: Skeleton, joint: int, asked: int) -> Ints:
    """Return the joints (N,) that rotate when one is dragged, the nearest first; 0 asks for two."""
    chain = chain_above(skeleton, joint, asked or 2)
    # By default, the root stays, because it would rotate the whole figure.
    if not asked and len(chain) > 1:
        chain = chain[skeleton.parents[chain] >= 0]
    return chain


def translation_dofs(skeleton: Skeleton, joint: int) -> Ints:
    """Return the rows of a joint's unlocked translation DOFs: (N,) int32."""
    own = (skeleton.dof_joints == joint) & (skeleton.dof_kinds < 3) & ~skeleton.locked
    return np.flatnonzero(own).astype(np.int32)


def shifts(skeleton: Skeleton, joint: int) -> bool:
    """Return whether a joint has arrows: it is a root, or has translation DOFs."""
    return bool(skeleton.parents[joint] < 0) or len(translation_dofs(skeleton, joint)) > 0


def arrows(joint: PosedJoint, orientation: Orientation) -> list[Arrow]:
    """Return the arrows of a joint, along the axes of an orientation or of its few DOFs."""
    if not shifts(joint.skeleton, joint.joint):
        return []
    rows = translation_dofs(joint.skeleton, joint.joint)
    kinds = joint.skeleton.dof_kinds[rows].tolist()
    if 0 < len(set(kinds)) < 3:
        axes = joint.parent_linear / np.linalg.norm(joint.parent_linear, axis=0)
        return [Arrow(axes[:, kind], kind) for kind in sorted(set(kinds))]
    axes = joint.axes(orientation)
    return [Arrow(axes[:, axis], axis) for axis in range(3)]


def grab_arrow(
    found: list[Arrow], center: Floats, frame: ViewFrame, place: Place, reach: float = _REACH
) -> Arrow | None:
    """Return the arrow from a scene point (3,) that is under the pointer, or None."""
    best, nearest, scale = None, reach * frame.scale, frame.scale
    length = LENGTH * frame.unit_length(center)
    for arrow in found:
        ends = frame.project(np.stack([center, center + length * arrow.axis]))
        way = ends[1] - ends[0]
        size = float(np.linalg.norm(way))
        if not np.isfinite(size) or size < _SHORTEST * scale:
            continue
        x, y = np.array(place) - ends[0]
        along = float(x * way[0] + y * way[1]) / size
        across = abs(float(way[0] * y - way[1] * x)) / size
        if _BARE * scale < along < size + reach * scale and across < nearest:
            best, nearest = arrow, across
    return best


class ReachHandle:
    """Handle of a joint that is dragged by inverse kinematics."""

    def __init__(self, posed: PosedJoint, start: Pose, place: Place, length: int) -> None:
        self.posed, self.start, self.place = posed, start.copy(), place
        self.joint = posed.joint
        self._reaching = Reaching(posed.skeleton, start, posed.joint, length)

    def follow(self, frame: ViewFrame, place: Place, snaps: bool) -> Outcome:
        """Return the pose that moves the joint to the pointer, at its initial depth."""
        target = dragged(self.posed.center, self.place, frame, place)
        inside = np.linalg.solve(self.posed.placement, np.append(target, 1.0))[:3]
        found = self._reaching.follow(inside)
        pose = self.start.copy()
        pose.dofs[:] = found.dofs
        name, limited = joint_label(self.posed.skeleton, self.joint), tuple(found.limited.tolist())
        size = float(np.ptp(self.posed.world[:, :3, 3], axis=0).max()) or 1.0
        scale = float(np.linalg.norm(self.posed.placement[:3, 0]))
        left = found.distance * scale
        if left <= _MET * size:
            return Outcome(pose, name, limited, is_settled=found.is_settled)
        text = f"{name}   {left:.3g} away"
        return Outcome(pose, text, limited, target, is_settled=found.is_settled)


class MoveHandle:
    """Handle of a root, or of a joint with translation DOFs."""

    def __init__(
        self, posed: PosedJoint, start: Pose, place: Place, arrow: Arrow | None = None
    ) -> None:
        self.posed, self.start, self.place, self.arrow = posed, start.copy(), place, arrow
        self.joint = posed.joint

    def follow(self, frame: ViewFrame, place: Place, snaps: bool) -> Outcome:
        """Return the pose with the joint, or the whole figure, translated to the pointer."""
        if self.arrow is None:
            way = dragged(self.posed.center, self.place, frame, place) - self.posed.center
        else:
            way = self._along(frame, place) * self.arrow.axis
        rows = translation_dofs(self.posed.skeleton, self.joint)
        return self._shift_dofs(rows, way) if len(rows) else self._shift_figure(way)

    def _along(self, frame: ViewFrame, place: Place) -> float:
        """Return the pointer's movement along the arrow since the start of the drag."""
        assert self.arrow is not None  # checked by the caller
        center, axis = self.posed.center, self.arrow.axis
        first = _nearest_to(center, axis, *frame.ray(self.place))
        return _nearest_to(center, axis, *frame.ray(place)) - first

    def _shift_dofs(self, rows: Ints, way: Floats) -> Outcome:
        """Change the translation DOFs of the joint."""
        skeleton, pose = self.posed.skeleton, self.start.copy()
        columns = self.posed.parent_linear[:, skeleton.dof_kinds[rows]]
        steps = np.linalg.lstsq(columns, way, rcond=None)[0]
        low, high = skeleton.dof_limits[rows].T
        wanted = pose.dofs[rows] + steps
        pose.dofs[rows] = np.clip(wanted, low, high)
        limited = tuple(rows[(wanted < low) | (wanted > high)].tolist())
        done = columns @ (pose.dofs[rows] - self.start.dofs[rows])
        return Outcome(pose, shift_text(joint_label(skeleton, self.joint), done), limited)

    def _shift_figure(self, way: Floats) -> Outcome:
        """Move the whole figure by its translation, which precedes its placement in the scene."""
        pose = self.start.copy()
        # This is the placement of the actor, without the figure's own scale.
        linear = self.posed.placement[:3, :3] / self.start.figure_scale
        pose.figure_translation = pose.figure_translation + np.linalg.solve(linear, way)
        return Outcome(pose, shift_text("figure", way))


def dragged(center: Floats, first: Place, frame: ViewFrame, place: Place) -> Floats:
    """Return the target of a dragged joint: it keeps its depth and its offset from the pointer."""
    start = frame.at_depth_of(center, first)
    return np.asarray(center + frame.at_depth_of(center, place) - start)


def _nearest_to(center: Floats, axis: Floats, origin: Floats, direction: Floats) -> float:
    """Return the position along an axis that is nearest to another line."""
    # The points c + s a and o + t d of two lines with unit directions are nearest to each other if
    # their difference is perpendicular to a and to d. With k = a . d, eliminating t gives
    # s (1 - k^2) = (o - c) . a - k (o - c) . d. For almost parallel lines, which differ by less
    # than 0.06 degrees, s would be arbitrarily large.
    across = float(axis @ direction)
    room = max(1.0 - across * across, 1e-6)
    away = origin - center
    return float(axis @ away - across * (direction @ away)) / room


def shift_text(name: str, way: Floats) -> str:
    """Return the text next to the pointer: name of the moved item, and distance along each axis."""
    return f"{name}   {' '.join(number_text(part, '+.3g') for part in way.tolist())}"
