"""Rotate tool: rings about a joint, and the rotations made by dragging them.

A joint that rotates freely about three axes is rotated as a whole, about the axes of the chosen
orientation or the line of sight. Any other joint has a ring for each of its DOFs, about the axis
of that DOF.
"""

from __future__ import annotations

import math

import numpy as np

from viewer.app.core.view_frame import Place, ViewFrame
from viewer.app.posing.posed_joint import Orientation, PosedJoint
from viewer.app.posing.posing import Outcome
from viewer.data_classes import dataclass
from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.rotation import nearest_angles, rotation_vector_to_matrix
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.number_text import angle_text
from viewer.rigs.pose import Pose, joint_rotations
from viewer.rigs.posing.inverse_kinematics import rotation_axes
from viewer.rigs.posing.joint_rotation import nearest_dofs, rotates_freely, rotation_dofs
from viewer.rigs.skeleton import Skeleton, dof_label, joint_label

RADIUS = 78.0
"""Radius of the rings, points."""

SNAP = math.radians(15.0)
_VIEW_RADIUS = 1.2  # radius of the ring about the line of sight, relative to the other rings
_REACH = 7.0  # distance in points within which a ring can be grabbed
_FLAT = 0.25  # cosine between axis and line of sight below which a ring counts as seen edge-on
_STEPS = 72


@dataclass(frozen=True, slots=True, eq=False)
class Ring:
    """A circle about a joint that rotates it."""

    axis: Floats
    """Unit vector, scene space: (3,)."""
    color: int
    """0, 1, 2 for x, y, z; 3 for the line of sight."""
    size: float = RADIUS
    """Radius, window coordinates."""
    dof: int = -1
    """DOF that it changes; -1 for the whole joint."""


def rings(joint: PosedJoint, pose: Pose, orientation: Orientation, frame: ViewFrame) -> list[Ring]:
    """Return the rings of a joint; none if it cannot rotate."""
    skeleton = joint.skeleton
    if rotates_freely(skeleton, joint.joint):
        axes = joint.axes(orientation)
        whole = [Ring(axes[:, axis], axis) for axis in range(3)]
        return [*whole, Ring(toward_eye(frame, joint.center), 3, RADIUS * _VIEW_RADIUS)]
    axes_of = rotation_axes(skeleton, pose, joint.joint)
    found = []
    for dof in rotation_dofs(skeleton, joint.joint, free=True).tolist():
        axis = joint.rotation_axis(axes_of[dof])
        found.append(Ring(axis, int(skeleton.dof_kinds[dof]) - 3, RADIUS, dof))
    return found


def toward_eye(frame: ViewFrame, point: Floats) -> Floats:
    """Return the unit direction from a point to the eye: (3,); up if it is not visible."""
    seen = frame.place(point)
    return np.array([0.0, 1.0, 0.0]) if seen is None else -frame.ray(seen)[1]


def circle(center: Floats, axis: Floats, radius: float, start: Floats | None = None) -> Floats:
    """Return points (N, 3) of a circle around a unit axis (3,), from a direction across it."""
    first = _across(axis) if start is None else start
    second = np.cross(axis, first)
    angles = np.linspace(0.0, 2.0 * math.pi, _STEPS + 1)[:, None]
    return np.asarray(center + radius * (np.cos(angles) * first + np.sin(angles) * second))


def _across(axis: Floats) -> Floats:
    """Return a unit vector perpendicular to an axis."""
    least = np.eye(3)[int(np.argmin(np.abs(axis)))]
    return unit(np.cross(axis, least))


def grab_ring(
    found: list[Ring], center: Floats, frame: ViewFrame, place: Place, reach: float = _REACH
) -> tuple[Ring, Floats] | None:
    """Return the ring under the pointer, preferring near halves, and its direction there (3,)."""
    best, nearest = None, reach * frame.scale
    length = frame.unit_length(center)
    eye = toward_eye(frame, center)
    for ring in found:
        points = circle(center, ring.axis, ring.size * length)
        seen = frame.project(points)
        if length == 0.0 or not np.isfinite(seen).all():
            continue
        distances, fractions = _distances(seen, np.array(place))
        directions = unit(points - center)
        if ring.color < 3:
            distances = distances + 0.5 * _REACH * frame.scale * (directions[:-1] @ eye < -1e-6)
        nearer = int(distances.argmin())
        if distances[nearer] < nearest:
            nearest = float(distances[nearer])
            along = directions[nearer] * (1 - fractions[nearer])
            best = ring, unit(along + directions[nearer + 1] * fractions[nearer])
    return best


def _distances(line: Floats, place: Floats) -> tuple[Floats, Floats]:
    """Return a point's distances from the segments of a polyline, and the parameters: both (N,)."""
    starts, steps = line[:-1], np.diff(line, axis=0)
    lengths = np.maximum(np.einsum("na,na->n", steps, steps), 1e-12)
    fractions = np.clip(np.einsum("na,na->n", place - starts, steps) / lengths, 0.0, 1.0)
    return np.linalg.norm(starts + fractions[:, None] * steps - place, axis=1), fractions


