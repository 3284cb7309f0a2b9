"""Handles of the posing tools in the view: picking, dragging, release, and drawing.

ImGuizmo rotates matrices about three orthogonal axes; joints here have one, two or three DOFs with
limits, about axes that may be oblique, so rings and arrows are custom. Like the image of the scene,
handles are drawn behind the panels, so they are drawn after the image.

The arc of a limit covers the directions that the bone can reach: it starts at the bone's current
direction perpendicular to the axis, and its ends are the limits. If the bone is parallel to the
axis, as for a twist, one of the joint's own axes is used instead.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from imgui_bundle import ImVec2Like, imgui

from viewer.app.core.state import AppState
from viewer.app.core.view_frame import Place, ViewFrame, view_frame
from viewer.app.posing.joint_tree import select_joint
from viewer.app.posing.move_tool import (
    LENGTH,
    MoveHandle,
    ReachHandle,
    arrows,
    grab_arrow,
    shifts,
    used_chain,
)
from viewer.app.posing.posed_joint import PosedJoint, posed_joint
from viewer.app.posing.posing import Drag, Handle, Outcome, Posing, pause_for_edit
from viewer.app.posing.rotate_tool import (
    RADIUS,
    RotateHandle,
    circle,
    grab_ring,
    limit_text,
    rings,
    toward_eye,
)
from viewer.app.posing.toolbar import cancel_drag, no_tool, selected
from viewer.data_classes import dataclass
from viewer.phrases import printable
from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.pose import Pose
from viewer.rigs.posing.inverse_kinematics import rotation_axes
from viewer.rigs.posing.joint_rotation import rotation_dofs
from viewer.rigs.skeleton import joint_label

_DOT_REACH = 14.0
"""Radius around a joint in which a click selects it, points."""
_BESIDE = 22.0  # distance in points from a handle within which a drag does not orbit
_STILL = 2.0  # maximum movement of the pointer during a click, window coordinates
_LEFT, _RIGHT = imgui.MouseButton_.left, imgui.MouseButton_.right
_Color: TypeAlias = tuple[float, float, float, float]
_AXES = ((0.98, 0.36, 0.33), (0.45, 0.86, 0.38), (0.36, 0.60, 1.0), (0.92, 0.92, 0.92))
_HOT = (1.0, 0.92, 0.55)
_LIMIT = (1.0, 0.70, 0.10)
_CHAIN = (0.45, 0.90, 0.95)
_BEHIND = 0.28  # opacity of the far side of a ring
_MOST_DOTS = 300  # maximum number of joints for which dots are drawn
_ARC_RADIUS = 0.62  # radius of an arc, relative to that of the rings
_GAP = 10.0  # points between a ring and its text
_ALONG = 0.35  # sine of the angle between bone and axis below which the rotation is not visible
_STEP = math.radians(4.0)  # between two points of an arc
_WHOLE = 2.0 * math.pi
_ROUNDING = 1e-6  # tolerance within which a value is at a limit, radians


class Pen:
    """Draws points of the scene as lines in the window; sizes are in points."""

    def __init__(self, frame: ViewFrame) -> None:
        self.frame, self.list = frame, imgui.get_background_draw_list()
        self.scale = frame.scale

    def line(self, points: Floats, color: _Color, thickness: float) -> None:
        """Draw a line through (N, 3) points, unless one of them is behind the eye."""
        seen = self.frame.project(points)
        if np.isfinite(seen).all():
            ink = imgui.get_color_u32(color)
            self.list.add_polyline(
                [(x, y) for x, y in seen.tolist()], ink, thickness * self.scale, 0
            )

    def fan(self, center: Floats, points: Floats, color: _Color) -> None:
        """Fill the area between a point and a polyline."""
        seen, middle = self.frame.project(points), self.frame.place(center)
        if middle is None or not np.isfinite(seen).all():
            return
        rows: list[ImVec2Like] = [imgui.ImVec2(x, y) for x, y in [middle, *seen.tolist()]]
        self.list.add_concave_poly_filled(rows, imgui.get_color_u32(color))

    def dot(self, point: Floats, radius: float, color: _Color, filled: bool = True) -> None:
        """Draw a disc, or a circle, around a point."""
        place = self.frame.place(point)
        if place is None:
            return
        ink = imgui.get_color_u32(color)
        if filled:
            self.list.add_circle_filled(place, radius * self.scale, ink)
        else:
            self.list.add_circle(place, radius * self.scale, ink, 0, 2.0 * self.scale)


@dataclass(frozen=True, slots=True, eq=False)
class _LimitArc:
    """The range of one rotation DOF."""

    dof: int
    """Row of the DOF table."""
    color: int
    """0, 1, 2 for x, y, z."""
    axis: Floats
    start: Floats
    """(3,): rotation axis, and the current direction perpendicular to it: unit vectors, scene
    space."""
    low: float
    high: float
    """Limits relative to the current value, radians about the axis; low <= 0 <= high."""
    is_limited: bool
    """Whether the value is at a limit."""


def use_handles(state: AppState) -> bool:
    """Begin, continue or end a drag; return whether a handle uses the mouse."""
    posing = state.of(Posing)
    io = imgui.get_io()
    place = (io.mouse_pos.x, io.mouse_pos.y)
    if posing.drag is not None:
        return _go_on(state, posing.drag, place)
    if posing.has_missed:  # the rest of a drag beside a handle is ignored, but not a click
        if imgui.is_mouse_down(_LEFT):
            return True
        posing.has_missed = False
        return imgui.get_io().mouse_drag_max_distance_sqr[_LEFT] > _STILL**2
    if not posing.is_on or io.want_capture_mouse or no_tool(state):
        return False
    if io.key_shift or io.key_alt:  # Shift pans, Alt picks vertices
        return False
    if not imgui.is_mouse_clicked(_LEFT):
        return False
    handle = _grabbed(state, place)
    if handle is None:
        posing.has_missed = _is_beside_handle(state, place)
        return posing.has_missed
    posing.drag = Drag(state.actor, handle, Outcome(state.actor.pose, ""))
    return True


def _go_on(state: AppState, drag: Drag, place: Place) -> bool:
    """Pose the actor by the pointer; a release ends the drag, the right button cancels it."""
    posing = state.of(Posing)
    if state.actor is not drag.actor or drag.actor.own_pose is not drag.outcome.pose:
        drag.is_over = True  # the pose was undone, reset or closed during the drag
    if imgui.is_mouse_clicked(_RIGHT):
        cancel_drag(state)
    if drag.is_over:
        posing.drag = drag if imgui.is_mouse_down(_LEFT) else None
        return True
    frame, snaps = view_frame(state), imgui.get_io().key_ctrl
    if not drag.has_moved and _apart(place, drag.handle.place) > _STILL:
        drag.has_moved = True
        pause_for_edit(state)
    asked = (place, snaps, frame.matrix.tobytes())
    is_asked = asked != drag.asked or drag.goes_on
    if drag.has_moved and imgui.is_mouse_pos_valid() and is_asked:
        drag.asked = asked
        drag.outcome = drag.handle.follow(frame, place, snaps)
        drag.actor.pose = drag.outcome.pose
    if not imgui.is_mouse_down(_LEFT):
        posing.drag = None
        if drag.has_moved:
            name = joint_label(drag.actor.figure.require_skeleton(), drag.handle.joint)
            state.history.name = f"{posing.tool} joint {printable(name, 60)}"
        else:
            choose_joint(state)  # a joint's dot may be under a ring or an arrow
    return True


def _is_beside_handle(state: AppState, place: Place) -> bool:
    """Return whether a press narrowly missed a handle, so that it must not orbit the camera."""
    posing, posed, frame = state.of(Posing), selected(state), view_frame(state)
    if posed is None or state.actor.own_pose is None:
        return False
    if posing.tool == "rotate":
        found = rings(posed, state.actor.own_pose, posing.orientation, frame)
        return grab_ring(found, posed.center, frame, place, _BESIDE) is not None
    center = frame.place(posed.center)
    if center is not None and _apart(center, place) <= _BESIDE * frame.scale:
        return True
    found_arrows = arrows(posed, posing.orientation)
    return grab_arrow(found_arrows, posed.center, frame, place, _BESIDE) is not None


def _apart(one: Place, other: Place) -> float:
    return float(np.hypot(one[0] - other[0], one[1] - other[1]))


def _grabbed(state: AppState, place: Place) -> Handle | None:
    """Return the handle under the pointer; with the Move tool every joint is a handle."""
    handle = handle_at(state, view_frame(state), place)
    if handle is not None or state.of(Posing).tool != "move":
        return handle
    joint = joint_at(state, place)
    if joint < 0:
        return None
    select_joint(state, joint)
    posed = posed_joint(state.actor, joint)
    return None if posed is None else _middle(state, posed, place)


def handle_at(state: AppState, frame: ViewFrame, place: Place) -> Handle | None:
    """Return the handle of the selected joint at a window position."""
    posing = state.of(Posing)
    posed, pose = selected(state), state.actor.own_pose
    if posed is None or pose is None:
        return None
    if posing.tool == "rotate":
        found = rings(posed, pose, posing.orientation, frame)
        held = grab_ring(found, posed.center, frame, place)
        return None if held is None else RotateHandle(posed, pose, *held, place, state.in_degrees)
    if posing.tool != "move":
        return None
    arrow = grab_arrow(arrows(posed, posing.orientation), posed.center, frame, place)
    if arrow is not None:
        return MoveHandle(posed, pose, place, arrow)
    center = frame.place(posed.center)
    if center is None or _apart(center, place) > _DOT_REACH * frame.scale:
        return None
    return _middle(state, posed, place)


def _middle(state: AppState, posed: PosedJoint, place: Place) -> Handle | None:
    """Return the handle at the joint, which moves it with its chain or translates it."""
    pose, skeleton = state.actor.pose, posed.skeleton
    length = len(used_chain(skeleton, posed.joint, state.of(Posing).chain_length))
    if length:
        return ReachHandle(posed, pose, place, length)
    if shifts(skeleton, posed.joint):
        return MoveHandle(posed, pose, place)
    state.say_status(f"No joint above {joint_label(skeleton, posed.joint)} can rotate")
    return None


def joint_places(state: AppState) -> Floats:
    """Return the projections of the chosen actor's joints: (J, 2), NaN if behind the eye."""
    posed = posed_joint(state.actor, 0)
    if posed is None:
        return np.zeros((0, 2))
    return view_frame(state).project(posed.world[:, :3, 3])


