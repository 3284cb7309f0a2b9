"""Move tool: a joint dragged in the image plane, and arrows that translate the root.

A joint below others follows the pointer by inverse kinematics, solved from the pose in which the
drag began: the result depends on the pointer's place, not on its path. A root, and a
joint with translations of its own, is translated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from viewer.app.core.view_frame import Place, ViewFrame
from viewer.app.posing.posed_joint import PosedJoint
from viewer.app.posing.state import Outcome
from viewer.errors import RigError
from viewer.rig.arrays import Floats, Ints
from viewer.rig.number_text import number_text
from viewer.rig.pose import Pose
from viewer.rig.posing.inverse_kinematics import chain_above, reach
from viewer.rig.skeleton import Skeleton, joint_label

__all__ = [
    "LENGTH",
    "Arrow",
    "ReachHandle",
    "ShiftHandle",
    "arrows",
    "grab_arrow",
    "longest_chain",
    "shifts",
    "translation_dofs",
    "used_chain",
]

LENGTH = 72.0
"""Of the arrows, window coordinates."""

_REACH = 7.0  # window coordinates around an arrow within which it is grabbed
_SHORTEST = 12.0  # window coordinates: a shorter projection points at the eye
_BARE = 14.0  # window coordinates at an arrow's base that belong to the handle in the middle
_ROUNDS = 40  # iterations of the solver: bounds the time of a frame
_MET = 1e-3  # of the chain's reach: smallest distance that is shown


@dataclass(frozen=True, slots=True, eq=False)
class Arrow:
    """A direction in which a joint can be translated.

    Attributes
    ----------
    axis : (3,)
        Unit vector, scene space.
    color : int
        0, 1, 2 for x, y, z.
    """

    axis: Floats
    color: int


def longest_chain(skeleton: Skeleton, joint: int) -> int:
    """Return how many joints above one can rotate."""
    return len(chain_above(skeleton, joint, skeleton.n_joints)) if joint >= 0 else 0


def used_chain(skeleton: Skeleton, joint: int, asked: int) -> Ints:
    """Return the joints that rotate when one is dragged, the nearest first: (N,) int32.

    Parameters
    ----------
    skeleton : Skeleton
        Gives the hierarchy.
    joint : int
        The dragged one.
    asked : int
        Largest number; 0 for two without a root, which would rotate the whole figure, unless
        nothing else can rotate.
    """
    chain = chain_above(skeleton, joint, asked or 2)
    if not asked and len(chain) > 1:
        chain = chain[skeleton.parents[chain] >= 0]
    return chain


def translation_dofs(skeleton: Skeleton, joint: int) -> Ints:
    """Return the rows of a joint's free translations: (N,) int32."""
    own = (skeleton.dof_joints == joint) & (skeleton.dof_kinds < 3) & ~skeleton.locked
    return np.flatnonzero(own).astype(np.int32)


def shifts(skeleton: Skeleton, joint: int) -> bool:
    """Return whether a joint has arrows: it is a root, or has translations of its own."""
    return bool(skeleton.parents[joint] < 0) or len(translation_dofs(skeleton, joint)) > 0


def arrows(joint: PosedJoint, orientation: str) -> list[Arrow]:
    """Return the arrows of a joint; none if it cannot be translated.

    Parameters
    ----------
    joint : PosedJoint
        In the scene.
    orientation : str
        A key of ``ORIENTATIONS``; a joint with fewer than three translations has their own axes.
    """
    if not shifts(joint.skeleton, joint.joint):
        return []
    rows = translation_dofs(joint.skeleton, joint.joint)
    kinds = joint.skeleton.dof_kinds[rows].tolist()
    if 0 < len(set(kinds)) < 3:
        axes = joint.parent_linear / np.linalg.norm(joint.parent_linear, axis=0)
        return [Arrow(axes[:, kind], kind) for kind in sorted(set(kinds))]
    axes = joint.axes(orientation)
    return [Arrow(axes[:, axis], axis) for axis in range(3)]


def grab_arrow(found: list[Arrow], center: Floats, frame: ViewFrame, place: Place) -> Arrow | None:
    """Return the arrow under the pointer, None if there is none.

    Parameters
    ----------
    found : list of Arrow
        To choose from.
    center : (3,)
        Where the joint is, scene space.
    frame : ViewFrame
        How the scene is seen.
    place : (float, float)
        The pointer.
    """
    best, nearest = None, _REACH
    length = LENGTH * frame.unit_length(center)
    for arrow in found:
        ends = frame.project(np.stack([center, center + length * arrow.axis]))
        way = ends[1] - ends[0]
        size = float(np.linalg.norm(way))
        if not np.isfinite(size) or size < _SHORTEST:
            continue
        x, y = np.array(place) - ends[0]
        along = float(x * way[0] + y * way[1]) / size
        across = abs(float(way[0] * y - way[1] * x)) / size
        if _BARE < along < size + _REACH and across < nearest:
            best, nearest = arrow, across
    return best


