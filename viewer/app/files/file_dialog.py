"""File dialog drawn in the window, which makes it the same on every system and testable.

It asks for files to open, for a folder, or for a file to save; the caller handles the choice.
"""

from __future__ import annotations

import os
from pathlib import Path

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.core.text_fields import name_field, text_field
from viewer.app.core.widgets import button, note_item, pressed_step
from viewer.app.files.file_choice import FileDialog
from viewer.app.files.files import Files
from viewer.formats import FORMATS
from viewer.phrases import printable

_SIZE = (46.0, 33.0)  # size of the dialog, in font sizes
_RIG = {".skel", ".skin"}
_PAGE = 12  # number of rows skipped by Page Up and Page Down


def draw_file_dialog(state: AppState) -> None:
    """Draw the dialog if there is one, and run its action once the user has chosen."""
    files = state.of(Files)
    dialog = files.dialog
    if dialog is None:
        return
    if dialog.is_new:
        imgui.open_popup(dialog.title)
        dialog.is_new = False
    size, letter = imgui.get_main_viewport().size, imgui.get_font_size()
    room = (min(_SIZE[0] * letter, 0.95 * size.x), min(_SIZE[1] * letter, 0.92 * size.y))
    imgui.set_next_window_size(room, imgui.Cond_.appearing)
    center = imgui.get_main_viewport().get_center()
    imgui.set_next_window_pos(center, imgui.Cond_.appearing, (0.5, 0.5))
    result: list[Path] = []
    opened, stays = imgui.begin_popup_modal(dialog.title, True)
    if opened:
        result = _draw_content(state, dialog)
        imgui.end_popup()
    if result or not stays:
        files.dialog = None
    if result and dialog.done is not None:
        dialog.done(state, result)


def _draw_content(state: AppState, dialog: FileDialog) -> list[Path]:
    path = _draw_path(state, dialog)
    if path is not None:
        return [path]
    if button(state, "Up"):
        dialog.enter(dialog.folder.parent)
    imgui.same_line()
    if button(state, "Home"):
        dialog.enter(Path.home())
    imgui.same_line()
    dialog.shows_all = imgui.checkbox("All files", dialog.shows_all)[1]
    if dialog.problem:
        imgui.text_wrapped(dialog.problem)
    below = 1.5 * imgui.get_frame_height() + imgui.get_style().item_spacing.y
    below += dialog.more_rows * imgui.get_text_line_height_with_spacing()
    result = _draw_file_list(state, dialog, below)
    return result or _draw_buttons(state, dialog)


def _draw_path(state: AppState, dialog: FileDialog) -> Path | None:
    """Draw the path field; return the file whose path was entered."""
    imgui.set_next_item_width(-1.0)
    if imgui.is_window_appearing() and dialog.purpose != "save":
        imgui.set_keyboard_focus_here()
    flags = imgui.InputTextFlags_.enter_returns_true
    entered, text = text_field("##folder", str(dialog.folder), "Path of a folder or file", flags)
    note_item(state, "Folder")
    _close_on_escape(state)
    dialog.is_path_active = imgui.is_item_active() or entered
    # Enter confirms the files chosen in the list unless another path was typed.
    if not entered or text == str(dialog.folder):
        return None
    dialog.is_path_active = False
    path = dialog.typed(text)
    return path if dialog.purpose == "open" else None


def _draw_buttons(state: AppState, dialog: FileDialog) -> list[Path]:
    """Draw the buttons; return the confirmed choice."""
    result: list[Path] = []
    if dialog.more is not None:
        dialog.more(state, dialog)
    entered = dialog.purpose == "save" and _draw_name(state, dialog)
    count, label = _confirmation(dialog)
    missing = "enter a name" if dialog.purpose == "save" else "choose a file"
    pressed = button(state, label, "" if count else missing) or _is_confirmed_by_key(dialog)
    if entered and label.startswith("Replace"):
        dialog.problem = f"{printable(dialog.name.strip(), 90)} exists: press Replace to replace it"
    elif count and (pressed or entered):
        result = _confirmed(dialog)
    imgui.same_line()
    if button(state, "Cancel"):
        state.of(Files).dialog = None
    if dialog.purpose == "open" and _RIG.issubset(dialog.suffixes):
        imgui.same_line()
        imgui.text_disabled("Ctrl+click selects several: a .skel and its .skin")
        note_item(state, "several files")
    return result


