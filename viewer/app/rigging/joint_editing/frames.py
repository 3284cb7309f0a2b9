"""What each frame does for the editing of joints: clicks are taken, the mesh is bound."""

from __future__ import annotations

import numpy as np

from viewer.app.core.state import AppState
from viewer.app.posing.posing import Posing
from viewer.app.rigging.joint_editing.binding import bind
from viewer.app.rigging.joint_editing.commands import take_click
from viewer.app.rigging.joint_editing.drags import show_drag
from viewer.app.rigging.joint_editing.state import JointEditing, stop_editing
from viewer.rigs.pose import Pose, rest_pose
from viewer.rigs.scene import Actor


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