class ReachHandle:
    """Handle of a dragged joint, and of the chain above it that follows.

    Parameters
    ----------
    posed : PosedJoint
        When the drag began.
    start : Pose
        The pose then.
    place : (float, float)
        The pointer then.
    length : int
        How many joints above may rotate.
    """

    def __init__(self, posed: PosedJoint, start: Pose, place: Place, length: int) -> None:
        self.posed, self.start, self.place, self.length = posed, start.copy(), place, length
        self.joint = posed.joint

    def follow(self, frame: ViewFrame, place: Place, snaps: bool) -> Outcome:
        """Return the pose that brings the joint to the pointer, at the depth it had."""
        target = _dragged(self.posed.center, self.place, frame, place)
        skeleton = self.posed.skeleton
        inside = np.linalg.solve(self.posed.placement, np.append(target, 1.0))[:3]
        try:
            found = reach(skeleton, self.start, self.joint, inside, self.length, _ROUNDS)
        except RigError as problem:
            return Outcome(self.start.copy(), str(problem))
        pose = self.start.copy()
        pose.dofs[:] = found.dofs
        name, limited = joint_label(skeleton, self.joint), tuple(found.limited.tolist())
        size = float(np.ptp(self.posed.world[:, :3, 3], axis=0).max()) or 1.0
        scale = float(np.linalg.norm(self.posed.placement[:3, 0]))
        left = found.distance * scale
        if left <= _MET * size:
            return Outcome(pose, name, limited)
        return Outcome(pose, f"{name}   {left:.3g} away", limited, target)


class ShiftHandle:
    """Handle of a root, or of a joint with translations of its own.

    Parameters
    ----------
    posed : PosedJoint
        When the drag began.
    start : Pose
        The pose then.
    place : (float, float)
        The pointer then.
    arrow : Arrow or None
        Along which it moves; None for the image plane.
    """

    def __init__(
        self, posed: PosedJoint, start: Pose, place: Place, arrow: Arrow | None = None
    ) -> None:
        self.posed, self.start, self.place, self.arrow = posed, start.copy(), place, arrow
        self.joint = posed.joint

    def follow(self, frame: ViewFrame, place: Place, snaps: bool) -> Outcome:
        """Return the pose with the joint, or the whole figure, translated to the pointer."""
        if self.arrow is None:
            way = _dragged(self.posed.center, self.place, frame, place) - self.posed.center
        else:
            way = self._along(frame, place) * self.arrow.axis
        rows = translation_dofs(self.posed.skeleton, self.joint)
        return self._shift_dofs(rows, way) if len(rows) else self._shift_figure(way)

    def _along(self, frame: ViewFrame, place: Place) -> float:
        """Return the movement of the line of sight along the arrow since the start of the drag."""
        assert self.arrow is not None  # checked by the caller
        center, axis = self.posed.center, self.arrow.axis
        first = _nearest_to(center, axis, *frame.ray(self.place))
        return _nearest_to(center, axis, *frame.ray(place)) - first

    def _shift_dofs(self, rows: Ints, way: Floats) -> Outcome:
        """Change the translations that the joint has."""
        skeleton, pose = self.posed.skeleton, self.start.copy()
        columns = self.posed.parent_linear[:, skeleton.dof_kinds[rows]]
        steps = np.linalg.lstsq(columns, way, rcond=None)[0]
        low, high = skeleton.dof_limits[rows].T
        wanted = pose.dofs[rows] + steps
        pose.dofs[rows] = np.clip(wanted, low, high)
        limited = tuple(rows[(wanted < low) | (wanted > high)].tolist())
        done = columns @ (pose.dofs[rows] - self.start.dofs[rows])
        return Outcome(pose, _shift_text(joint_label(skeleton, self.joint), done), limited)

    def _shift_figure(self, way: Floats) -> Outcome:
        """Move the whole figure: its translation applies before its placement in the scene."""
        pose = self.start.copy()
        # The placement of the actor is the joint's placement without the figure's own part.
        linear = self.posed.placement[:3, :3] / self.start.figure_scale
        pose.figure_translation = pose.figure_translation + np.linalg.solve(linear, way)
        return Outcome(pose, _shift_text("figure", way))


def _dragged(center: Floats, first: Place, frame: ViewFrame, place: Place) -> Floats:
    """Return the target of a dragged joint: it keeps its depth and its offset from the pointer."""
    start = frame.at_depth_of(center, first)
    return np.asarray(center + frame.at_depth_of(center, place) - start)


def _nearest_to(center: Floats, axis: Floats, origin: Floats, direction: Floats) -> float:
    """Return the position along an axis that is nearest to another line."""
    across = float(axis @ direction)
    room = max(1.0 - across * across, 1e-6)
    away = origin - center
    return float(axis @ away - across * (direction @ away)) / room


def _shift_text(name: str, way: Floats) -> str:
    return f"{name}   {' '.join(number_text(part, '+.3g') for part in way.tolist())}"
