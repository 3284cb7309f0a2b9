"""Drags of joints in the view."""

from __future__ import annotations

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.reasons import no_job_room
from viewer.app.core.state import AppState
from viewer.app.core.view_frame import Place, view_frame
from viewer.app.posing.gizmo import joint_at
from viewer.app.posing.joint_tree import select_joint
from viewer.app.posing.move_tool import dragged
from viewer.app.rigging.joint_editing.binding import stop_binding
from viewer.app.rigging.joint_editing.places import figure_place, middle_under, scene_place
from viewer.app.rigging.joint_editing.state import (
    JointDrag,
    JointEditing,
    edited,
    label,
    put_joints,
    show,
    symmetry,
    tried,
)
from viewer.phrases import capitalized
from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.joint_edits import moved, partners, rest_worlds, with_below
from viewer.rigs.scene import Actor

_STILL = 2.0  # maximum movement of the pointer during a click, window coordinates
_LEFT, _RIGHT = imgui.MouseButton_.left, imgui.MouseButton_.right


def hold_joint(state: AppState) -> bool:
    """Begin, continue or end a drag of a joint; return whether it uses the mouse."""
    editing, actor, io = state.of(JointEditing), edited(state), imgui.get_io()
    place = (io.mouse_pos.x, io.mouse_pos.y)
    if editing.drag is not None:
        _go_on(state, editing.drag, place)
        return True
    if actor is None or state.actor is not actor or io.want_capture_mouse or io.key_alt:
        return False
    if not imgui.is_mouse_clicked(_LEFT) or not imgui.is_mouse_pos_valid():
        return False
    joint = joint_at(state, place)
    if joint < 0:
        return False
    figure, plane = actor.figure, symmetry(state, actor.figure)
    skeleton = figure.require_skeleton()
    other = -1 if plane is None else partners(figure, plane)[joint]
    held = frozenset(skeleton.names[one] for one in (joint, other) if one >= 0)
    editing.drag = JointDrag(joint, figure, skeleton, place, held)
    return True


def _go_on(state: AppState, drag: JointDrag, at: Place) -> None:
    """Move the held joint with the pointer; a release applies it, the right button cancels it."""
    editing, actor, io = state.of(JointEditing), edited(state), imgui.get_io()
    if imgui.is_mouse_clicked(_RIGHT):
        cancel_joint_drag(state)
    if actor is None or actor.figure.skeleton is not drag.skeleton:
        if actor is not None and not drag.is_over:  # undone, or fitted again
            state.say_status("Drag cancelled: the joints were changed meanwhile")
        drag.is_over = True
    if drag.is_over or actor is None:
        editing.drag = drag if imgui.is_mouse_down(_LEFT) else None
        return
    drag.has_moved |= float(np.hypot(at[0] - drag.place[0], at[1] - drag.place[1])) > _STILL
    if drag.has_moved and imgui.is_mouse_pos_valid():
        drag.places = _dragged_places(state, actor, drag, at, io.key_shift, io.key_ctrl)
    if imgui.is_mouse_down(_LEFT):
        return
    editing.drag = None
    if state.selected_joint != drag.joint:
        select_joint(state, drag.joint)
    if drag.places:
        if not _is_bound_there(drag):
            stop_binding(state)  # the last places count
            tried(state, lambda actor: _show_dragged(state, actor, drag))
        name = f"move joint {label(actor.figure, drag.joint)}"
        state.history.name = name
        state.say_status(capitalized(name))


def _dragged_places(
    state: AppState, actor: Actor, drag: JointDrag, at: Place, snaps: bool, alone: bool
) -> dict[int, Floats]:
    """Return the new places of the held joint and of those that move with it, figure space."""
    figure, frame = drag.figure, view_frame(state)
    matrix = figure_place(actor)
    start = apply_transform(matrix, rest_worlds(figure)[drag.joint, :3, 3])
    wanted = dragged(start, drag.place, frame, at)
    place = apply_transform(scene_place(actor), wanted)
    seen = frame.place(wanted)
    if snaps and seen is not None:
        middle = middle_under(state, actor, frame, seen)
        place = place if middle is None else middle
    plane = symmetry(state, figure)
    other = -1 if plane is None else partners(figure, plane)[drag.joint]
    if plane is not None and other == drag.joint:
        place = place - plane.distance(place) * plane.normal
    places = {drag.joint: place} if alone else with_below(figure, drag.joint, place)
    if plane is not None and other >= 0 and other != drag.joint:
        image = plane.image(place)
        places |= {other: image} if alone else with_below(figure, other, image)
    return places


def cancel_joint_drag(state: AppState) -> bool:
    """Cancel a drag; return whether there was one."""
    drag, actor = state.of(JointEditing).drag, edited(state)
    if drag is None or drag.is_over:
        return False
    if drag.bound and actor is not None and actor.figure.skeleton is drag.skeleton:
        stop_binding(state)
        show(actor, drag.figure)
    drag.is_over, drag.places = True, {}
    state.say_status("Drag cancelled")
    return True


def show_drag(state: AppState, actor: Actor) -> None:
    """Show the joints where they are dragged to, if the mesh can be bound to them now."""
    editing, drag = state.of(JointEditing), state.of(JointEditing).drag
    is_free = editing.choices.weights != "keep" and not no_job_room(state)
    if drag is not None and drag.places and is_free and not _is_bound_there(drag):
        _show_dragged(state, actor, drag)  # one binding at a time, for the newest places


def _is_bound_there(drag: JointDrag) -> bool:
    """Return whether the joints are shown where they are dragged to."""
    places, bound = drag.places, drag.bound
    is_same = places.keys() == bound.keys()
    return is_same and all(np.array_equal(places[one], bound[one]) for one in places)


def _show_dragged(state: AppState, actor: Actor, drag: JointDrag) -> None:
    """Show the joints where they are dragged to; the mesh is then bound to them."""
    # All others where they were, for the modifiers may have moved them meanwhile.
    places = dict(enumerate(rest_worlds(drag.figure)[:, :3, 3])) | drag.places
    put_joints(state, actor, moved(actor.figure, places), drag.held)
    drag.skeleton, drag.bound = actor.figure.require_skeleton(), drag.places
