"""Tools to move the template by hand, and the update of the Rig panel in each frame.

The gizmo is ImGuizmo with a custom ring for scaling. ImGuizmo rotates and translates a matrix in
float32, so its results are projected back to similarities. Its scale handles cannot be grabbed from
a distance, so a plain ring replaces them.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from imgui_bundle import imgui, imguizmo

from viewer.app.core.camera_moves import fit_points
from viewer.app.core.reasons import no_job_room
from viewer.app.core.state import AppState
from viewer.app.core.view_frame import view_frame
from viewer.app.posing.gizmo import Pen
from viewer.app.posing.posing import Posing
from viewer.app.rigging.placing import (
    aligned_template,
    as_similarity,
    ghost_of,
    ghost_place,
    move_by_hand,
    placing_now,
    posed_template,
    set_aside,
    similarity_now,
    target_place,
)
from viewer.app.rigging.rigging import (
    TOOLS,
    Landmark,
    Rigging,
    RigTool,
    Template,
    no_placing,
    refresh,
    target_mesh,
)
from viewer.app.rigging.work import finish_work, start_align, start_reading
from viewer.app.view.hovering import Picking
from viewer.autorig.alignment.pose_fit import FittedJoints
from viewer.rendering.passes.ghost_pass import Ghost
from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.ray_hit import RayHit, first_hit, surface_point
from viewer.rigs.geometry.transform import apply_transform, translation_matrix
from viewer.rigs.mesh import Mesh, bounding_box

_TEMPLATE_INK, _TARGET_INK = (0.35, 0.70, 1.0, 1.0), (1.0, 0.75, 0.30, 1.0)
_TRIED_INK = (0.35, 0.70, 1.0, 0.35)  # joints of a fit that is only tried
_RIM = (0.0, 0.0, 0.0, 0.8)
_DOT = 5.0  # radius, window coordinates
RADIUS = 80.0
"""Radius of the scaling ring, window coordinates."""
_G = imguizmo.im_guizmo
_OPERATIONS = {"move": _G.OPERATION.translate, "rotate": _G.OPERATION.rotate}
_SIZE = 0.22  # size of the gizmo, in clip space
_FAR = 50.0  # eye distance of the substitute for a parallel projection, in half heights of the view
_REACH = 8.0  # distance within which the ring can be grabbed, window coordinates
_LEAST = 0.02  # minimum factor: dragging to the centre must not make the template vanish
_INK, _HOT = (0.92, 0.92, 0.92, 0.9), (1.0, 0.92, 0.55, 1.0)


def choose_rig_tool(state: AppState, tool: RigTool) -> None:
    """Choose a tool to move the template."""
    view = state.of(Rigging)
    if tool and no_placing(state):
        state.say_status(no_placing(state))
        return
    if tool and aligned_template(state) is None:
        start_reading(state)
        return
    state.of(Posing).tool = "select"
    view.tool, view.pending, view.holds_mouse = tool, None, False
    if tool == "landmarks":
        _show_both(state)
    if tool:
        state.say_status(f"{TOOLS[tool][0]}: {TOOLS[tool][1]}")


def drop_rig_tool(state: AppState) -> bool:
    """Discard an incomplete pair of landmarks, or deselect the tool; return whether it did so."""
    view = state.of(Rigging)
    if view.pending is not None:
        view.pending = None
        return True
    had_one, view.tool, view.holds_mouse = bool(view.tool), "", False
    return had_one


def holds_mouse(state: AppState) -> bool:
    """Return whether the gizmo uses the mouse, in which case a drag does not orbit."""
    return state.of(Rigging).holds_mouse


def show_rig(state: AppState) -> Ghost | None:
    """Apply finished jobs and clicks of the Rig panel; return the template if it is to be drawn."""
    refresh(state)
    finish_work(state)
    view = state.of(Rigging)
    if view.target is None or aligned_template(state) is None:
        view.tool = ""
    if not view.tool:
        view.holds_mouse = False
    elif view.tool == "landmarks":
        _take_click(state)
    _measure(state)
    view.shown = ghost_of(state)
    return view.shown


def _measure(state: AppState) -> None:
    """Measure the error of the template's placement once its handle is released."""
    view, placing = state.of(Rigging), placing_now(state)
    if not view.was_dragged or imgui.is_mouse_down(imgui.MouseButton_.left):
        return
    if placing is None:
        view.was_dragged = False
    elif not no_job_room(state):
        view.was_dragged = False
        start_align(state, placing.settings)


def draw_rig_tools(state: AppState) -> None:
    """Draw the gizmo or the landmarks over the viewport, and handle drags."""
    view, template = state.of(Rigging), aligned_template(state)
    x, y, width, height = state.view_rect
    _draw_found(state)
    if not view.tool or template is None or view.target is None or min(width, height) < 40.0:
        return
    ink = imgui.get_background_draw_list()
    ink.push_clip_rect((x, y), (x + width, y + height), True)
    if view.tool == "landmarks":
        _draw_landmarks(state, template)
    else:
        _use_gizmo(state, template)
    ink.pop_clip_rect()


