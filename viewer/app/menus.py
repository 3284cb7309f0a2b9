"""Menu bar: File, Edit, View, Window and Help."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import imgui

from viewer.app.closing import request_quit
from viewer.app.core.actions import Action
from viewer.app.core.reasons import (
    no_job_room,
    no_new_clip,
    no_panel,
    no_pose,
    no_redo,
    no_undo,
    nothing_to_export,
)
from viewer.app.core.state import AppState
from viewer.app.core.undo_actions import redo, redone_next, undo, undone_next
from viewer.app.core.widgets import begin_menu, menu_item, note_item
from viewer.app.curves.editing import new_clip
from viewer.app.files.files import (
    Files,
    ask_for_files,
    open_bundled_body,
    open_bundled_figure,
    open_files,
)
from viewer.app.files.model_menu import draw_model_menu
from viewer.app.files.motion_export import ask_for_motion
from viewer.app.keys import Keyboard, want_screenshot
from viewer.app.layout import all_panels, is_open, reset_layout, toggle_panel
from viewer.app.linting.lint_panel import check_rig
from viewer.app.manual import draw_manual_menu
from viewer.app.palette import toggle_palette
from viewer.app.posing.posing import (
    ask_for_export,
    ask_for_pose,
    copy_numbers,
    copy_pose,
    paste_pose,
    reset_pose,
)
from viewer.app.preferences.preferences_window import open_preferences
from viewer.app.recording.recording import open_record_dialog
from viewer.app.rigging.joint_editing.commands import mirror
from viewer.app.view.display_panel import draw_view_menu
from viewer.formats import opened_text
from viewer.phrases import printable

_LONGEST = 40  # maximum length of the name of a step


def draw_menus(state: AppState) -> None:
    """Draw the menu bar."""
    keyboard = state.of(Keyboard)
    if not imgui.begin_main_menu_bar():
        return
    if begin_menu(state, "File"):
        _draw_file_menu(state)
        imgui.end_menu()
    if begin_menu(state, "Edit"):
        for number, actions in enumerate(_EDITING):
            if number:
                imgui.separator()
            _draw_items(state, *actions)
        imgui.end_menu()
    draw_view_menu(state)
    if begin_menu(state, "Window"):
        for name, panel in all_panels().items():
            why = no_panel(state, panel.needs)
            if menu_item(state, panel.title, "", is_open(state, name), why):
                toggle_panel(state, name)
        imgui.separator()
        if menu_item(state, "Messages", "Ctrl+M", state.messages.is_open):
            state.messages.is_open = not state.messages.is_open
        if menu_item(state, "Reset layout"):
            reset_layout(state)
        imgui.end_menu()
    if begin_menu(state, "Help"):
        if menu_item(state, "Keys", "H or ?", keyboard.is_listed):
            keyboard.is_listed = not keyboard.is_listed
        draw_manual_menu(state)
        imgui.end_menu()
    imgui.end_main_menu_bar()


def _draw_file_menu(state: AppState) -> None:
    files = state.of(Files)
    _draw_items(state, Action("Open…", ask_for_files, key="Ctrl+O"))
    if begin_menu(state, "Open recent", bool(files.recent)):
        for number, group in enumerate(files.recent):
            text = printable(" + ".join(opened_text(Path(path)) for path in group), 80)
            if imgui.menu_item(f"{text}##recent{number}", "", False)[0]:
                open_files(state, [Path(path) for path in group])
            note_item(state, f"recent {number}")
            if imgui.is_item_hovered():
                imgui.set_tooltip("\n".join(printable(path, 200) for path in group))
        imgui.end_menu()
    _draw_items(state, *_BUNDLED)
    if begin_menu(state, "Models"):
        draw_model_menu(state)
        imgui.end_menu()
    imgui.separator()
    _draw_items(state, *_SAVING)
    imgui.separator()
    _draw_items(state, Action("Quit", request_quit, key="Ctrl+Q"))


def _draw_items(state: AppState, *actions: Action) -> None:
    for action in actions:
        why, more = action.reason(state), printable(action.more(state), _LONGEST)
        if menu_item(state, action.text, action.key, why=why, more=more):
            action.run(state)


_BUNDLED = (
    Action("Bundled figure", open_bundled_figure),
    Action("Bundled body", open_bundled_body),
)
EXPORTS = (
    Action("Save pose…", ask_for_pose, no_pose),
    Action("Export…", ask_for_export, no_job_room),
    Action(
        "Export motion…",
        ask_for_motion,
        lambda state: nothing_to_export(state) or no_job_room(state),
    ),
    Action("Record pictures or video…", open_record_dialog, no_job_room),
)
"""Actions that write files."""
CHECK = Action("Check the rig", check_rig, no_job_room)
NEW_CLIP = Action("New clip", new_clip, no_new_clip)
_SAVING = (*EXPORTS, Action("Save screenshot", want_screenshot, key="F12"))
_EDITING = (
    (
        Action("Undo", undo, no_undo, "Ctrl+Z", undone_next),
        Action("Redo", redo, no_redo, "Ctrl+Shift+Z", redone_next),
    ),
    (
        Action("Reset pose", reset_pose, key="R"),
        Action("Mirror pose or joints", mirror, no_pose, "M"),
        NEW_CLIP,
        Action("Copy pose", copy_pose, no_pose, "Ctrl+C"),
        Action("Copy pose as raw values", copy_numbers, no_pose, "Ctrl+Shift+C"),
        Action("Paste pose", paste_pose, no_pose, "Ctrl+V"),
    ),
    (
        Action("Find an action…", toggle_palette, key="Ctrl+P"),
        CHECK,
    ),
    (Action("Preferences…", open_preferences, key="Ctrl+,"),),
)
"""Items of the menus, between their separators."""
