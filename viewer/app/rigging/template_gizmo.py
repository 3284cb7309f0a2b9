"""Gizmo that moves the template over the target: ImGuizmo with a custom ring for scaling.

ImGuizmo rotates and translates a matrix in float32, so its results are projected back to
similarities. Its scale handles cannot be grabbed from a distance, so a plain ring replaces them.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from imgui_bundle import imgui, imguizmo

from viewer.app.core.state import AppState
from viewer.app.core.view_frame import view_frame
from viewer.app.rigging.placing import (
    as_similarity,
    move_by_hand,
    posed_template,
    similarity_now,
    target_place,
)
from viewer.app.rigging.state import Rigging, Template
from viewer.rig.arrays import Floats
from viewer.rig.geometry.transform import apply_transform, translation_matrix
from viewer.rig.mesh import bounding_box

__all__ = ["RADIUS", "use_gizmo"]

RADIUS = 80.0
"""Radius of the scaling ring, window coordinates."""

_G = imguizmo.im_guizmo
_OPERATIONS = {"move": _G.OPERATION.translate, "rotate": _G.OPERATION.rotate}
_SIZE = 0.22  # size of the gizmo, in clip space
_FAR = 50.0  # eye distance of the substitute for a parallel projection, in half heights of the view
_REACH = 8.0  # distance within which the ring can be grabbed, window coordinates
_LEAST = 0.02  # minimum factor: dragging to the centre must not make the template vanish
_INK, _HOT = (0.92, 0.92, 0.92, 0.9), (1.0, 0.92, 0.55, 1.0)


def use_gizmo(state: AppState, template: Template) -> None:
    """Draw the handles at the centre of the template, and apply their movement.

    Parameters
    ----------
    state : AppState
        State with a target, and a tool other than landmarks.
    template : Template
        Template in its current pose.
    """
    view = state.of(Rigging)
    assert view.target is not None  # checked by the caller
    place = target_place(view.target)
    middle = bounding_box(posed_template(view, template).positions).mean(axis=0)
    now = similarity_now(state, template)
    before = place @ now.matrix @ translation_matrix(middle)
    after = _scaled(state, before) if view.tool == "scale" else _manipulated(state, before)
    if after is not None:
        moved = np.linalg.inv(place) @ after @ translation_matrix(-middle)
        placed = as_similarity(moved, now)
        # The residual of a removed shear must not displace the template from frame to frame.
        slip = apply_transform(moved, middle) - placed.apply(middle)
        move_by_hand(state, template, replace(placed, shift=placed.shift + slip))
        view.was_dragged = True


def _manipulated(state: AppState, before: Floats) -> Floats | None:
    """Return the matrix as moved by ImGuizmo; None if it is unchanged."""
    view = state.of(Rigging)
    size = float(np.cbrt(np.linalg.det(before[:3, :3])))
    rigid = before.copy()
    rigid[:3, :3] /= size  # the size of the handles does not depend on that of the template
    now = _matrix(rigid)
    _G.begin_frame()
    _G.set_drawlist(imgui.get_background_draw_list())
    _G.set_rect(*view_frame(state).rect)
    _G.set_orthographic(False)
    _G.set_gizmo_size_clip_space(_SIZE)
    seen, projection = map(_matrix, _camera_matrices(state, before[:3, 3]))
    changed = _G.manipulate(seen, projection, _OPERATIONS[view.tool], _G.MODE.world, now)
    hovers = _G.get_hovered_handle_type() != _G.MOVETYPE.mt_none
    view.holds_mouse = _G.is_using() or (hovers and not imgui.get_io().want_capture_mouse)
    # ImGuizmo reports another change on release, which would become another undo step.
    if not changed or not imgui.is_mouse_down(imgui.MouseButton_.left):
        return None
    after = np.array(now.values, dtype=np.float64).reshape(4, 4).T
    after[:3, :3] *= size
    return after


def _camera_matrices(state: AppState, middle: Floats) -> tuple[Floats, Floats]:
    """Return view and projection for ImGuizmo: both (4, 4).

    ImGuizmo computes wrong rays for parallel projections. They are replaced by a perspective from
    far away, which projects points at the depth of the gizmo's centre to the same positions, and
    points near it to almost the same positions.
    """
    camera = state.camera
    view = camera.view_matrix()
    if not camera.is_parallel:
        return view, camera.projection_matrix(state.aspect, state.box)
    half = camera.half_height
    away, depth = _FAR * half, float(view[2, :3] @ middle + view[2, 3])
    near, far = 0.5 * away, 1.5 * away
    projection = np.zeros((4, 4))
    projection[[0, 1], [0, 1]] = _FAR / state.aspect, _FAR
    projection[2, 2:] = -(far + near) / (far - near), -2.0 * far * near / (far - near)
    projection[3, 2] = -1.0
    return translation_matrix(np.array([0.0, 0.0, -away - depth])) @ view, projection


def _matrix(values: Floats) -> imguizmo.im_guizmo.Matrix16:
    """Return a matrix in ImGuizmo's column-major layout."""
    return _G.Matrix16([float(value) for value in values.T.ravel()])


def _scaled(state: AppState, before: Floats) -> Floats | None:
    """Return a matrix scaled by dragging the ring; None if it is unchanged."""
    view, io, frame = state.of(Rigging), imgui.get_io(), view_frame(state)
    center = frame.place(before[:3, 3])
    if center is None:
        view.holds_mouse, view.scaling = False, None
        return None
    distance = math.hypot(io.mouse_pos.x - center[0], io.mouse_pos.y - center[1])
    left = imgui.MouseButton_.left
    if not imgui.is_mouse_down(left):
        view.scaling = None
    hovers = abs(distance - RADIUS) < _REACH and not io.want_capture_mouse
    if view.scaling is None and hovers and imgui.is_mouse_clicked(left):
        view.scaling = distance, float(np.cbrt(np.linalg.det(before[:3, :3])))
    view.holds_mouse = view.scaling is not None or hovers
    _draw_ring(center, distance if view.scaling else RADIUS, view.holds_mouse)
    if view.scaling is None or not imgui.is_mouse_pos_valid():
        return None
    first, size = view.scaling
    after = before.copy()
    now = float(np.cbrt(np.linalg.det(before[:3, :3])))
    after[:3, :3] *= size * max(distance / first, _LEAST) / now
    return after if (after != before).any() else None


def _draw_ring(center: tuple[float, float], radius: float, is_hot: bool) -> None:
    """Draw the ring, with squares that indicate that it can be dragged outwards or inwards."""
    ink, color = imgui.get_background_draw_list(), imgui.get_color_u32(_HOT if is_hot else _INK)
    ink.add_circle(center, radius, color, 64, 3.0 if is_hot else 2.0)
    for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1)):
        middle = center[0] + radius * x, center[1] + radius * y
        low, high = (middle[0] - 5.0, middle[1] - 5.0), (middle[0] + 5.0, middle[1] + 5.0)
        ink.add_rect_filled(low, high, color)
