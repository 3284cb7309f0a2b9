"""File dialog drawn in the window, which makes it the same on every system and testable.

It asks for files to open, for a folder, or for a file to save; the caller handles the choice.
"""

from __future__ import annotations

import os
from pathlib import Path

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.core.text_fields import name_field, text_field
from viewer.app.core.widgets import button, note_item
from viewer.app.files.file_choice import FileDialog
from viewer.app.files.file_list import draw_file_list, is_confirmed_by_key
from viewer.app.files.state import Files
from viewer.phrases import printable

__all__ = ["draw_file_dialog"]

_SIZE = (46.0, 33.0)  # size of the dialog, in font sizes
_RIG = {".skel", ".skin"}


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
    if result and dialog.done is None:
        files.wants_open = result
    elif result and dialog.done is not None:
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
    result = draw_file_list(state, dialog, _foot_height(dialog))
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
    pressed = button(state, label, "" if count else missing) or is_confirmed_by_key(dialog)
    if entered and label.startswith("Replace"):
        dialog.problem = f"{printable(dialog.name.strip(), 90)} exists: press Replace to replace it"
    elif count and (pressed or entered):
        result = _confirmed(dialog)
    imgui.same_line()
    if button(state, "Cancel"):
        state.of(Files).dialog = None
    if dialog.purpose == "open" and dialog.suffixes >= _RIG:
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


def _foot_height(dialog: FileDialog) -> float:
    """Return the height of the widgets below the list."""
    return (
        1.5 * imgui.get_frame_height()
        + dialog.more_rows * imgui.get_text_line_height_with_spacing()
        + imgui.get_style().item_spacing.y
    )
