"""File dialog drawn in the window, which makes it the same on every system and testable.

It asks for files to open, for a folder, or for a file to save; the caller handles the choice.
"""

from __future__ import annotations

import os
from pathlib import Path

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.core.widgets import button, note_item
from viewer.app.files.file_choice import FileDialog
from viewer.app.files.state import Files
from viewer.formats import FORMATS
from viewer.phrases import printable

__all__ = ["draw_file_dialog"]

_HINTS = {
    "open": "Ctrl+click selects several: a .skel and its .skin",
    "folder": "",
    "save": "",
}


def draw_file_dialog(state: AppState) -> None:
    """Draw the dialog if there is one, and run its action once the user has chosen."""
    files = state.of(Files)
    dialog = files.dialog
    if dialog is None:
        return
    if dialog.is_new:
        imgui.open_popup(dialog.title)
        dialog.is_new = False
    size = imgui.get_main_viewport().size
    room = (min(620.0, 0.95 * size.x), min(460.0, 0.92 * size.y))
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
    imgui.set_next_item_width(-1.0)
    entered, text = imgui.input_text(
        "##folder", str(dialog.folder), imgui.InputTextFlags_.enter_returns_true
    )
    note_item(state, "Folder")
    if entered:
        path = dialog.typed(text)
        if path is not None and dialog.purpose == "open":
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
    result = _draw_list(state, dialog)
    return result or _draw_buttons(state, dialog)


def _draw_buttons(state: AppState, dialog: FileDialog) -> list[Path]:
    """Draw the buttons; return the confirmed choice."""
    result: list[Path] = []
    if dialog.more is not None:
        dialog.more(state, dialog)
    if dialog.purpose == "save":
        imgui.set_next_item_width(0.5 * imgui.get_content_region_avail().x)
        dialog.name = imgui.input_text("##name", dialog.name)[1]
        note_item(state, "Name")
        imgui.same_line()
    count, label = _confirmation(dialog)
    missing = "enter a name" if dialog.purpose == "save" else "choose a file"
    pressed = button(state, label, "" if count else missing)
    by_key = count and dialog.purpose == "open" and imgui.is_key_pressed(imgui.Key.enter, False)
    if pressed or by_key:
        result = _confirmed(dialog)
    imgui.same_line()
    if button(state, "Cancel"):
        state.of(Files).dialog = None
    imgui.same_line()
    imgui.text_disabled(_HINTS[dialog.purpose])
    return result


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


def _draw_list(state: AppState, dialog: FileDialog) -> list[Path]:
    """Draw the list of files; return a file that was double-clicked."""
    result: list[Path] = []
    if imgui.begin_child("files", (0.0, -_foot_height(dialog)), imgui.ChildFlags_.borders):
        for number, path in enumerate(dialog.listed()):
            is_folder = path.is_dir()
            name = printable(path.name, 90) + ("/" if is_folder else "")
            flags = imgui.SelectableFlags_.allow_double_click
            flags |= imgui.SelectableFlags_.no_auto_close_popups
            # The name is drawn as text: "##" in a label would hide the rest.
            pressed, _ = imgui.selectable(f"##file{number}", path in dialog.chosen, flags)
            note_item(state, f"file {path.name}")
            imgui.same_line(0.0, 0.0)
            imgui.text_unformatted(name)
            if not pressed:
                continue
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
            elif imgui.get_io().key_ctrl:
                dialog.chosen ^= {path}
            else:
                dialog.chosen = {path}
    imgui.end_child()
    return result


def _foot_height(dialog: FileDialog) -> float:
    """Return the height of the widgets below the list."""
    more = 0.0 if dialog.more is None else imgui.get_frame_height_with_spacing()
    return 1.5 * imgui.get_frame_height() + more


def _is_model_folder(dialog: FileDialog, path: Path) -> bool:
    """Return whether a folder can itself be opened like a file; a double click enters it."""
    if dialog.purpose != "open" or imgui.is_mouse_double_clicked(imgui.MouseButton_.left):
        return False
    names = {name for kind in FORMATS.values() for name in kind.files}
    return path.name in names or any((path / name).exists() for name in names)
