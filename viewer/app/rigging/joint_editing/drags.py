"""Joints edited in the view: their drags, their drawing, and what each frame does for them."""

from __future__ import annotations

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.reasons import no_job_room
from viewer.app.core.state import AppState
from viewer.app.core.view_frame import Place, view_frame
from viewer.app.posing.gizmo import Pen, joint_at, text_box
from viewer.app.posing.joint_tree import select_joint
from viewer.app.posing.move_tool import dragged
from viewer.app.posing.posed_joint import posed_joint
from viewer.app.posing.posing import Posing
from viewer.app.rigging.joint_editing.binding import bind, stop_binding
from viewer.app.rigging.joint_editing.commands import take_click
from viewer.app.rigging.joint_editing.state import (
    JointDrag,
    JointEditing,
    edited,
    figure_place,
    label,
    middle_under,
    put_joints,
    scene_place,
    show,
    stop_editing,
    symmetry,
    tried,
)
from viewer.phrases import capitalized
from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.joint_edits import moved, partners, rest_worlds, with_below
from viewer.rigs.pose import Pose, rest_pose
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


_HOT, _BONE, _DOT = (1.0, 0.92, 0.55, 1.0), (0.45, 0.90, 0.95, 0.9), (1.0, 1.0, 1.0, 0.9)


def draw_joint_edits(state: AppState) -> None:
    """Draw the joints of the edited figure over the view, with the held ones where they will be."""
    editing, actor = state.of(JointEditing), edited(state)
    posed = None if actor is None or state.actor is not actor else posed_joint(actor, 0)
    if actor is None or posed is None:
        return
    places, skeleton, drag = posed.world[:, :3, 3].copy(), posed.skeleton, editing.drag
    if drag is not None:
        for joint, place in drag.places.items():
            places[joint] = apply_transform(posed.placement, place)
    pen, io = Pen(view_frame(state)), imgui.get_io()
    x, y, width, height = state.view_rect
    pen.list.push_clip_rect((x, y), (x + width, y + height), True)
    for joint, parent in enumerate(skeleton.parents.tolist()):
        if parent >= 0:
            is_held = drag is not None and bool({joint, parent} & drag.places.keys())
            pen.line(places[[parent, joint]], _HOT if is_held else _BONE, 1.5)
    for place in places:
        pen.dot(place, 4.0, (0.0, 0.0, 0.0, 0.6))
        pen.dot(place, 3.0, _DOT)
    if 0 <= state.selected_joint < len(places):
        pen.dot(places[state.selected_joint], 6.5, _HOT, filled=False)
    free = not io.want_capture_mouse and drag is None and imgui.is_mouse_pos_valid()
    under = joint_at(state, (io.mouse_pos.x, io.mouse_pos.y)) if free else -1
    named = drag.joint if drag is not None else under
    seen = pen.frame.place(places[named]) if named >= 0 else None
    if seen is not None:
        pen.dot(places[named], 7.5, _HOT, filled=False)
        at = (seen[0] + 12.0 * pen.scale, seen[1] - 8.0 * pen.scale)
        text_box(state, pen, at, [(label(actor.figure, named), _DOT)])
    pen.list.pop_clip_rect()


def update_joints(state: AppState) -> None:
    """Take clicks, keep the edited figure at rest, and have it bound; called in each frame."""
    editing = state.of(JointEditing)
    if editing.scene is not state.scene:
        choices = editing.choices
        editing = state.put(JointEditing(scene=state.scene, choices=choices))
    actor = editing.actor
    if actor is None:
        return
    skeleton, pose = actor.figure.skeleton, actor.own_pose
    is_there = any(actor is one for one in state.scene.actors)
    if not is_there or skeleton is None or pose is None or not actor.figure.is_attached:
        stop_editing(state)  # undone
        return
    if state.actor is actor and state.selected_joint >= skeleton.n_joints:
        state.selected_joint = -1
    poses = state.of(Posing).is_on or state.actor is not actor or _is_posed(actor, pose)
    if editing.is_on and poses:
        stop_editing(state)
        state.say_status("Edit skeleton is off: it edits the chosen figure at rest")
    if editing.is_on:
        take_click(state, actor)
    show_drag(state, actor)
    bind(state, actor)


def _is_posed(actor: Actor, pose: Pose) -> bool:
    """Return whether an actor is not at rest, apart from its shape and place."""
    rest = rest_pose(actor.figure.require_skeleton())
    parts = ("dofs", "translations", "rotations", "scales")
    return any(not np.array_equal(getattr(pose, part), getattr(rest, part)) for part in parts)