def _draw_name(state: AppState, dialog: FileDialog) -> bool:
    """Draw the field for the name; return whether Enter confirmed the name of a file."""
    imgui.set_next_item_width(0.5 * imgui.get_content_region_avail().x)
    if imgui.is_window_appearing():
        imgui.set_keyboard_focus_here()
    entered, dialog.name = name_field("##name", dialog.name, "Name of the file")
    note_item(state, "Name")
    _close_on_escape(state)
    if imgui.is_item_deactivated():
        dialog.name = dialog.typed_name()
    imgui.same_line()
    return entered and not dialog.follow_name()


def _close_on_escape(state: AppState) -> None:
    """Close the dialog if Escape was pressed in the last field and it had no edit to revert."""
    is_left = imgui.is_item_deactivated() and not imgui.is_item_deactivated_after_edit()
    if is_left and imgui.is_key_pressed(imgui.Key.escape, False):
        state.of(Files).dialog = None


def _confirmation(dialog: FileDialog) -> tuple[int, str]:
    """Return the number of files to confirm, and the label of the confirming button."""
    if dialog.purpose == "folder":
        return 1, "Use this folder"
    if dialog.purpose == "save":
        target = dialog.target()
        files = [] if target is None else dialog.written(target) if dialog.written else [target]
        # Path.exists() would raise for a name that is too long.
        exists = any(map(os.path.exists, files))
        return int(target is not None), "Replace###Save" if exists else "Save###Save"
    count = len(dialog.chosen)
    return count, f"Open {count} files###Open" if count > 1 else "Open###Open"


def _confirmed(dialog: FileDialog) -> list[Path]:
    """Return the choice for the purpose of the dialog."""
    if dialog.purpose == "folder":
        return [dialog.folder]
    if dialog.purpose == "save":
        target = dialog.target()
        return [] if target is None else [target]
    return sorted(dialog.chosen)


def _draw_file_list(state: AppState, dialog: FileDialog, below: float) -> list[Path]:
    """Draw the list of files; return a file that was double-clicked."""
    moved = _move(dialog)
    result: list[Path] = []
    if imgui.begin_child("files", (0.0, -below), imgui.ChildFlags_.borders):
        for number, path in enumerate(dialog.listed()):
            is_folder = path in dialog.folders
            name = printable(path.name, 90) + ("/" if is_folder else "")
            flags = imgui.SelectableFlags_.allow_double_click
            flags |= imgui.SelectableFlags_.no_auto_close_popups
            # The name is drawn as text, because "##" in a label would hide everything after it.
            is_marked = path in dialog.chosen or path == dialog.current
            pressed, _ = imgui.selectable(f"##file{number}", is_marked, flags)
            note_item(state, f"file {path.name}")
            if moved and path == dialog.current:
                imgui.set_scroll_here_y(0.5)
            imgui.same_line(0.0, 0.0)
            imgui.text_unformatted(name)
            if not pressed:
                continue
            dialog.current = None
            if is_folder and _is_model_folder(dialog, path):
                dialog.chosen = {path}
            elif is_folder:
                dialog.enter(path)
                break
            elif dialog.purpose == "save":
                dialog.name = path.name
            elif dialog.purpose == "folder":
                continue
            elif imgui.is_mouse_double_clicked(imgui.MouseButton_.left):
                result = [path]
            elif imgui.get_io().key_ctrl and not dialog.is_single:
                dialog.chosen ^= {path}
            else:
                dialog.chosen = {path}
    imgui.end_child()
    return result


def _move(dialog: FileDialog) -> bool:
    """Navigate the list and the folders by keyboard; return whether the highlight moved."""
    is_typing = imgui.get_io().want_text_input
    if is_typing and not dialog.is_path_active:
        return False
    if not is_typing and imgui.is_key_pressed(imgui.Key.backspace, False):
        dialog.enter(dialog.folder.parent)
    step = pressed_step(_PAGE)
    if step:
        dialog.move(step)
    return step != 0


def _is_confirmed_by_key(dialog: FileDialog) -> bool:
    """Return whether Enter confirms the chosen files; a highlighted folder is opened instead."""
    enter = any(
        imgui.is_key_pressed(key, False) for key in (imgui.Key.enter, imgui.Key.keypad_enter)
    )
    is_typing = imgui.get_io().want_text_input and not dialog.is_path_active
    if is_typing or not enter or dialog.purpose == "save":
        return False
    if dialog.current is not None and dialog.current in dialog.folders:
        dialog.enter(dialog.current)
        return False
    return dialog.purpose == "open"


def _is_model_folder(dialog: FileDialog, path: Path) -> bool:
    """Return whether a folder can itself be opened like a file; a double click enters it."""
    if dialog.purpose != "open" or imgui.is_mouse_double_clicked(imgui.MouseButton_.left):
        return False
    names = {name for kind in FORMATS.values() for name in kind.files}
    return path.name in names or any((path / name).exists() for name in names)
