"""Joints of the edited figure, drawn over the view."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.core.view_frame import view_frame
from viewer.app.posing.gizmo import Pen, joint_at, text_box
from viewer.app.posing.posed_joint import posed_joint
from viewer.app.rigging.joint_editing.state import JointEditing, edited, label
from viewer.rigs.geometry.transform import apply_transform

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
