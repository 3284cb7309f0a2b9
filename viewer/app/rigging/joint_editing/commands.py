"""Edits of the selected joint: removed, mirrored, renamed; and joints added by a click."""

from __future__ import annotations

import numpy as np

from viewer.app.core.state import AppState
from viewer.app.core.view_frame import view_frame
from viewer.app.posing import posing
from viewer.app.posing.gizmo import joint_at
from viewer.app.posing.joint_tree import select_joint
from viewer.app.rigging.joint_editing.state import (
    LONGEST,
    JointEditing,
    commit,
    edited,
    label,
    middle_under,
    plane_of,
    rest_mesh,
    symmetry,
    tried,
)
from viewer.app.view.hovering import Picking
from viewer.phrases import printable
from viewer.rigs.arrays import Floats
from viewer.rigs.hierarchy import descendants
from viewer.rigs.joint_edits import (
    added,
    free_name,
    is_central,
    mirrored,
    partners,
    removed,
    renamed,
)
from viewer.rigs.retargeting.joint_names import other_side
from viewer.rigs.scene import Actor


def delete_joint(state: AppState) -> None:
    """Remove the selected joint of the edited skeleton; its children and weights go up."""
    if edited(state) is None:
        return  # the key also deletes keys of curves

    def edit(actor: Actor) -> None:
        figure, joint = actor.figure, state.selected_joint
        chosen, plane = {joint}, symmetry(state, figure)
        if plane is not None:
            chosen |= {partners(figure, plane)[joint]} - {-1}
        above = int(figure.require_skeleton().parents[joint])
        above = next((one for one in (above, 0) if one >= 0 and one not in chosen), -1)
        left = removed(figure, chosen)
        names = " and ".join(label(figure, one) for one in sorted(chosen))
        row = above - sum(one < above for one in chosen)
        commit(state, left, f"remove joint {names}", max(row, 0))

    tried(state, edit)


def mirror(state: AppState) -> None:
    """Mirror the selected chain while joints are edited, or else the pose."""
    if edited(state) is not state.actor:
        posing.mirror(state)
        return

    def edit(actor: Actor) -> None:
        figure, joint = actor.figure, state.selected_joint
        plane, skeleton = plane_of(figure, rest_mesh(figure)), figure.require_skeleton()
        placed = state.of(JointEditing).placed.get(skeleton, frozenset())
        chain = np.flatnonzero(descendants(skeleton.parents, joint)).tolist()
        images = {other_side(skeleton.names[one]) for one in chain if skeleton.names[one] in placed}
        new, name = mirrored(figure, joint, plane), f"mirror joint {label(figure, joint)}"
        commit(state, new, name, held=frozenset(images))

    tried(state, edit)


def rename_joint(state: AppState, name: str) -> None:
    """Give the selected joint another name; in symmetric editing, its counterpart follows."""

    def edit(actor: Actor) -> None:
        figure, joint = actor.figure, state.selected_joint
        plane, old = symmetry(state, figure), label(figure, joint)
        other = -1 if plane is None else partners(figure, plane)[joint]
        new = renamed(figure, joint, name)
        if other >= 0 and other != joint and other_side(name):
            new = renamed(new, other, other_side(name))
        is_stale = figure in state.of(JointEditing).stale
        commit(state, new, f"rename joint {old} to {printable(name, LONGEST)}")
        if not is_stale:
            state.of(JointEditing).stale.discard(actor.figure)  # the weights are the same

    tried(state, edit)


def take_click(state: AppState, actor: Actor) -> None:
    """Use a click: it selects the joint there, or adds one in the middle of the solid."""
    picking = state.of(Picking)
    wanted = picking.wanted
    if wanted is None or wanted[2]:
        return
    picking.wanted = None
    x, y, _, _ = state.view_rect
    at = (wanted[0] + x, wanted[1] + y)
    joint = joint_at(state, at)
    if joint >= 0:
        select_joint(state, joint)
        return
    place = middle_under(state, actor, view_frame(state), at)
    if place is None:
        state.say_status("Edit skeleton: click on the mesh to add a joint")
    elif state.selected_joint < 0:
        state.say_status("Edit skeleton: first select the joint above the new one")
    else:
        tried(state, lambda actor: _add_at(state, actor, place))


def _add_at(state: AppState, actor: Actor, place: Floats) -> None:
    """Add a joint at a place (3,) in figure space, below the selected one."""
    figure, parent = actor.figure, state.selected_joint
    plane = symmetry(state, figure)
    if plane is None or is_central(figure, plane, place):
        if plane is not None:
            place = place - plane.distance(place) * plane.normal
        new = added(figure, parent, place)
    else:
        base = free_name(figure.require_skeleton().names)
        sides = ("left", "right") if plane.distance(place) > 0.0 else ("right", "left")
        other = partners(figure, plane)[parent]
        # The joint that is selected afterwards is the last.
        new = added(
            figure, other if other >= 0 else parent, plane.image(place), f"{base}_{sides[1]}"
        )
        new = added(new, parent, place, f"{base}_{sides[0]}")
    last = new.require_skeleton().n_joints - 1
    commit(state, new, f"add joint {label(new, last)} below {label(figure, parent)}", last)
