"""Toolbar in the upper right corner of the view: tools, their settings, and pose actions."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.fields import slider_int
from viewer.app.core.reasons import no_pose
from viewer.app.core.state import AppState
from viewer.app.core.theme import accent
from viewer.app.core.widgets import (
    Rect,
    button,
    choice,
    disabled,
    explain,
    note_item,
    overlay_rect,
    with_key,
)
from viewer.app.curves.editing import key_present_pose
from viewer.app.posing.move_tool import longest_chain, shifts, used_chain
from viewer.app.posing.posed_joint import PosedJoint, posed_joint
from viewer.app.posing.posing import (
    ORIENTATIONS,
    TOOLS,
    PoseTool,
    Posing,
    copy_pose,
    mirror,
    paste_pose,
)
from viewer.rigs.posing.joint_rotation import rotates_freely, rotation_dofs
from viewer.rigs.skeleton import joint_label

_GAP = 10.0  # points from the edges of the view
_NARROWEST, _LOWEST = 250.0, 140.0  # points: a smaller view has no room for tools
_FLAGS = int(
    imgui.WindowFlags_.no_decoration
    | imgui.WindowFlags_.always_auto_resize
    | imgui.WindowFlags_.no_docking
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.no_focus_on_appearing
    | imgui.WindowFlags_.no_nav
    | imgui.WindowFlags_.no_bring_to_front_on_focus
)
_WIDTH = 14.5  # fixed width of each row, in font sizes: buttons must not move when rows appear


def draw_toolbar(state: AppState, legend: Rect | None) -> Rect | None:
    """Draw the tools, below the legend if there is no room beside it; return their rectangle."""
    x, y, width, height = state.view_rect
    if not state.panels_visible or width < _NARROWEST or height < _LOWEST:
        return None
    if state.actor.figure.skeleton is None:
        return None
    top = y + _GAP
    if legend is not None and legend[2] + _GAP > x + width - _NARROWEST:
        top = legend[3] + _GAP
    imgui.set_next_window_pos((x + width - _GAP, top), imgui.Cond_.always, (1.0, 0.0))
    imgui.set_next_window_bg_alpha(0.86)
    if imgui.begin("##tools", None, _FLAGS)[0]:
        _draw_tools(state)
        if state.of(Posing).is_on:
            _draw_settings(state)
            why = no_pose(state)
            paste = "paste a pose, even from another figure"
            rows = (
                ("Mirror", mirror, with_key(state, "mirror the pose left to right", "M"), why),
                ("Copy", copy_pose, with_key(state, "copy the pose", "Ctrl+C"), why),
                ("Paste", paste_pose, with_key(state, paste, "Ctrl+V"), why),
                ("Key", key_pose_now, "key the pose at the current time", no_keys(state)),
            )
            for number, (name, action, text, reason) in enumerate(rows):
                if number:
                    imgui.same_line()
                if button(state, name, reason, text, f"tool {name}", _item_width(len(rows))):
                    action(state)
    rect = overlay_rect(state, "##tools")
    imgui.end()
    return rect


def _draw_tools(state: AppState) -> None:
    """Draw a button per tool; the chosen one is highlighted."""
    width = _item_width(len(TOOLS))
    for number, (tool, (name, key, text)) in enumerate(TOOLS.items()):
        why = no_tool(state) if tool != "select" else ""
        if number:
            imgui.same_line()
        is_on = state.of(Posing).tool == tool
        if is_on:
            imgui.push_style_color(imgui.Col_.button, accent())
        pressed = button(state, name, why, with_key(state, text, key), f"tool {name}", width)
        if is_on:
            imgui.pop_style_color()
        if pressed:
            choose_tool(state, tool)


def _item_width(count: int) -> float:
    """Return the width of each of several widgets in a row; all rows have the same width."""
    spacing = imgui.get_style().item_spacing.x
    return (_WIDTH * imgui.get_font_size() - spacing * (count - 1)) / count


def _draw_settings(state: AppState) -> None:
    """Draw the choice of axes, and the length of the chain for the tool that has one."""
    posing, has_chain = state.of(Posing), state.of(Posing).tool == "move"
    why = no_orientation(state)
    with disabled(state, why):
        width = _item_width(2 if has_chain else 1) / imgui.get_font_size()
        posing.orientation = choice(state, "##axes", posing.orientation, ORIENTATIONS, width)
        explain(with_key(state, "orientation of the rings and arrows", "X"), why)
    if has_chain:
        imgui.same_line()
        _draw_chain(state)


def _draw_chain(state: AppState) -> None:
    """Draw the slider of the number of joints that follow a dragged joint."""
    why, longest = no_chain(state), max(_chain_limit(state), 1)
    with disabled(state, why):
        imgui.set_next_item_width(_item_width(2))
        changed, length = slider_int(
            state,
            "##chain",
            chain_length(state),
            1,
            longest,
            "chain %d",
            imgui.SliderFlags_.always_clamp,
        )
        note_item(state, "Chain")
        explain("number of joints above the dragged joint that may rotate", why)
    if changed:
        state.of(Posing).chain_length = min(max(length, 1), longest)


def choose_tool(state: AppState, tool: PoseTool) -> None:
    """Choose a tool, and show a hint, or the reason why it is disabled."""
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
    if drag.actor.own_pose is drag.outcome.pose:
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


def _chain_limit(state: AppState) -> int:
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
    if not _chain_limit(state):
        return f"no joint above {joint_label(skeleton, state.selected_joint)} can rotate"
    return ""


def no_keys(state: AppState) -> str:
    """Return the reason why the pose cannot be keyed."""
    clip = state.actor.clip
    if clip is None:
        return no_pose(state) or "there is no clip: create one with Edit > New clip"
    if clip.timing is not None:
        return "this motion is sampled and has no keys"
    return ""
