"""Tables of what the user can do: keys, actions, mouse, and the entries of the palette."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from imgui_bundle import imgui

from viewer.app.actors.actors_panel import no_springs, toggle_springs
from viewer.app.actors.parts_panel import show_all_parts
from viewer.app.closing import request_quit
from viewer.app.core.actions import Action, Shortcut, given
from viewer.app.core.reasons import (
    no_drive,
    no_mesh,
    no_panel,
    no_parts,
    no_skeleton,
)
from viewer.app.core.state import AppState, shows_errors
from viewer.app.core.undo_actions import redo, undo
from viewer.app.core.widgets import key_name
from viewer.app.files.files import ask_for_files, open_bundled_body, open_bundled_figure
from viewer.app.keys import cancel, toggle_keys, toggle_messages, toggle_panels, want_screenshot
from viewer.app.layout import all_panels, reset_layout, show_panel
from viewer.app.menus import CHECK, EXPORTS, NEW_CLIP
from viewer.app.palette import Entry, toggle_palette
from viewer.app.playback.animations import choose_animation, step_animation
from viewer.app.playback.timeline_panel import go_to_end, play, range_in, range_out, step
from viewer.app.posing.joint_tree import select_joint
from viewer.app.posing.posing import (
    copy_numbers,
    copy_pose,
    paste_pose,
    random_shape,
    reset_actor,
    reset_pose,
    reset_shape,
)
from viewer.app.posing.toolbar import choose_tool, key_pose_now, next_orientation, no_keys
from viewer.app.preferences.preferences_window import open_preferences
from viewer.app.retargeting.drive_changes import no_edit, toggle_feet, toggle_hands
from viewer.app.retargeting.joint_match_panel import (
    ask_for_map,
    ask_where_to_save,
    match_automatically,
)
from viewer.app.rigging.joint_editing.commands import delete_joint, mirror
from viewer.app.rigging.results import switch_version
from viewer.app.view.camera_panel import fit_selection, fit_view, look, toggle_projection
from viewer.app.view.display_panel import (
    reset_lights,
    set_shading,
    show,
    show_bones,
    toggle_binding,
    toggle_gizmo,
    toggle_option,
    toggle_skeleton,
)
from viewer.app.view.outlines import toggle_outlines
from viewer.app.weights.weights_panel import toggle_picking, toggle_vertex_info, toggle_weights
from viewer.phrases import capitalized, printable
from viewer.rendering.gpu.program import SHADING
from viewer.rendering.options import BONES, SHOWN, Shading
from viewer.rigs.motion.animation_choice import animation_labels
from viewer.rigs.skeleton import joint_labels, shown_joints
from viewer.rigs.skinning import METHODS, unused_methods

_CTRL, _SHIFT = imgui.Key.mod_ctrl, imgui.Key.mod_shift
_K = imgui.Key
_LEFT_OUT = ("Ctrl+P", "Esc")  # shortcuts that open and close the palette
_LONGEST = 60  # maximum length of a name in characters

KEYS = (
    Shortcut((_K.r,), "R", "reset the pose to the file's pose", reset_pose),
    Shortcut((_K.s,), "S", "show or hide the skeleton", toggle_skeleton),
    Shortcut((_K.k,), "K", "posed skin, or skin in bind pose", toggle_binding),
    Shortcut((_K.w,), "W", "wireframe", given(toggle_option, "wireframe", "Wireframe")),
    Shortcut((_K.n,), "N", "vertex normals", given(toggle_option, "normals", "Vertex normals")),
    Shortcut((_K.t,), "T", "texture", given(toggle_option, "texture", "Texture")),
    Shortcut((_K.g,), "G", "ground grid", given(toggle_option, "grid", "Grid")),
    Shortcut((_K.a,), "A", "rigged or original mesh (A/B)", switch_version),
    Shortcut(
        (_K.b,), "B", "x-ray: skeleton through the skin", given(toggle_option, "xray", "X-ray")
    ),
    Shortcut((_K.j,), "J", "joint names", given(toggle_option, "joint_names", "Joint names")),
    Shortcut(
        (_SHIFT | _K.j,), "Shift+J", "joint axes", given(toggle_option, "joint_axes", "Joint axes")
    ),
    Shortcut((_K.v,), "V", "weights of the selected joint", toggle_weights),
    Shortcut((_K.f,), "F", "fit the view", fit_view),
    Shortcut((_K.period, _K.keypad_decimal), ".", "fit the selected joint or actor", fit_selection),
    Shortcut((_K._1, _K.keypad1), "1", "front view", given(look, "front")),
    Shortcut((_K._3, _K.keypad3), "3", "side view", given(look, "left")),
    Shortcut((_K._7, _K.keypad7), "7", "top view", given(look, "top")),
    Shortcut((_CTRL | _K._1, _CTRL | _K.keypad1), "Ctrl+1", "back view", given(look, "back")),
    Shortcut((_CTRL | _K._3, _CTRL | _K.keypad3), "Ctrl+3", "other side", given(look, "right")),
    Shortcut(
        (_CTRL | _K._7, _CTRL | _K.keypad7), "Ctrl+7", "view from below", given(look, "bottom")
    ),
    Shortcut((_K._5, _K.keypad5), "5", "orthographic or perspective", toggle_projection),
    Shortcut((_K.tab,), "Tab", "hide or show the panels", toggle_panels),
    Shortcut((_K.h, _SHIFT | _K.slash, _K.f1), "H or ?", "this list", toggle_keys),
    Shortcut((_CTRL | _K.p,), "Ctrl+P", "find an action", toggle_palette),
    Shortcut((_CTRL | _K.m,), "Ctrl+M", "message log", toggle_messages),
    Shortcut((_K.f12,), "F12", "save a screenshot", want_screenshot),
    Shortcut((_CTRL | _K.o,), "Ctrl+O", "open files", ask_for_files),
    Shortcut((_CTRL | _K.comma,), "Ctrl+,", "preferences", open_preferences),
    Shortcut((_CTRL | _K.z,), "Ctrl+Z", "undo", undo),
    Shortcut((_CTRL | _SHIFT | _K.z, _CTRL | _K.y), "Ctrl+Shift+Z", "redo", redo),
    Shortcut((_K.q,), "Q", "Select tool: click selects", given(choose_tool, "select")),
    Shortcut((_K.e,), "E", "Rotate tool: rotate the selected joint", given(choose_tool, "rotate")),
    Shortcut((_K.d,), "D", "Move tool: drag a joint (IK)", given(choose_tool, "move")),
    Shortcut((_K.x,), "X", "local, parent or world axes", next_orientation),
    Shortcut((_K.m,), "M", "mirror the pose, or edited joints", mirror),
    Shortcut((_K.delete,), "Delete", "remove an edited joint", delete_joint),
    Shortcut((_CTRL | _K.c,), "Ctrl+C", "copy the pose", copy_pose),
    Shortcut(
        (_CTRL | _SHIFT | _K.c,), "Ctrl+Shift+C", "copy the pose as raw pose values", copy_numbers
    ),
    Shortcut((_CTRL | _K.v,), "Ctrl+V", "paste a pose", paste_pose),
    Shortcut((_K.space,), "Space", "play or pause", play),
    Shortcut((_K.left_arrow,), "Left", "one frame back", given(step, -1)),
    Shortcut((_K.right_arrow,), "Right", "one frame forward", given(step, 1)),
    Shortcut((_SHIFT | _K.left_arrow,), "Shift+Left", "ten frames back", given(step, -10)),
    Shortcut((_SHIFT | _K.right_arrow,), "Shift+Right", "ten frames forward", given(step, 10)),
    Shortcut((_K.home,), "Home", "first frame of the range", given(go_to_end, False)),
    Shortcut((_K.end,), "End", "last frame of the range", given(go_to_end, True)),
    Shortcut((_K.left_bracket,), "[", "previous animation", given(step_animation, -1)),
    Shortcut((_K.right_bracket,), "]", "next animation", given(step_animation, 1)),
    Shortcut((_K.i,), "I", "start the range here", range_in),
    Shortcut((_K.o,), "O", "end the range here", range_out),
    Shortcut((_K.escape,), "Esc", "close the topmost dialog", cancel),
    Shortcut((_CTRL | _K.q,), "Ctrl+Q", "quit", request_quit),
)
"""Keys in the order in which they are listed."""

ACTIONS = (
    Action("Open the bundled figure", open_bundled_figure),
    Action("Open the bundled body", open_bundled_body),
    *EXPORTS,
    CHECK,
    NEW_CLIP,
    Action("Key the pose at the current time", key_pose_now, no_keys),
    Action("Reset the pose of this actor", reset_actor),
    Action("Reset shape", reset_shape),
    Action("Random shape", random_shape),
    Action("Match joints automatically", match_automatically, no_edit),
    Action("Load joint map…", ask_for_map, no_edit),
    Action("Save joint map…", ask_where_to_save, no_drive),
    Action("Show all parts", show_all_parts, no_parts),
    Action("Feet on the ground", toggle_feet, no_edit),
    Action("Hands at the body", toggle_hands, no_edit),
    Action("Springs", toggle_springs, no_springs),
    Action("Reset lights", reset_lights),
    Action("Axis gizmo", toggle_gizmo),
    Action("Selection outlines", toggle_outlines),
    Action("Pick vertices", toggle_picking, no_mesh),
    Action("Inspect vertex under cursor", toggle_vertex_info, no_mesh),
    Action("Reset layout", reset_layout),
)
"""Actions of menus and panels that have no key."""

MOUSE = (
    ("Click", "select an actor or joint"),
    ("Double click", "aim the camera there"),
    ("Alt click", "explain this vertex"),
    ("Left drag", "orbit"),
    ("Right drag, Shift drag", "pan"),
    ("Right click", "menu of actions"),
    ("Wheel", "zoom to the pointer"),
    ("Alt drag in the timeline", "seek between whole frames"),
    ("Axis gizmo", "click for a view, drag to orbit"),
    ("Drop files", "open them"),
)
"""Actions of the mouse, listed with the keys."""


def entries(state: AppState) -> list[Entry]:
    """Return all entries for the current scene."""
    kinds = (_actions, _panels, _choices, _animations, _joints, _figures)
    return [entry for kind in kinds for entry in kind(state)]


def _actions(state: AppState) -> Iterator[Entry]:
    for key in KEYS:
        if key.label not in _LEFT_OUT:
            yield Entry(
                capitalized(key.text),
                "action",
                key.run,
                key_name(state, key.label),
            )
    for action in ACTIONS:
        yield Entry(action.text, "action", action.run, why=action.reason(state))


def _panels(state: AppState) -> Iterator[Entry]:
    for name, panel in all_panels().items():
        why = no_panel(state, panel.needs)
        yield Entry(panel.title, "panel", partial(_open_panel, name=name), why=why)


def _open_panel(state: AppState, name: str) -> None:
    """Open a panel, or bring it to the front of its tabs."""
    state.panels_visible = True
    show_panel(state, name)


def _choices(state: AppState) -> Iterator[Entry]:
    """Yield the choices of shading, skeletons and skinning."""
    for shading, text in SHADING.items():
        yield Entry(f"Shading: {text}", "choice", partial(_shade, name=shading))
    for shown, text in SHOWN.items():
        yield Entry(f"Show: {text}", "choice", partial(show, what=shown))
    for style, text in BONES.items():
        yield Entry(
            f"Bones: {text}", "choice", partial(show_bones, style=style), why=no_skeleton(state)
        )
    for name, method in METHODS.items():
        yield Entry(f"Skinning: {method.title}", "choice", partial(_skin, name=name))
    for plugin in unused_methods():
        title = f"{plugin.name} ({plugin.distribution})"
        yield Entry(f"Skinning: {title}", "choice", partial(_skin, name=plugin.name))


def _shade(state: AppState, name: Shading) -> None:
    set_shading(state, name)
    state.say_status(SHADING[name])


@shows_errors
def _skin(state: AppState, name: str) -> None:
    state.options.skinning.method = name
    state.say_status(METHODS[name].title)


def _animations(state: AppState) -> Iterator[Entry]:
    """Yield the animations of the chosen actor."""
    labels = animation_labels(state.actor.figure)
    for index, label in enumerate(labels):
        text = f"Play animation: {printable(label, _LONGEST)}"
        yield Entry(text, "animation", partial(choose_animation, index=index))
    if labels:
        yield Entry("Play no animation", "animation", partial(choose_animation, index=-1))


def _joints(state: AppState) -> Iterator[Entry]:
    """Yield the joints of the chosen actor."""
    skeleton = state.actor.figure.skeleton
    if skeleton is None:
        return
    labels = joint_labels(skeleton)
    for joint in shown_joints(skeleton).tolist():
        yield Entry(printable(labels[joint], _LONGEST), "joint", partial(select_joint, joint=joint))


def _figures(state: AppState) -> Iterator[Entry]:
    for index, actor in enumerate(state.scene.actors):
        yield Entry(printable(actor.name, _LONGEST), "figure", partial(_choose, index=index))


def _choose(state: AppState, index: int) -> None:
    state.select_actor(index)
    state.say_status(printable(state.actor.name, _LONGEST))
