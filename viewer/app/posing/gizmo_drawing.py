"""Drawing of the handles: joints, chain, limit arcs, rings, arrows, and their labels.

Like the image of the scene, they are drawn behind the panels, so they must be drawn after it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from imgui_bundle import ImVec2Like, imgui

from viewer.app.core.state import AppState
from viewer.app.core.view_frame import ViewFrame, view_frame
from viewer.app.posing.gizmo import handle_at, joint_at, joint_places
from viewer.app.posing.limit_arcs import LimitArc, arc_points, limit_arcs
from viewer.app.posing.move_tool import LENGTH, Arrow, MoveHandle, ReachHandle, arrows, used_chain
from viewer.app.posing.posed_joint import PosedJoint
from viewer.app.posing.rotate_tool import (
    RADIUS,
    Ring,
    RotateHandle,
    circle,
    limit_text,
    rings,
    toward_eye,
)
from viewer.app.posing.state import Drag, Handle, Posing
from viewer.app.posing.tool_actions import no_tool, selected
from viewer.rig.arrays import Floats
from viewer.rig.geometry.rotation import rotation_vector_to_matrix
from viewer.rig.skeleton import joint_label

__all__ = ["draw_gizmo"]

Color: TypeAlias = tuple[float, float, float, float]

_AXES = ((0.98, 0.36, 0.33), (0.45, 0.86, 0.38), (0.36, 0.60, 1.0), (0.92, 0.92, 0.92))
_HOT = (1.0, 0.92, 0.55)
_LIMIT = (1.0, 0.70, 0.10)
_CHAIN = (0.45, 0.90, 0.95)
_BEHIND = 0.28  # opacity of the far side of a ring
_MOST_DOTS = 300  # maximum number of joints for which dots are drawn
_ARC_RADIUS = 0.62  # radius of an arc, relative to that of the rings
_GAP = 10.0  # points between a ring and its text


class _Pen:
    """Draws points of the scene as lines in the window; sizes are in points."""

    def __init__(self, frame: ViewFrame) -> None:
        self.frame, self.list = frame, imgui.get_background_draw_list()
        self.scale = frame.scale

    def line(self, points: Floats, color: Color, thickness: float) -> None:
        """Draw a line through (N, 3) points, unless one of them is behind the eye."""
        seen = self.frame.project(points)
        if np.isfinite(seen).all():
            ink = imgui.get_color_u32(color)
            self.list.add_polyline(
                [(x, y) for x, y in seen.tolist()], ink, thickness * self.scale, 0
            )

    def fan(self, center: Floats, points: Floats, color: Color) -> None:
        """Fill the area between a point and a polyline."""
        seen, middle = self.frame.project(points), self.frame.place(center)
        if middle is None or not np.isfinite(seen).all():
            return
        rows: list[ImVec2Like] = [imgui.ImVec2(x, y) for x, y in [middle, *seen.tolist()]]
        self.list.add_concave_poly_filled(rows, imgui.get_color_u32(color))

    def dot(self, point: Floats, radius: float, color: Color, filled: bool = True) -> None:
        """Draw a disc, or a circle, around a point."""
        place = self.frame.place(point)
        if place is None:
            return
        ink = imgui.get_color_u32(color)
        if filled:
            self.list.add_circle_filled(place, radius * self.scale, ink)
        else:
            self.list.add_circle(place, radius * self.scale, ink, 0, 2.0 * self.scale)


def draw_gizmo(state: AppState) -> None:
    """Draw the handles of the chosen tool over the scene."""
    posing = state.of(Posing)
    x, y, width, height = state.view_rect
    if not posing.is_on or min(width, height) < 40.0 or no_tool(state):
        return
    pen, posed = _Pen(view_frame(state)), selected(state)
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


def _draw_joints(state: AppState, pen: _Pen) -> None:
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
        _text_box(
            state,
            pen,
            (x + 12.0 * one, y - 8.0 * one),
            [(joint_label(skeleton, under), (1, 1, 1, 1))],
        )


def _draw_arcs(state: AppState, pen: _Pen, posed: PosedJoint) -> None:
    """Draw the limits of the joint's rotations."""
    assert state.actor.pose is not None  # limits imply a posed joint
    unit = pen.frame.unit_length(posed.center)
    found = limit_arcs(posed, state.actor.pose)
    for rank, arc in enumerate(found):
        # Each arc is a little smaller than the previous one, because axes may coincide.
        _draw_arc(pen, posed.center, arc, (_ARC_RADIUS - 0.07 * rank) * RADIUS * unit)


