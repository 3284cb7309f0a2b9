"""The keyboard: one table for what keys do, the help that lists them, and the manual."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from imgui_bundle import imgui

from viewer.app import actions, pose_actions, posing_actions, rig_results
from viewer.app.state import AppState
from viewer.app.weights_actions import toggle_weights

__all__ = ["KEYS", "Shortcut", "handle_keys"]

_CTRL, _SHIFT = imgui.Key.mod_ctrl, imgui.Key.mod_shift


@dataclass(frozen=True, slots=True)
class Shortcut:
    """A key, what it is called, what it does, in words and as a function."""

    chords: tuple[int, ...]
    label: str
    text: str
    action: Callable[[AppState], None]


def _toggle(name: str, text: str) -> Callable[[AppState], None]:
    return lambda state: actions.toggle_option(state, name, text)


def _look(name: str) -> Callable[[AppState], None]:
    return lambda state: actions.look(state, name)


def _step(frames: int) -> Callable[[AppState], None]:
    return lambda state: actions.step(state, frames)


def _end(last: bool) -> Callable[[AppState], None]:
    return lambda state: actions.go_to_end(state, last)


def _take(tool: str) -> Callable[[AppState], None]:
    return lambda state: posing_actions.choose_tool(state, tool)


def _want(what: str) -> Callable[[AppState], None]:
    return lambda state: state.wants.add(what)


def _toggle_panels(state: AppState) -> None:
    state.panels_visible = not state.panels_visible


def _toggle_keys(state: AppState) -> None:
    state.keys_visible = not state.keys_visible


def _toggle_messages(state: AppState) -> None:
    state.messages_visible = not state.messages_visible


_K = imgui.Key

KEYS = (
    Shortcut((_K.r,), "R", "reset every DOF to the file's pose", actions.reset_pose),
    Shortcut((_K.s,), "S", "skeleton on or off", actions.toggle_skeleton),
    Shortcut((_K.k,), "K", "attached skin or skin in binding space", actions.toggle_binding),
    Shortcut((_K.w,), "W", "wireframe", _toggle("wireframe", "Wireframe")),
    Shortcut((_K.n,), "N", "vertex normals", _toggle("normals", "Vertex normals")),
    Shortcut((_K.t,), "T", "texture", _toggle("texture", "Texture")),
    Shortcut((_K.g,), "G", "ground grid", _toggle("grid", "Grid")),
    Shortcut((_K.a,), "A", "rigged mesh or as it was (A/B)", rig_results.switch_version),
    Shortcut((_K.b,), "B", "x-ray: bones through the skin", _toggle("xray", "X-ray")),
    Shortcut((_K.j,), "J", "names of joints", _toggle("joint_names", "Joint names")),
    Shortcut((_SHIFT | _K.j,), "Shift+J", "axes of joints", _toggle("joint_axes", "Joint axes")),
    Shortcut((_K.v,), "V", "weights of the selected joint", toggle_weights),
    Shortcut((_K.f,), "F", "fit the view", actions.fit_view),
    Shortcut((_K._1, _K.keypad1), "1", "front view", _look("front")),
    Shortcut((_K._3, _K.keypad3), "3", "side view", _look("left")),
    Shortcut((_K._7, _K.keypad7), "7", "top view", _look("top")),
    Shortcut((_K._5, _K.keypad5), "5", "orthographic or perspective", actions.toggle_projection),
    Shortcut((_K.tab,), "Tab", "hide or show the panels", _toggle_panels),
    Shortcut((_K.h, _SHIFT | _K.slash, _K.f1), "H or ?", "this list", _toggle_keys),
    Shortcut((_CTRL | _K.m,), "Ctrl+M", "all messages so far", _toggle_messages),
    Shortcut((_K.f12,), "F12", "save a screenshot", _want("screenshot")),
    Shortcut((_CTRL | _K.o,), "Ctrl+O", "open files", _want("open dialog")),
    Shortcut((_CTRL | _K.z,), "Ctrl+Z", "undo", actions.undo),
    Shortcut((_CTRL | _SHIFT | _K.z, _CTRL | _K.y), "Ctrl+Shift+Z", "redo", actions.redo),
    Shortcut((_K.q,), "Q", "tool Select: click chooses", _take("select")),
    Shortcut((_K.e,), "E", "tool Rotate: turn the selected joint", _take("rotate")),
    Shortcut((_K.d,), "D", "tool Move: drag a joint (IK)", _take("move")),
    Shortcut((_K.x,), "X", "local, parent or world axes", posing_actions.next_orientation),
    Shortcut((_K.m,), "M", "mirror the pose left to right", pose_actions.mirror),
    Shortcut((_CTRL | _K.c,), "Ctrl+C", "copy the pose", pose_actions.copy_pose),
    Shortcut(
        (_CTRL | _SHIFT | _K.c,),
        "Ctrl+Shift+C",
        "copy the pose as the file's own numbers",
        pose_actions.copy_numbers,
    ),
    Shortcut((_CTRL | _K.v,), "Ctrl+V", "paste a pose", pose_actions.paste_pose),
    Shortcut((_K.space,), "Space", "play or pause", actions.play),
    Shortcut((_K.left_arrow,), "Left", "one frame back", _step(-1)),
    Shortcut((_K.right_arrow,), "Right", "one frame on", _step(1)),
    Shortcut((_SHIFT | _K.left_arrow,), "Shift+Left", "ten frames back", _step(-10)),
    Shortcut((_SHIFT | _K.right_arrow,), "Shift+Right", "ten frames on", _step(10)),
    Shortcut((_K.home,), "Home", "first frame of the range", _end(False)),
    Shortcut((_K.end,), "End", "last frame of the range", _end(True)),
    Shortcut((_K.i,), "I", "the range starts here", actions.range_in),
    Shortcut((_K.o,), "O", "the range ends here", actions.range_out),
    Shortcut((_K.escape,), "Esc", "close what is on top", actions.cancel),
    Shortcut((_CTRL | _K.q,), "Ctrl+Q", "quit", _want("quit")),
)

_REPEATED = (_K.left_arrow, _K.right_arrow)  # go on while they are held
_ALWAYS = ("Esc", "Ctrl+Q")  # also while a message or dialog lies over everything

MOUSE = (
    ("Click", "choose an actor or joint"),
    ("Double click", "aim the camera there"),
    ("Alt click", "why is this vertex here"),
    ("Left drag", "orbit"),
    ("Right drag, Shift drag", "pan"),
    ("Wheel", "zoom to the pointer"),
    ("Alt drag of the time", "between whole frames"),
    ("Drop files", "open them"),
)


def handle_keys(state: AppState) -> None:
    """Run what was pressed in this frame; letters typed into a text box do nothing here."""
    # ImGui would move the focus with Tab: the key belongs to us.
    imgui.internal.set_key_owner(imgui.Key.tab, imgui.get_id("viewer"))
    # A quick hand lets go of Ctrl within the frame in which the letter goes down: what was held
    # in the frame before still counts, or Ctrl+S would be S.
    now = imgui.get_io().key_mods
    held, state.held_modifiers = now | state.held_modifiers, now
    if imgui.get_io().want_text_input:
        return
    if imgui.is_key_pressed(imgui.Key.escape, False) and _close_menus():
        return
    is_covered = bool(state.error) or state.dialog is not None
    for shortcut in KEYS:
        if is_covered and shortcut.label not in _ALWAYS:
            continue
        if any(_is_pressed(chord, held) for chord in shortcut.chords):
            shortcut.action(state)


def _close_menus() -> bool:
    """Close an open menu or list; return whether there was one. Messages close by themselves."""
    any_popup = imgui.PopupFlags_.any_popup_id | imgui.PopupFlags_.any_popup_level
    has_modal = imgui.internal.get_top_most_popup_modal() is not None
    if has_modal or not imgui.is_popup_open("", any_popup):
        return False
    imgui.internal.close_popup_to_level(0, True)
    return True


def _is_pressed(chord: int, held: int) -> bool:
    """Return whether a key went down with exactly the modifiers of the chord."""
    modifiers = chord & imgui.Key.mod_mask_
    key = imgui.Key(chord & ~modifiers)
    return held == modifiers and imgui.is_key_pressed(key, key in _REPEATED)