def joint_at(state: AppState, place: Place) -> int:
    """Return the chosen actor's joint at a window position, -1 for none."""
    distances = np.linalg.norm(joint_places(state) - place, axis=1)
    reach = _DOT_REACH * view_frame(state).scale
    distances[np.isnan(distances)] = np.inf
    nearest = int(distances.argmin()) if len(distances) else -1
    return nearest if nearest >= 0 and distances[nearest] <= reach else -1


def choose_joint(state: AppState) -> bool:
    """Select the joint whose dot was clicked; return whether there was one."""
    if not state.of(Posing).is_on or no_tool(state):
        return False
    mouse = imgui.get_io().mouse_pos
    joint = joint_at(state, (mouse.x, mouse.y))
    if joint >= 0:
        select_joint(state, joint)
    return joint >= 0


def draw_gizmo(state: AppState) -> None:
    """Draw the handles of the chosen tool over the scene."""
    posing = state.of(Posing)
    x, y, width, height = state.view_rect
    if not posing.is_on or min(width, height) < 40.0 or no_tool(state):
        return
    pen, posed = Pen(view_frame(state)), selected(state)
    pen.list.push_clip_rect((x, y), (x + width, y + height), True)
    hot = None if _drag(state) else _hovered(state, pen.frame)
    _draw_joints(state, pen)
    if posed is not None:
        if posing.tool == "rotate":
            _draw_arcs(state, pen, posed)
            _draw_rings(state, pen, posed, hot)
        else:
            _draw_chain(state, pen, posed)
            _draw_arrows(state, pen, posed, hot)
        _draw_text(state, pen, posed)
    pen.list.pop_clip_rect()


