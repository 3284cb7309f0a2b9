"""Toolbar in the upper right corner of the view: tools, their settings, and pose actions."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.fields import slider_int
from viewer.app.core.ink import accent
from viewer.app.core.key_names import with_key
from viewer.app.core.reasons import no_pose
from viewer.app.core.state import AppState
from viewer.app.core.widgets import Rect, choice, disabled, explain, note_item, overlay_rect
from viewer.app.posing.pose_actions import copy_pose, mirror, paste_pose
from viewer.app.posing.state import ORIENTATIONS, TOOLS, Posing
from viewer.app.posing.tool_actions import (
    chain_length,
    chain_limit,
    choose_tool,
    key_pose_now,
    no_chain,
    no_keys,
    no_orientation,
    no_tool,
)

__all__ = ["draw_toolbar"]

_GAP = 10.0  # points from the edges of the view
_NARROWEST, _LOWEST = 250.0, 140.0  # points: a smaller view has no room for tools
_WIDTH = 14.5  # fixed width of each row, in font sizes: buttons must not move when rows appear


def draw_toolbar(state: AppState, legend: Rect | None) -> Rect | None:
    """Draw the tools; return their rectangle.

    Parameters
    ----------
    state : AppState
        State to which the tools apply.
    legend : Rect or None
        Rectangle of the legend: the tools are placed below it if there is no room next to it.
    """
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
    flags = imgui.WindowFlags_.no_decoration | imgui.WindowFlags_.always_auto_resize
    flags |= imgui.WindowFlags_.no_docking | imgui.WindowFlags_.no_saved_settings
    flags |= imgui.WindowFlags_.no_focus_on_appearing | imgui.WindowFlags_.no_nav
    flags |= imgui.WindowFlags_.no_bring_to_front_on_focus
    if imgui.begin("##tools", None, flags)[0]:
        _draw_tools(state)
        if state.of(Posing).is_on:
            _draw_settings(state)
            _draw_actions(state)
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
        pressed = _button(state, name, width, with_key(state, text, key), why)
        if is_on:
            imgui.pop_style_color()
        if pressed:
            choose_tool(state, tool)


def _item_width(count: int) -> float:
    """Return the width of each of several widgets in a row; all rows have the same width."""
    spacing = imgui.get_style().item_spacing.x
    return (_WIDTH * imgui.get_font_size() - spacing * (count - 1)) / count


def _button(state: AppState, name: str, width: float, text: str, why: str) -> bool:
    with disabled(state, why):
        pressed = imgui.button(name, (width, 0.0))
        note_item(state, f"tool {name}")
        explain(text, why)
    return pressed


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
    why, longest = no_chain(state), max(chain_limit(state), 1)
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


def _draw_actions(state: AppState) -> None:
    """Draw the buttons of actions on the whole pose."""
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
        if _button(state, name, _item_width(len(rows)), text, reason):
            action(state)
