"""A joint chosen in the view: its row in the tree is opened, brought into view, and not hidden."""

from __future__ import annotations

from viewer.app.core.state import AppState
from viewer.rig.skeleton import joint_label

__all__ = ["select_joint"]


def select_joint(state: AppState, joint: int) -> None:
    """Select a joint of the chosen actor, and let the tree follow.

    Parameters
    ----------
    state : AppState
        Gets the joint; a filter that hides it is emptied.
    joint : int
        Index, 0 or more.
    """
    state.selected_joint = state.weights.scrolls_to = joint
    skeleton = state.actor.figure.skeleton
    if skeleton is None or joint >= skeleton.n_joints:
        return
    if state.joint_filter.lower() not in joint_label(skeleton, joint).lower():
        state.joint_filter = ""
    while joint >= 0:
        state.opened_joints.add(joint)  # so that the rows below it are seen
        joint = int(skeleton.parents[joint])
