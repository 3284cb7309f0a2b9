"""Menu bar: File, Edit, View, Window and Help."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import imgui

from viewer.app.closing import request_quit
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
from viewer.app.core.undo_actions import redo, undo
from viewer.app.core.widgets import begin_menu, menu_item, note_item
from viewer.app.curves.editing import new_clip
from viewer.app.files.file_choice import FileDialog, folder_of
from viewer.app.files.files import (
    Files,
    ask_for_files,
    open_bundled_body,
    open_bundled_figure,
    open_files,
)
from viewer.app.files.model_menu import draw_model_menu
from viewer.app.files.motion_export import N_ROWS, ask_for_motion, draw_pose_formats, pose_formats
from viewer.app.keys import Keyboard, want_screenshot
from viewer.app.layout import PANELS, is_open, reset_layout, toggle_panel
from viewer.app.linting.lint_panel import check_rig
from viewer.app.manual import draw_manual_menu
from viewer.app.palette import toggle_palette
from viewer.app.posing.posing import (
    ask_for_pose,
    copy_numbers,
    copy_pose,
    mirror,
    paste_pose,
    reset_pose,
    save_export,
)
from viewer.app.preferences.preferences_window import open_preferences
from viewer.app.recording.record_dialog import open_record_dialog
from viewer.app.view.display_panel import draw_view_menu
from viewer.export import files_written
from viewer.formats import file_stem, opened_text
from viewer.phrases import printable


def draw_menus(state: AppState) -> None:
    """Draw the menu bar."""
    keyboard = state.of(Keyboard)
    if not imgui.begin_main_menu_bar():
        return
    if begin_menu(state, "File"):
        _draw_file_menu(state)
        imgui.end_menu()
    if begin_menu(state, "Edit"):
        _draw_edit_menu(state)
        imgui.end_menu()
    draw_view_menu(state)
    if begin_menu(state, "Window"):
        for name, panel in PANELS.items():
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
    if menu_item(state, "Open…", "Ctrl+O"):
        ask_for_files(state)
    if begin_menu(state, "Open recent", bool(files.recent)):
        for number, group in enumerate(files.recent):
            text = printable(" + ".join(opened_text(Path(path)) for path in group), 80)
            if imgui.menu_item(f"{text}##recent{number}", "", False)[0]:
                open_files(state, [Path(path) for path in group])
            note_item(state, f"recent {number}")
            if imgui.is_item_hovered():
                imgui.set_tooltip("\n".join(printable(path, 200) for path in group))
        imgui.end_menu()
    if menu_item(state, "Bundled figure"):
        open_bundled_figure(state)
    if menu_item(state, "Bundled body"):
        open_bundled_body(state)
    if begin_menu(state, "Models"):
        draw_model_menu(state)
        imgui.end_menu()
    imgui.separator()
    if menu_item(state, "Save pose…", why=no_pose(state)):
        ask_for_pose(state)
    if menu_item(state, "Export…", why=no_job_room(state)):
        ask_for_export(state)
    if menu_item(state, "Export motion…", why=nothing_to_export(state) or no_job_room(state)):
        ask_for_motion(state)
    if menu_item(state, "Record pictures or video…", why=no_job_room(state)):
        open_record_dialog(state)
    if menu_item(state, "Save screenshot", "F12"):
        want_screenshot(state)
    imgui.separator()
    if menu_item(state, "Quit", "Ctrl+Q"):
        request_quit(state)


def ask_for_export(state: AppState) -> None:
    """Ask where to export the chosen actor in its current pose."""
    suffixes = tuple(pose_formats())
    state.of(Files).dialog = FileDialog(
        folder_of(state.paths),
        lambda state, paths: save_export(state, paths[0]),
        "save",
        "Export",
        suffixes,
        f"{file_stem(state.actor.name)}.obj",
        more=draw_pose_formats,
        more_rows=N_ROWS,
        written=lambda path: files_written(path) if path.suffix.lower() in suffixes else [path],
    )


def _draw_edit_menu(state: AppState) -> None:
    if menu_item(state, "Undo", "Ctrl+Z", why=no_undo(state)):
        undo(state)
    if menu_item(state, "Redo", "Ctrl+Shift+Z", why=no_redo(state)):
        redo(state)
    imgui.separator()
    why = no_pose(state)
    if menu_item(state, "Reset pose", "R"):
        reset_pose(state)
    if menu_item(state, "Mirror pose", "M", why=why):
        mirror(state)
    if menu_item(state, "New clip", why=no_new_clip(state)):
        new_clip(state)
    if menu_item(state, "Copy pose", "Ctrl+C", why=why):
        copy_pose(state)
    if menu_item(state, "Copy pose as raw values", "Ctrl+Shift+C", why=why):
        copy_numbers(state)
    if menu_item(state, "Paste pose", "Ctrl+V", why=why):
        paste_pose(state)
    imgui.separator()
    if menu_item(state, "Find an action…", "Ctrl+P"):
        toggle_palette(state)
    if menu_item(state, "Check the rig", why=no_job_room(state)):
        check_rig(state)
    imgui.separator()
    if menu_item(state, "Preferences…", "Ctrl+,"):
        open_preferences(state)
