"""State of the joint tree: filter, open rows, and scrolling to the selected joint."""

from __future__ import annotations

from dataclasses import field

from viewer.app.core.state import AppState
from viewer.data_classes import dataclass
from viewer.rigs.hierarchy import path_to_root
from viewer.rigs.skeleton import joint_label

_MOST_OPENED = 128  # rigs with more joints are initially collapsed


@dataclass(slots=True)
class JointTree:
    """State of the joint tree."""

    filter: str = ""
    """Text that the names of listed joints or captured points must contain."""
    opened: set[int] = field(default_factory=set)
    """Joints whose DOFs and children are listed."""
    scrolls_to: int = -1
    """Joint to which the list scrolls, -1 for none."""
    n_choices: int = -1
    """The state's ``n_choices`` for which filter and open rows are valid."""


def joint_tree(state: AppState) -> JointTree:
    """Return the tree of the chosen actor, reset if the actor changed."""
    tree = state.of(JointTree)
    if tree.n_choices != state.n_choices:
        tree.n_choices = state.n_choices
        tree.filter, skeleton = "", state.actor.figure.skeleton
        parents = [] if skeleton is None else skeleton.parents.tolist()
        # All joints of a small rig are expanded, otherwise the roots.
        is_small = len(parents) <= _MOST_OPENED
        tree.opened = {joint for joint, parent in enumerate(parents) if is_small or parent < 0}
    return tree


def select_joint(state: AppState, joint: int) -> None:
    """Select a joint of the chosen actor, and reveal its row."""
    tree = joint_tree(state)
    state.selected_joint = tree.scrolls_to = joint
    skeleton = state.actor.figure.skeleton
    if skeleton is None or joint >= skeleton.n_joints:
        return
    if tree.filter.lower() not in joint_label(skeleton, joint).lower():
        tree.filter = ""
    tree.opened.update(path_to_root(skeleton.parents, joint))  # shows the rows of their DOFs
