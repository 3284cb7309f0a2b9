"""List of the files in a file dialog, chosen with the mouse or the keyboard."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.core.widgets import note_item
from viewer.app.files.file_choice import FileDialog
from viewer.formats import FORMATS
from viewer.phrases import printable

__all__ = ["draw_file_list", "is_confirmed_by_key"]

_PAGE = 12  # number of rows skipped by Page Up and Page Down


def draw_file_list(state: AppState, dialog: FileDialog, below: float) -> list[Path]:
    """Draw the list of files; return a file that was double-clicked.

    Parameters
    ----------
    state : AppState
        Records the positions of the files.
    dialog : FileDialog
        The dialog, whose folder and selection are changed.
    below : float
        Height to leave free, in window coordinates.
    """
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
    keys = imgui.Key
    if not is_typing and imgui.is_key_pressed(keys.backspace, False):
        dialog.enter(dialog.folder.parent)
    steps = {keys.down_arrow: 1, keys.up_arrow: -1, keys.page_down: _PAGE, keys.page_up: -_PAGE}
    step = sum(by for key, by in steps.items() if imgui.is_key_pressed(key))
    if step:
        dialog.move(step)
    return step != 0


def is_confirmed_by_key(dialog: FileDialog) -> bool:
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