def _draw_found(state: AppState) -> None:
    """Draw the joints of a template that is being fitted, inside the mesh."""
    running, (x, y, width, height) = state.of(Rigging).running, state.view_rect
    found = None if running is None or running.job is None else running.job.found
    if running is None or running.target is None or not isinstance(found, FittedJoints):
        return
    if not any(running.target is actor for actor in state.scene.actors):
        return  # another file was opened meanwhile, or the target was removed
    pen = Pen(view_frame(state))
    places = apply_transform(target_place(running.target), found.places)
    ink = _TEMPLATE_INK if found.is_chosen else _TRIED_INK
    pen.list.push_clip_rect((x, y), (x + width, y + height), True)
    for joint, parent in enumerate(found.parents.tolist()):
        if parent >= 0:
            pen.line(places[[parent, joint]], ink, 2.0)
        pen.dot(places[joint], 3.0, ink)
    pen.list.pop_clip_rect()


def _show_both(state: AppState) -> None:
    """Show the template next to the target, and fit the view to both."""
    view, template = state.of(Rigging), aligned_template(state)
    if template is None or view.target is None:
        return
    set_aside(state)
    mesh = posed_template(view, template)
    points = (
        apply_transform(ghost_place(state, template), mesh.positions),
        apply_transform(target_place(view.target), target_mesh(state).positions),
    )
    fit_points(state, np.concatenate(points))


def _take_click(state: AppState) -> None:
    """Use a click for a landmark: on the template first, then on the target."""
    picking, view, template = state.of(Picking), state.of(Rigging), aligned_template(state)
    wanted = picking.wanted
    if wanted is None or wanted[2] or template is None:
        return
    picking.wanted = None
    x, y, _, _ = state.view_rect
    place = (wanted[0] + x, wanted[1] + y)
    if view.pending is None:
        mesh, matrix, what = (
            posed_template(view, template),
            ghost_place(state, template),
            "template",
        )
    else:
        assert view.target is not None  # tools need a target
        mesh, matrix, what = target_mesh(state), target_place(view.target), "target"
    # The ray is moved into the space of the mesh.
    origin, direction = view_frame(state).ray(place)
    back = np.asarray(np.linalg.inv(matrix), dtype=np.float64)
    hit = first_hit(
        mesh.positions,
        mesh.triangles,
        np.asarray(apply_transform(back, origin[None])[0]),
        back[:3, :3] @ direction,
    )
    if hit is None:
        state.say_status(f"Landmarks: click on the {what}")
    elif view.pending is None:
        view.pending = hit
        state.say_status("Landmarks: now the same point of the target")
    else:
        view.landmarks.append(Landmark(view.pending, hit))
        view.pending = None
        count = len(view.landmarks)
        state.say_status(f"{count} landmark{'s' * (count != 1)}")


def _draw_landmarks(state: AppState, template: Template) -> None:
    """Draw all pairs as numbered dots, and the first point of an incomplete pair."""
    view = state.of(Rigging)
    assert view.target is not None  # checked by the caller
    posed, place = posed_template(view, template), ghost_place(state, template)
    for number, pair in enumerate(view.landmarks, start=1):
        _draw_dot(state, posed, place, pair.template, str(number), _TEMPLATE_INK)
        _draw_dot(
            state, target_mesh(state), target_place(view.target), pair.target, str(number),
            _TARGET_INK,
        )  # fmt: skip
    if view.pending is not None:
        text = f"{len(view.landmarks) + 1}?"
        _draw_dot(state, posed, place, view.pending, text, _TEMPLATE_INK)


def _draw_dot(
    state: AppState,
    mesh: Mesh,
    matrix: Floats,
    hit: RayHit,
    text: str,
    color: tuple[float, float, float, float],
) -> None:
    point = surface_point(mesh.positions, mesh.triangles, hit)
    seen = view_frame(state).place(apply_transform(matrix, point[None])[0])
    if seen is None:
        return
    ink, rim = imgui.get_background_draw_list(), imgui.get_color_u32(_RIM)
    ink.add_circle_filled(seen, _DOT + 1.5, rim)
    ink.add_circle_filled(seen, _DOT, imgui.get_color_u32(color))
    for shift, shade in ((1.0, rim), (0.0, imgui.get_color_u32(color))):
        ink.add_text((seen[0] + _DOT + 3.0 + shift, seen[1] - 16.0 + shift), shade, text)


def _use_gizmo(state: AppState, template: Template) -> None:
    """Draw the handles at the centre of the template, and apply their movement."""
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
    """Return view and projection (4, 4) for ImGuizmo, whose rays are wrong for parallel ones."""
    camera = state.camera
    view = camera.view_matrix()
    if not camera.is_parallel:
        return view, camera.projection_matrix(state.aspect, state.box)
    # A perspective from far away projects points at the depth of the gizmo's centre to the same
    # positions, and points near it to almost the same positions: at a distance of _FAR half
    # heights, a focal length of _FAR maps the half height to 1.
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
    # Squares on the ring indicate that it can be dragged outwards or inwards.
    radius, ink = distance if view.scaling else RADIUS, imgui.get_background_draw_list()
    color = imgui.get_color_u32(_HOT if view.holds_mouse else _INK)
    ink.add_circle(center, radius, color, 64, 3.0 if view.holds_mouse else 2.0)
    for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1)):
        middle = center[0] + radius * x, center[1] + radius * y
        low, high = (middle[0] - 5.0, middle[1] - 5.0), (middle[0] + 5.0, middle[1] + 5.0)
        ink.add_rect_filled(low, high, color)
    if view.scaling is None or not imgui.is_mouse_pos_valid():
        return None
    first, size = view.scaling
    after = before.copy()
    now = float(np.cbrt(np.linalg.det(before[:3, :3])))
    after[:3, :3] *= size * max(distance / first, _LEAST) / now
    return after if (after != before).any() else None
