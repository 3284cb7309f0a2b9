"""The gizmo that moves the template over the target: ImGuizmo's, and a ring of our own.

ImGuizmo turns and moves a matrix. It counts in float32: what it gives is made a similarity again.
Its handles for scaling cannot be taken hold of from far away, so for that there is a plain ring.
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
"""Of the ring that scales, window coordinates."""

_G = imguizmo.im_guizmo
_OPERATIONS = {"move": _G.OPERATION.translate, "rotate": _G.OPERATION.rotate}
_SIZE = 0.22  # of the gizmo, in clip space
_FAR = 50.0  # half heights of the view, from where a parallel one is looked at
_REACH = 8.0  # window coordinates around the ring in which it is taken
_LEAST = 0.02  # of a scale: the pointer on the middle must not make the template vanish
_INK, _HOT = (0.92, 0.92, 0.92, 0.9), (1.0, 0.92, 0.55, 1.0)


def use_gizmo(state: AppState, template: Template) -> None:
    """Draw the handles in the middle of the template, and take over what they did.

    Parameters
    ----------
    state : AppState
        With a target, and a tool other than landmarks.
    template : Template
        As it is now.
    """
    view = state.of(Rigging)
    assert view.target is not None  # the caller looked
    place = target_place(view.target)
    middle = bounding_box(posed_template(view, template).positions).mean(axis=0)
    now = similarity_now(state, template)
    before = place @ now.matrix @ translation_matrix(middle)
    after = _scaled(state, before) if view.tool == "scale" else _manipulated(state, before)
    if after is not None:
        moved = np.linalg.inv(place) @ after @ translation_matrix(-middle)
        laid = as_similarity(moved, now)
        # What is left of a shear must not push the template aside, frame by frame.
        slip = apply_transform(moved, middle) - laid.apply(middle)
        move_by_hand(state, template, replace(laid, shift=laid.shift + slip))
        view.was_dragged = True


def _manipulated(state: AppState, before: Floats) -> Floats | None:
    """Return where ImGuizmo has moved a matrix, None if it stays."""
    view = state.of(Rigging)
    size = float(np.cbrt(np.linalg.det(before[:3, :3])))
    rigid = before.copy()
    rigid[:3, :3] /= size  # the handles' reach must not grow with the template
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
    # It reports a change once more when it was let go of: that would be another step of undoing.
    if not changed or not imgui.is_mouse_down(imgui.MouseButton_.left):
        return None
    after = np.array(now.values, dtype=np.float64).reshape(4, 4).T
    after[:3, :3] *= size
    return after


def _camera_matrices(state: AppState, middle: Floats) -> tuple[Floats, Floats]:
    """Return view and projection for ImGuizmo: (4, 4) both.

    Its rays go astray in parallel projections. A perspective from far away shows what is as deep
    in the view as the gizmo's middle at the same place, and what is near it almost so.
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
    """Return a matrix as ImGuizmo has them: column by column."""
    return _G.Matrix16([float(value) for value in values.T.ravel()])


def _scaled(state: AppState, before: Floats) -> Floats | None:
    """Return a matrix scaled by what the ring around its middle was drawn out; None if it stays."""
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
    """Draw the ring, and squares that say that it is drawn out or in."""
    ink, color = imgui.get_background_draw_list(), imgui.get_color_u32(_HOT if is_hot else _INK)
    ink.add_circle(center, radius, color, 64, 3.0 if is_hot else 2.0)
    for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1)):
        middle = center[0] + radius * x, center[1] + radius * y
        low, high = (middle[0] - 5.0, middle[1] - 5.0), (middle[0] + 5.0, middle[1] + 5.0)
        ink.add_rect_filled(low, high, color)