def _drag(state: AppState) -> Drag | None:
    """Return the handle that is held; None if the drag was cancelled."""
    drag = state.of(Posing).drag
    return None if drag is None or drag.is_over else drag


def _hovered(state: AppState, frame: ViewFrame) -> Handle | None:
    """Return the handle under the pointer if no panel covers it."""
    io = imgui.get_io()
    if io.want_capture_mouse or not imgui.is_mouse_pos_valid():
        return None
    return handle_at(state, frame, (io.mouse_pos.x, io.mouse_pos.y))


def _draw_joints(state: AppState, pen: Pen) -> None:
    """Draw a dot for each joint, and the name of the one under the pointer."""
    places, io = joint_places(state), imgui.get_io()
    seen = np.flatnonzero(np.isfinite(places).all(axis=1))
    ink, rim = imgui.get_color_u32((1.0, 1.0, 1.0, 0.75)), imgui.get_color_u32((0, 0, 0, 0.5))
    if len(seen) <= _MOST_DOTS:
        for x, y in places[seen].tolist():
            pen.list.add_circle_filled((x, y), 3.5 * pen.scale, rim)
            pen.list.add_circle_filled((x, y), 2.5 * pen.scale, ink)
    is_free = _drag(state) is None and not io.want_capture_mouse
    under = joint_at(state, (io.mouse_pos.x, io.mouse_pos.y)) if is_free else -1
    skeleton = state.actor.figure.skeleton
    # A click selects a joint even under a handle, which is only used by dragging.
    if under >= 0 and skeleton is not None:
        x, y = places[under].tolist()
        hot, one = imgui.get_color_u32((*_HOT, 1.0)), pen.scale
        pen.list.add_circle((x, y), 7.0 * one, hot, 0, 2.0 * one)
        text_box(
            state,
            pen,
            (x + 12.0 * one, y - 8.0 * one),
            [(joint_label(skeleton, under), (1, 1, 1, 1))],
        )


