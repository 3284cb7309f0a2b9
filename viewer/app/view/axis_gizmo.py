"""Axis gizmo in the lower right corner of the view: a click looks along an axis, a drag orbits.

It is drawn behind the panels over the scene's image, and does not appear in saved images.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.core.widgets import Rect
from viewer.app.view.camera_panel import fly_to
from viewer.data_classes import dataclass
from viewer.rendering.camera import VIEWS, NamedView, camera_axes, look_from, orbit

_COLORS = ((0.93, 0.33, 0.31), (0.47, 0.80, 0.29), (0.30, 0.55, 0.96))
_USUAL_FONT = 15.0
_RADIUS, _ARM, _END = 40.0, 31.0, 8.5  # radii of the disc, of the arms and of their ends, points
_GAP, _ABOVE = 8.0, 28.0  # points to the right edge, and to the lower edge with the hints
_NARROWEST, _LOWEST = 240.0, 200.0  # points: smaller views have no room for the gizmo
_DEGREES_PER_POINT = 0.9
_LEFT = imgui.MouseButton_.left
_SAME = 1e-6  # tolerance for equal directions


@dataclass(slots=True)
class AxisGizmo:
    """State of the gizmo."""

    is_shown: bool = True
    """Whether it is drawn."""
    is_held: bool = False
    """Whether a press began on it and the button is still down."""


class _End(NamedTuple):
    """End of an arm: its axis, sign, window position, and depth towards the eye."""

    axis: int
    sign: int
    x: float
    y: float
    depth: float


def holds_gizmo(state: AppState) -> bool:
    """Handle the mouse input of this frame; return whether it belongs to the gizmo."""
    gizmo, io = state.of(AxisGizmo), imgui.get_io()
    if gizmo.is_held:
        _go_on(state, gizmo)
        return True
    if io.want_capture_mouse or not is_over_gizmo(state):
        return False
    gizmo.is_held = imgui.is_mouse_clicked(_LEFT)
    # The wheel also zooms here.
    return not io.mouse_wheel


def _go_on(state: AppState, gizmo: AxisGizmo) -> None:
    """Orbit while the pointer moves; a click looks along the axis under the pointer."""
    io = imgui.get_io()
    has_moved = io.mouse_drag_max_distance_sqr[_LEFT] >= io.mouse_drag_threshold**2
    delta = imgui.get_mouse_drag_delta(_LEFT) if has_moved else imgui.ImVec2(0.0, 0.0)
    if delta.x or delta.y:
        imgui.reset_mouse_drag_delta(_LEFT)
        state.camera.fixed = None
        orbit(state.camera, -_DEGREES_PER_POINT * delta.x, _DEGREES_PER_POINT * delta.y)
    if not imgui.is_mouse_down(_LEFT):
        gizmo.is_held = False
        end = None if has_moved else _end_at(state, (io.mouse_pos.x, io.mouse_pos.y))
        if end is not None:
            name = _named(state, end)
            fly_to(state, name)
            state.say_status(f"{name.capitalize()} view")


def draw_axis_gizmo(state: AppState) -> None:
    """Draw the axes as seen by the camera; axes that point towards the eye are drawn last."""
    center, rect = _center(state), gizmo_rect(state)
    if center is None or rect is None:
        return
    (x, y), unit = center, _unit()
    state.item_rects["axis gizmo"] = rect
    pen, is_over = imgui.get_background_draw_list(), _is_free(state) and is_over_gizmo(state)
    if is_over:
        pen.add_circle_filled((x, y), _RADIUS * unit, imgui.get_color_u32((1.0, 1.0, 1.0, 0.16)))
    mouse = imgui.get_io().mouse_pos
    hot = _end_at(state, (mouse.x, mouse.y)) if is_over else None
    for end in sorted(_ends(state), key=lambda one: one.depth):
        _draw_end(end, (x, y), unit, hot is not None and hot[:2] == end[:2])
    if hot is not None:
        imgui.set_tooltip(f"{_named(state, hot).capitalize()} view; drag orbits")


def gizmo_rect(state: AppState) -> Rect | None:
    """Return the rectangle of the gizmo, window coordinates; None if it is not shown."""
    center = _center(state)
    if center is None:
        return None
    (x, y), reach = center, _RADIUS * _unit()
    return x - reach, y - reach, x + reach, y + reach


def _draw_end(end: _End, center: tuple[float, float], unit: float, is_hot: bool) -> None:
    """Draw an arm of a positive axis with its letter, or a ring for a negative one."""
    pen = imgui.get_background_draw_list()
    # Arms that point away from the eye are darker.
    light = 0.72 + 0.28 * (0.5 + 0.5 * end.depth)
    r, g, b = (channel * light for channel in _COLORS[end.axis])
    place, radius = (end.x, end.y), _END * unit
    if end.sign > 0:
        pen.add_line(center, place, imgui.get_color_u32((r, g, b, 1.0)), 2.5 * unit)
        pen.add_circle_filled(place, radius, imgui.get_color_u32((r, g, b, 1.0)))
    else:
        pen.add_circle_filled(place, 0.8 * radius, imgui.get_color_u32((r, g, b, 0.35)))
        pen.add_circle(place, 0.8 * radius, imgui.get_color_u32((r, g, b, 1.0)), 0, 1.5 * unit)
    if is_hot:
        pen.add_circle(place, radius, imgui.get_color_u32((1.0, 1.0, 1.0, 1.0)), 0, 2.0 * unit)
    if end.sign > 0 or is_hot:
        text = ("" if end.sign > 0 else "-") + "XYZ"[end.axis]
        size = 0.85 * imgui.get_font_size()
        extent = imgui.calc_text_size(text)
        corner = (place[0] - 0.425 * extent.x, place[1] - 0.425 * extent.y)
        shade = (0.05, 0.06, 0.08, 1.0) if end.sign > 0 else (1.0, 1.0, 1.0, 1.0)
        ink = imgui.get_color_u32(shade)
        pen.add_text(imgui.get_font(), size, corner, ink, text)


def _unit() -> float:
    """Return the size of one point, which scales with the font."""
    return imgui.get_font_size() / _USUAL_FONT


def _center(state: AppState) -> tuple[float, float] | None:
    """Return the centre of the gizmo; None if it is not shown."""
    x, y, width, height = state.view_rect
    unit = _unit()
    is_small = width < _NARROWEST * unit or height < _LOWEST * unit
    if is_small or not state.panels_visible or not state.of(AxisGizmo).is_shown:
        return None
    return x + width - (_GAP + _RADIUS) * unit, y + height - (_ABOVE + _RADIUS) * unit


def _is_free(state: AppState) -> bool:
    """Return whether the pointer is over the view and not dragging anything else."""
    is_down = any(imgui.get_io().mouse_down[button] for button in range(3))
    is_held = state.of(AxisGizmo).is_held
    return is_held or not (is_down or imgui.get_io().want_capture_mouse)


def is_over_gizmo(state: AppState) -> bool:
    """Return whether the pointer is over the gizmo."""
    center, mouse = _center(state), imgui.get_io().mouse_pos
    if center is None or not imgui.is_mouse_pos_valid():
        return False
    return bool(np.hypot(mouse.x - center[0], mouse.y - center[1]) <= _RADIUS * _unit())


def _ends(state: AppState) -> list[_End]:
    """Return both ends of all axes of the scene."""
    center = _center(state)
    if center is None:
        return []
    rotation, reach = state.camera.rotation(), _ARM * _unit()
    found = []
    for axis in range(3):
        right, up, depth = rotation[:, axis].tolist()
        for sign in (1, -1):
            x, y = center[0] + sign * reach * right, center[1] - sign * reach * up
            found.append(_End(axis, sign, x, y, sign * depth))
    return found


def _end_at(state: AppState, place: tuple[float, float]) -> _End | None:
    """Return the end of an axis at a window position; of several ends, the nearest to the eye."""
    reach = (_END + 2.0) * _unit()
    near = [e for e in _ends(state) if np.hypot(e.x - place[0], e.y - place[1]) <= reach]
    return max(near, key=lambda end: end.depth, default=None)


def _named(state: AppState, end: _End) -> NamedView:
    """Return the named view from an end; the opposite view if the camera is already there."""
    sides = {}
    for name in VIEWS:
        camera = state.camera.copy()
        camera.fixed = None
        look_from(camera, name)
        backward = camera_axes(camera)[2]
        axis = int(np.abs(backward).argmax())
        sides[axis, int(np.sign(backward[axis]))] = name, backward
    name, backward = sides[end.axis, end.sign]
    is_there = np.abs(state.camera.view_matrix()[2, :3] - backward).max() < _SAME
    return sides[end.axis, -end.sign][0] if is_there else name
