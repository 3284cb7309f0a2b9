"""Picking, dragging and releasing of handles in the view.

ImGuizmo rotates matrices about three orthogonal axes; joints here have one, two or three DOFs with
limits, about axes that may be oblique, so rings and arrows are custom.
"""

from __future__ import annotations

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.core.view_frame import Place, ViewFrame, view_frame
from viewer.app.posing.clip_pause import pause_for_edit
from viewer.app.posing.joint_tree import select_joint
from viewer.app.posing.move_tool import (
    MoveHandle,
    ReachHandle,
    arrows,
    grab_arrow,
    shifts,
    used_chain,
)
from viewer.app.posing.posed_joint import PosedJoint, posed_joint
from viewer.app.posing.rotate_tool import RotateHandle, grab_ring, rings
from viewer.app.posing.state import Drag, Handle, Outcome, Posing
from viewer.app.posing.tool_actions import cancel_drag, no_tool, selected
from viewer.rig.arrays import Floats
from viewer.rig.pose import Pose
from viewer.rig.skeleton import joint_label

__all__ = [
    "DOT_REACH",
    "choose_joint",
    "handle_at",
    "joint_at",
    "joint_places",
    "use_handles",
]

DOT_REACH = 14.0
"""Radius around a joint in which a click selects it, points."""

_BESIDE = 22.0  # distance in points from a handle within which a drag does not orbit
_STILL = 2.0  # maximum movement of the pointer during a click, window coordinates
_LEFT, _RIGHT = imgui.MouseButton_.left, imgui.MouseButton_.right


def use_handles(state: AppState) -> bool:
    """Begin, continue or end a drag; return whether a handle uses the mouse."""
    posing = state.of(Posing)
    io = imgui.get_io()
    place = (io.mouse_pos.x, io.mouse_pos.y)
    if posing.drag is not None:
        return _go_on(state, posing.drag, place)
    if posing.has_missed:
        return _end_miss(state)
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
    posing.drag = Drag(state.actor, handle, Outcome(_pose(state), ""))
    return True


def _go_on(state: AppState, drag: Drag, place: Place) -> bool:
    """Pose the actor by the pointer; a release ends the drag, the right button cancels it."""
    posing = state.of(Posing)
    if state.actor is not drag.actor or drag.actor.pose is not drag.outcome.pose:
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
    if drag.has_moved and imgui.is_mouse_pos_valid() and asked != drag.asked:
        drag.asked = asked
        drag.outcome = drag.handle.follow(frame, place, snaps)
        drag.actor.pose = drag.outcome.pose
    if not imgui.is_mouse_down(_LEFT):
        posing.drag = None
        if not drag.has_moved:
            choose_joint(state)  # a joint's dot may be under a ring or an arrow
    return True


def _is_beside_handle(state: AppState, place: Place) -> bool:
    """Return whether a press narrowly missed the handles of the selected joint.

    Such a drag was meant for a handle: it must not orbit the camera.
    """
    posing, posed, frame = state.of(Posing), selected(state), view_frame(state)
    if posed is None or state.actor.pose is None:
        return False
    if posing.tool == "rotate":
        found = rings(posed, state.actor.pose, posing.orientation, frame)
        return grab_ring(found, posed.center, frame, place, _BESIDE) is not None
    center = frame.place(posed.center)
    if center is not None and _apart(center, place) <= _BESIDE * frame.scale:
        return True
    found_arrows = arrows(posed, posing.orientation)
    return grab_arrow(found_arrows, posed.center, frame, place, _BESIDE) is not None


def _end_miss(state: AppState) -> bool:
    """Ignore a drag next to a handle until the button is released; return False for a click."""
    if imgui.is_mouse_down(_LEFT):
        return True
    state.of(Posing).has_missed = False
    return imgui.get_io().mouse_drag_max_distance_sqr[_LEFT] > _STILL**2


def _apart(one: Place, other: Place) -> float:
    return float(np.hypot(one[0] - other[0], one[1] - other[1]))


def _pose(state: AppState) -> Pose:
    pose = state.actor.pose
    assert pose is not None  # checked by no_tool
    return pose


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
    """Return the handle of the selected joint at a window position.

    Parameters
    ----------
    state : AppState
        State with the tool, the actor and the selected joint.
    frame : ViewFrame
        Projection of the scene.
    place : (float, float)
        Position of the pointer, window coordinates.
    """
    posing = state.of(Posing)
    posed, pose = selected(state), state.actor.pose
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
    if center is None or _apart(center, place) > DOT_REACH * frame.scale:
        return None
    return _middle(state, posed, place)


def _middle(state: AppState, posed: PosedJoint, place: Place) -> Handle | None:
    """Return the handle at the joint, which moves it with its chain or translates it."""
    pose, skeleton = _pose(state), posed.skeleton
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
    reach = DOT_REACH * view_frame(state).scale
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