class RotateHandle:
    """Handle of a ring, held at a unit direction (3,) from the joint."""

    def __init__(
        self,
        posed: PosedJoint,
        start: Pose,
        ring: Ring,
        held: Floats,
        place: Place,
        in_degrees: bool = True,
    ) -> None:
        self.posed, self.start, self.ring, self.held = posed, start.copy(), ring, held
        self.place, self.in_degrees = place, in_degrees
        self.joint, self.center = posed.joint, posed.center
        self._angle = 0.0
        self._first: float | None = None

    def follow(self, frame: ViewFrame, place: Place, snaps: bool) -> Outcome:
        """Return the pose with the joint rotated by the angle of the pointer around it."""
        angle = self._turned(frame, place)
        if angle is not None:
            # Several revolutions are possible: take the equivalent angle nearest to the last one.
            self._angle = float(nearest_angles(angle, self._angle))
        turn = SNAP * round(self._angle / SNAP) if snaps else self._angle
        if self.ring.dof >= 0:
            return self._one_dof(turn)
        return self._whole(turn)

    def _turned(self, frame: ViewFrame, place: Place) -> float | None:
        """Return the angle from the grabbed point to the pointer, or None."""
        if self.ring.color == 3:
            return self._on_screen(frame, place)
        axis, eye = self.ring.axis, toward_eye(frame, self.center)
        if abs(axis @ eye) < _FLAT:
            return self._along_edge(frame, place)
        found = self._angle_at(frame, place)
        if self._first is None:
            self._first = self._angle_at(frame, self.place)
        return None if found is None or self._first is None else found - self._first

    def _on_screen(self, frame: ViewFrame, place: Place) -> float | None:
        """Return the angle around the joint in the image, counterclockwise."""
        center = frame.place(self.center)
        if center is None:
            return None
        first, now = (
            math.atan2(center[1] - at[1], at[0] - center[0]) for at in (self.place, place)
        )
        return now - first

    def _angle_at(self, frame: ViewFrame, place: Place) -> float | None:
        """Return the angle from the held direction to the pointer in the ring's plane."""
        axis, (origin, direction) = self.ring.axis, frame.ray(place)
        along = float(axis @ direction)
        if abs(along) < 1e-6:
            return None
        # The line of sight o + t d meets the plane through c where axis . (o + t d - c) = 0.
        away = origin + direction * float(axis @ (self.center - origin)) / along - self.center
        if not np.isfinite(frame.project(self.center + away)).all():
            return None  # the line of sight meets the plane behind the eye
        return math.atan2(float(axis @ np.cross(self.held, away)), float(self.held @ away))

    def _along_edge(self, frame: ViewFrame, place: Place) -> float:
        """Return the angle of a ring seen edge-on, which is rolled like a wheel."""
        eye = toward_eye(frame, self.center)
        radius = self.ring.size * frame.unit_length(self.center)
        # A point r of the ring moves by axis x r for each radian, its front by axis x eye times the
        # radius. This is projected for 1 mrad, an arc that is straight in the image, and scaled to
        # window coordinates per radian. The pointer's movement along it is the angle.
        rim = 1e-3 * radius * np.cross(self.ring.axis, eye)
        ends = frame.project(np.stack([self.center, self.center + rim]))
        way = (ends[1] - ends[0]) * 1e3
        length = float(way @ way)
        if not length > 0.0:
            return self._angle
        side = 1.0 if self.held @ eye >= -1e-9 else -1.0
        return side * float((np.array(place) - self.place) @ way) / length

    def _one_dof(self, turn: float) -> Outcome:
        """Rotate the DOF of the ring within its limits."""
        skeleton, dof, pose = self.posed.skeleton, self.ring.dof, self.start.copy()
        low, high = skeleton.dof_limits[dof]
        value = float(pose.dofs[dof]) + turn
        pose.dofs[dof] = min(max(value, float(low)), float(high))
        limited = () if low < value < high else (dof,)
        done = float(pose.dofs[dof] - self.start.dofs[dof])
        now = f"{dof_label(skeleton, dof)} {self._text(float(pose.dofs[dof]))}"
        return Outcome(pose, f"{self._text(done, '+')}   {now}", limited, angle=done)

    def _whole(self, turn: float) -> Outcome:
        """Rotate the joint about the ring's axis, as closely as its limits permit."""
        skeleton, joint = self.posed.skeleton, self.joint
        axis = self.posed.parent_axis(self.ring.axis)
        now = joint_rotations(skeleton, self.start)[joint]
        wanted = rotation_vector_to_matrix(axis * turn) @ now
        found = nearest_dofs(skeleton, self.start, joint, wanted)
        pose = self.start.copy()
        pose.dofs[:] = found.dofs
        name = "xyz "[self.ring.color].strip() or "view"
        text = f"{joint_label(skeleton, joint)} {name} {self._text(turn, '+')}"
        return Outcome(pose, text, tuple(found.limited.tolist()), angle=turn)

    def _text(self, angle: float, sign: str = "") -> str:
        return angle_text(angle, self.in_degrees, sign)


def limit_text(skeleton: Skeleton, limited: tuple[int, ...]) -> str:
    """Return a line about the DOFs at their limits; empty if there is none."""
    if not limited:
        return ""
    names = ", ".join(dof_label(skeleton, dof) for dof in limited[:4])
    more = f" and {len(limited) - 4} more" if len(limited) > 4 else ""
    return f"at its limit: {names}{more}" if len(limited) == 1 else f"at limits: {names}{more}"