def _draw_arcs(state: AppState, pen: Pen, posed: PosedJoint) -> None:
    """Draw the limits of the joint's rotations."""
    unit = pen.frame.unit_length(posed.center)
    for rank, arc in enumerate(limit_arcs(posed, state.actor.pose)):
        # Each arc is a little smaller than the previous one, because axes may coincide.
        radius, color = (_ARC_RADIUS - 0.07 * rank) * RADIUS * unit, _AXES[arc.color]
        points = arc_points(arc, posed.center, radius)
        pen.fan(posed.center, points, (*color, 0.10))
        pen.line(points, (*color, 0.85), 2.0)
        for end in (points[0], points[-1]):
            pen.line(np.stack([posed.center, end]), (*color, 0.55), 1.0)
        present = posed.center + 1.08 * radius * arc.start
        ink = (*_LIMIT, 1.0) if arc.is_limited else (*color, 1.0)
        pen.line(np.stack([posed.center, present]), ink, 2.5)
        pen.dot(present, 3.5, ink)


def _draw_rings(state: AppState, pen: Pen, posed: PosedJoint, hot: Handle | None) -> None:
    """Draw the rings of the joint; during a drag, draw only the grabbed ring and the angle."""
    drag, pose = _drag(state), state.actor.own_pose
    if drag is not None and isinstance(drag.handle, RotateHandle):
        _draw_rotation(pen, posed, drag.handle, drag.outcome.angle or 0.0)
        return
    assert pose is not None  # limits imply a posed joint
    under = hot.ring if isinstance(hot, RotateHandle) else None
    unit, eye = pen.frame.unit_length(posed.center), toward_eye(pen.frame, posed.center)
    for ring in rings(posed, pose, state.of(Posing).orientation, pen.frame):
        is_hot = under is not None and (ring.color, ring.dof) == (under.color, under.dof)
        points = circle(posed.center, ring.axis, ring.size * unit)
        color, thickness = (_HOT, 4.0) if is_hot else (_AXES[ring.color], 2.5)
        if ring.color == 3:
            pen.line(points, (*color, 1.0 if is_hot else 0.6), thickness - 1.0)
            continue
        # The far side is faint.
        in_front = (points - posed.center) @ eye >= -1e-9
        for run in _runs(in_front):
            opacity = 1.0 if in_front[run[len(run) // 2]] else _BEHIND
            pen.line(points[run], (*color, opacity), thickness)


def _runs(flags: np.ndarray) -> list[list[int]]:
    """Split indices where a flag changes; adjacent runs share an index, so that lines meet."""
    edges = [0, *(np.flatnonzero(np.diff(flags)) + 1).tolist(), len(flags)]
    pairs = pairwise(edges)
    return [list(range(first, min(last + 1, len(flags)))) for first, last in pairs]


def _draw_rotation(pen: Pen, posed: PosedJoint, handle: RotateHandle, angle: float) -> None:
    """Draw the ring that is held, and the sector of its rotation."""
    unit = pen.frame.unit_length(posed.center)
    ring, radius = handle.ring, handle.ring.size * unit
    color = _AXES[ring.color]
    pen.line(circle(posed.center, ring.axis, radius), (*color, 0.9), 2.5)
    shown = math.copysign(min(abs(angle), 2.0 * math.pi), angle)
    steps = np.linspace(0.0, shown, max(2, math.ceil(abs(shown) / 0.08) + 1))
    turns = rotation_vector_to_matrix(steps[:, None] * ring.axis)
    points = posed.center + radius * turns @ handle.held
    pen.fan(posed.center, points, (*_HOT, 0.22))
    for end in (points[0], points[-1]):
        pen.line(np.stack([posed.center, end]), (*_HOT, 0.9), 2.0)


def _draw_chain(state: AppState, pen: Pen, posed: PosedJoint) -> None:
    """Draw the chain from the selected joint up to the last joint that may rotate."""
    skeleton, drag = posed.skeleton, _drag(state)
    chain = used_chain(skeleton, posed.joint, state.of(Posing).chain_length).tolist()
    if not chain:
        return
    limited = set(drag.outcome.limited) if drag is not None else set()
    held_back = {int(skeleton.dof_joints[dof]) for dof in limited}
    path = [posed.joint]
    while path[-1] != chain[-1]:
        path.append(int(skeleton.parents[path[-1]]))
    places = posed.world[path, :3, 3]
    for first, second in pairwise(places):
        pen.line(np.stack([first, second]), (0.0, 0.0, 0.0, 0.5), 6.0)
        pen.line(np.stack([first, second]), (*_CHAIN, 0.95), 3.5)
    for joint in chain:
        color = _LIMIT if joint in held_back else _CHAIN
        pen.dot(posed.world[joint, :3, 3], 5.0, (*color, 1.0))
    target = drag.outcome.target if drag is not None else None
    if target is not None:
        pen.line(np.stack([posed.center, target]), (*_LIMIT, 0.9), 1.5)
        pen.dot(target, 5.0, (*_LIMIT, 1.0), filled=False)


def _draw_arrows(state: AppState, pen: Pen, posed: PosedJoint, hot: Handle | None) -> None:
    """Draw the handle at the joint, and the arrows along which it is translated."""
    drag = _drag(state)
    held = drag.handle if drag is not None else hot
    arrow = held.arrow if isinstance(held, MoveHandle) else None
    is_middle = isinstance(held, ReachHandle) or (isinstance(held, MoveHandle) and arrow is None)
    pen.dot(posed.center, 8.0, (*(_HOT if is_middle else _AXES[3]), 1.0), filled=False)
    unit, scale = pen.frame.unit_length(posed.center), pen.scale
    for one in arrows(posed, state.of(Posing).orientation):
        is_hot = arrow is not None and arrow.color == one.color
        tip_in_space = posed.center + LENGTH * unit * one.axis
        ends = pen.frame.project(np.stack([posed.center, tip_in_space]))
        way = ends[1] - ends[0]
        size = float(np.linalg.norm(way))
        if not np.isfinite(size) or size < 12.0 * scale:
            continue
        along, across = way / size, np.array([-way[1], way[0]]) / size
        tip, foot = ends[1], ends[0] + 9.0 * scale * along
        neck = tip - 11.0 * scale * along
        color = imgui.get_color_u32((*(_HOT if is_hot else _AXES[one.color]), 1.0))
        pen.list.add_line(tuple(foot), tuple(neck), color, (4.0 if is_hot else 2.5) * scale)
        wings = neck + 5.0 * scale * across, neck - 5.0 * scale * across
        pen.list.add_triangle_filled(tuple(tip), tuple(wings[0]), tuple(wings[1]), color)


def _draw_text(state: AppState, pen: Pen, posed: PosedJoint) -> None:
    """Draw the result of the drag as text, with the limits that restrict it."""
    center, drag = pen.frame.place(posed.center), _drag(state)
    if center is None or drag is None or not drag.outcome.text:
        return
    lines = [(drag.outcome.text, (1.0, 1.0, 1.0, 1.0))]
    limits = limit_text(posed.skeleton, drag.outcome.limited)
    if limits:
        lines.append((limits, (*_LIMIT, 1.0)))
    away = 1.2 * RADIUS + _GAP if state.of(Posing).tool == "rotate" else 2.0 * _GAP
    corner = (center[0] + away * pen.scale, center[1] - 2.0 * _GAP * pen.scale)
    text_box(state, pen, corner, lines)


def text_box(
    state: AppState, pen: Pen, corner: tuple[float, float], lines: Sequence[tuple[str, _Color]]
) -> None:
    """Draw lines of text on a dark background, within the view."""
    x, y, width, height = state.view_rect
    sizes = [imgui.calc_text_size(text) for text, _ in lines]
    wide, high = max(size.x for size in sizes), sum(size.y for size in sizes)
    left = max(min(corner[0], x + width - wide - _GAP), x + 6.0)
    top = max(min(corner[1], y + height - high - _GAP), y + 6.0)
    tools = state.item_rects.get("##tools")
    if tools is not None and left + wide > tools[0] - _GAP and tools[1] - high < top < tools[3]:
        top = tools[3] + _GAP
    ground = imgui.get_color_u32((0.05, 0.05, 0.06, 0.8))
    pen.list.add_rect_filled((left - 5, top - 3), (left + wide + 5, top + high + 3), ground, 3.0)
    for (text, color), size in zip(lines, sizes, strict=True):
        pen.list.add_text((left, top), imgui.get_color_u32(color), text)
        top += size.y


def limit_arcs(joint: PosedJoint, pose: Pose) -> list[_LimitArc]:
    """Return an arc for each free rotation DOF with two finite limits."""
    skeleton, found = joint.skeleton, []
    axes = rotation_axes(skeleton, pose, joint.joint)
    for dof in rotation_dofs(skeleton, joint.joint, free=True).tolist():
        low, high = skeleton.dof_limits[dof]
        if not np.isfinite([low, high]).all():
            continue
        axis = joint.rotation_axis(axes[dof])
        value = min(max(float(pose.dofs[dof]), float(low)), float(high))
        below, above = float(low) - value, float(high) - value
        is_limited = min(-below, above) <= _ROUNDING
        color = int(skeleton.dof_kinds[dof]) - 3
        start = _present(joint, axis, color)
        found.append(_LimitArc(dof, color, axis, start, below, above, is_limited))
    return found


def _present(joint: PosedJoint, axis: Floats, kind: int) -> Floats:
    """Return the direction perpendicular to an axis that shows the rotation about it."""
    own = joint.axes("local")
    across = _without(_bone(joint), axis)
    if np.linalg.norm(across) < _ALONG:
        # The squared projections of the joint's other two axes sum to at least 1. The first is used
        # unless it is the short one: of two equal ones, rounding must not choose.
        first, second = (_without(own[:, (kind + k) % 3], axis) for k in (1, 2))
        across = first if first @ first >= 0.5 else second
    return unit(across)


def _without(vector: Floats, axis: Floats) -> Floats:
    return np.asarray(vector - (vector @ axis) * axis)


def _bone(joint: PosedJoint) -> Floats:
    """Return the vector from a joint to the middle of its children, or of a leaf's box."""
    skeleton, index = joint.skeleton, joint.joint
    children = np.flatnonzero(skeleton.parents == index)
    if len(children):
        away = joint.world[children, :3, 3].mean(axis=0) - joint.center
    elif skeleton.boxes is not None:
        away = joint.world[index, :3, :3] @ skeleton.boxes[index].mean(axis=0)
    else:
        parent = int(skeleton.parents[index])
        away = joint.center - joint.world[parent, :3, 3] if parent >= 0 else np.zeros(3)
    return unit(away)


def arc_points(arc: _LimitArc, center: Floats, radius: float) -> Floats:
    """Return points (N, 3) of the scene along an arc from its low to its high end."""
    low, high = arc.low, min(arc.high, arc.low + _WHOLE)
    count = max(2, math.ceil((high - low) / _STEP) + 1)
    angles = np.linspace(low, high, count)[:, None]
    across = np.cross(arc.axis, arc.start)
    return np.asarray(center + radius * (np.cos(angles) * arc.start + np.sin(angles) * across))
