"""Actions of the posing tools' buttons and keys, and the reasons why they are disabled."""

from __future__ import annotations

from viewer.app.core.key_names import with_key
from viewer.app.core.reasons import no_pose
from viewer.app.core.state import AppState
from viewer.app.curves.clip_actions import key_present_pose
from viewer.app.posing.move_tool import longest_chain, shifts, used_chain
from viewer.app.posing.posed_joint import PosedJoint, posed_joint
from viewer.app.posing.state import ORIENTATIONS, TOOLS, Posing
from viewer.rig.motion.clip import Clip
from viewer.rig.motion.transform_clip import TransformClip
from viewer.rig.posing.joint_rotation import rotates_freely, rotation_dofs
from viewer.rig.skeleton import joint_label

__all__ = [
    "cancel_drag",
    "chain_length",
    "chain_limit",
    "choose_tool",
    "key_pose_now",
    "next_orientation",
    "no_chain",
    "no_keys",
    "no_orientation",
    "no_tool",
    "selected",
]


def choose_tool(state: AppState, tool: str) -> None:
    """Choose a tool, a key of ``TOOLS``, and show a hint, or the reason why it is disabled."""
    why = no_tool(state)
    if tool != "select" and why:
        state.say_status(f"{TOOLS[tool][0]}: {why}")
        return
    cancel_drag(state)
    state.of(Posing).tool = tool
    name, _, text = TOOLS[tool]
    hint = "; select a joint first" if tool != "select" and state.selected_joint < 0 else ""
    state.say_status(f"{name}: {text}{hint}")


def next_orientation(state: AppState) -> None:
    """Switch to the next orientation: local, parent or world axes."""
    posing = state.of(Posing)
    names = list(ORIENTATIONS)
    following = names[(names.index(posing.orientation) + 1) % len(names)]
    posing.orientation = following
    state.say_status(ORIENTATIONS[following])


def cancel_drag(state: AppState) -> bool:
    """Cancel a drag and restore the pose before it; return whether there was one."""
    drag = state.of(Posing).drag
    if drag is None or drag.is_over:
        return False
    drag.is_over = True
    if drag.actor.pose is drag.outcome.pose:
        drag.actor.pose = drag.handle.start.copy()
        state.say_status("Drag cancelled")
    return True


def key_pose_now(state: AppState) -> None:
    """Key the pose in its clip at the current time."""
    if not no_keys(state):
        key_present_pose(state)


def selected(state: AppState) -> PosedJoint | None:
    """Return the selected joint in the scene; None if there is none that can be posed."""
    actor = state.actor
    if not actor.is_drawn or state.options.show == "binding":
        return None
    return posed_joint(actor, state.selected_joint)


def no_tool(state: AppState) -> str:
    """Return the reason why nothing can be posed in the view."""
    if state.options.show == "binding" and state.actor.figure.is_attached:
        return "the skin is shown in its bind pose: press K to show the pose"
    if not state.actor.is_drawn:
        return "this actor is not shown"
    return no_pose(state)


def no_orientation(state: AppState) -> str:
    """Return the reason why the choice of axes has no effect on the selected joint."""
    skeleton, joint = state.actor.figure.skeleton, state.selected_joint
    if skeleton is None or joint < 0:
        return ""
    if state.of(Posing).tool != "rotate":
        return "" if shifts(skeleton, joint) else "this joint is dragged in the image plane"
    if rotates_freely(skeleton, joint):
        return ""
    if not len(rotation_dofs(skeleton, joint, free=True)):
        return f"{joint_label(skeleton, joint)} cannot rotate"
    return "this joint rotates only about the axes of its DOFs"


def chain_limit(state: AppState) -> int:
    """Return the longest chain above the selected joint; 0 if nothing above it rotates."""
    skeleton = state.actor.figure.skeleton
    return 0 if skeleton is None else longest_chain(skeleton, state.selected_joint)


def chain_length(state: AppState) -> int:
    """Return the number of joints that would follow a drag of the selected joint; at least 1."""
    posing = state.of(Posing)
    skeleton = state.actor.figure.skeleton
    if skeleton is None or state.selected_joint < 0:
        return max(posing.chain_length, 1)
    return max(len(used_chain(skeleton, state.selected_joint, posing.chain_length)), 1)


def no_chain(state: AppState) -> str:
    """Return the reason why the length of the chain cannot be chosen."""
    if state.of(Posing).tool != "move":
        return with_key(state, "chains apply only to the Move tool", "D")
    skeleton = state.actor.figure.skeleton
    if skeleton is None or state.selected_joint < 0:
        return "select a joint"
    if not chain_limit(state):
        return f"no joint above {joint_label(skeleton, state.selected_joint)} can rotate"
    return ""


def no_keys(state: AppState) -> str:
    """Return the reason why the pose cannot be keyed."""
    clip = state.actor.clip
    if clip is None:
        return no_pose(state) or "there is no clip: create one with Edit > New clip"
    if not isinstance(clip, Clip | TransformClip):
        return "this motion is sampled and has no keys"
    return ""