def _draw_arc(pen: _Pen, center: Floats, arc: LimitArc, radius: float) -> None:
    color = _AXES[arc.color]
    points = arc_points(arc, center, radius)
    pen.fan(center, points, (*color, 0.10))
    pen.line(points, (*color, 0.85), 2.0)
    for end in (points[0], points[-1]):
        pen.line(np.stack([center, end]), (*color, 0.55), 1.0)
    present = center + 1.08 * radius * arc.start
    ink = (*_LIMIT, 1.0) if arc.is_limited else (*color, 1.0)
    pen.line(np.stack([center, present]), ink, 2.5)
    pen.dot(present, 3.5, ink)


def _draw_rings(state: AppState, pen: _Pen, posed: PosedJoint, hot: Handle | None) -> None:
    """Draw the rings of the joint; during a drag, draw only the grabbed ring and the angle."""
    drag, pose = _drag(state), state.actor.pose
    if drag is not None and isinstance(drag.handle, RotateHandle):
        _draw_rotation(pen, posed, drag.handle, drag.outcome.angle or 0.0)
        return
    assert pose is not None  # limits imply a posed joint
    under = hot.ring if isinstance(hot, RotateHandle) else None
    for ring in rings(posed, pose, state.of(Posing).orientation, pen.frame):
        is_hot = under is not None and (ring.color, ring.dof) == (under.color, under.dof)
        _draw_ring(pen, posed.center, ring, is_hot)


def _draw_ring(pen: _Pen, center: Floats, ring: Ring, is_hot: bool) -> None:
    """Draw a ring, with a faint far side."""
    unit, eye = pen.frame.unit_length(center), toward_eye(pen.frame, center)
    points = circle(center, ring.axis, ring.size * unit)
    color, thickness = (_HOT, 4.0) if is_hot else (_AXES[ring.color], 2.5)
    if ring.color == 3:
        pen.line(points, (*color, 1.0 if is_hot else 0.6), thickness - 1.0)
        return
    in_front = (points - center) @ eye >= -1e-9
    for run in _runs(in_front):
        opacity = 1.0 if in_front[run[len(run) // 2]] else _BEHIND
        pen.line(points[run], (*color, opacity), thickness)


def _runs(flags: np.ndarray) -> list[list[int]]:
    """Split indices where a flag changes; adjacent runs share an index, so that lines meet."""
    edges = [0, *(np.flatnonzero(np.diff(flags)) + 1).tolist(), len(flags)]
    pairs = pairwise(edges)
    return [list(range(first, min(last + 1, len(flags)))) for first, last in pairs]


def _draw_rotation(pen: _Pen, posed: PosedJoint, handle: RotateHandle, angle: float) -> None:
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


def _draw_chain(state: AppState, pen: _Pen, posed: PosedJoint) -> None:
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


def _draw_arrows(state: AppState, pen: _Pen, posed: PosedJoint, hot: Handle | None) -> None:
    """Draw the handle at the joint, and the arrows along which it is translated."""
    drag = _drag(state)
    held = drag.handle if drag is not None else hot
    arrow = held.arrow if isinstance(held, MoveHandle) else None
    is_middle = isinstance(held, ReachHandle) or (isinstance(held, MoveHandle) and arrow is None)
    pen.dot(posed.center, 8.0, (*(_HOT if is_middle else _AXES[3]), 1.0), filled=False)
    for one in arrows(posed, state.of(Posing).orientation):
        is_hot = arrow is not None and arrow.color == one.color
        _draw_arrow(pen, posed.center, one, is_hot)


def _draw_arrow(pen: _Pen, center: Floats, arrow: Arrow, is_hot: bool) -> None:
    color: Color = (*(_HOT if is_hot else _AXES[arrow.color]), 1.0)
    unit = pen.frame.unit_length(center)
    ends = pen.frame.project(np.stack([center, center + LENGTH * unit * arrow.axis]))
    way = ends[1] - ends[0]
    size = float(np.linalg.norm(way))
    one = pen.scale
    if not np.isfinite(size) or size < 12.0 * one:
        return
    along, across = way / size, np.array([-way[1], way[0]]) / size
    tip, foot = ends[1], ends[0] + 9.0 * one * along
    neck = tip - 11.0 * one * along
    ink = imgui.get_color_u32(color)
    pen.list.add_line(tuple(foot), tuple(neck), ink, (4.0 if is_hot else 2.5) * one)
    pen.list.add_triangle_filled(
        tuple(tip), tuple(neck + 5.0 * one * across), tuple(neck - 5.0 * one * across), ink
    )


def _draw_text(state: AppState, pen: _Pen, posed: PosedJoint) -> None:
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
    _text_box(state, pen, corner, lines)


def _text_box(
    state: AppState, pen: _Pen, corner: tuple[float, float], lines: Sequence[tuple[str, Color]]
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
