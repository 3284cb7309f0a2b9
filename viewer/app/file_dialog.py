"""A dialog to choose files, drawn in the window: the same on every system, and testable."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import imgui

from viewer.app.state import AppState
from viewer.app.widgets import button, note_item
from viewer.errors import printable
from viewer.formats import FORMATS

__all__ = ["FileDialog", "draw_file_dialog"]

_TITLE = "Open files"


class FileDialog:
    """A folder being looked at and the files chosen in it.

    Parameters
    ----------
    folder : Path
        Where to start.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.chosen: set[Path] = set()
        self.shows_all = False
        self.problem = ""
        self.entries: list[Path] = []
        self.is_new = True
        self.enter(folder)

    def enter(self, folder: Path) -> None:
        """Look into a folder; one that cannot be read leaves the dialog where it was."""
        try:
            found = sorted(
                folder.iterdir(), key=lambda path: (not path.is_dir(), path.name.lower())
            )
        except OSError as problem:
            self.problem = f"{printable(folder)}: {problem.strerror}"
            return
        self.folder, self.entries, self.problem = folder, found, ""
        self.chosen.clear()

    def typed(self, text: str) -> Path | None:
        """Return the file that a text names, or look into the folder that it names."""
        try:
            path = Path(text).expanduser()
            if path.is_file():
                return path
        except (OSError, RuntimeError) as problem:  # too long; no such user
            self.problem = f"{printable(text)}: {getattr(problem, 'strerror', None) or problem}"
            return None
        self.enter(path)
        return None

    def listed(self) -> list[Path]:
        """Return folders, and the files that can be opened or all files."""
        suffixes = {suffix for kind in FORMATS.values() for suffix in kind.suffixes}
        return [
            path
            for path in self.entries
            if not path.name.startswith(".")
            and (path.is_dir() or self.shows_all or path.suffix.lower() in suffixes)
        ]


def draw_file_dialog(state: AppState) -> list[Path]:
    """Draw the dialog if there is one; return the files to open when the user has chosen."""
    dialog = state.dialog
    if dialog is None:
        return []
    if dialog.is_new:
        imgui.open_popup(_TITLE)
        dialog.is_new = False
    size = imgui.get_main_viewport().size
    room = (min(620.0, 0.95 * size.x), min(460.0, 0.92 * size.y))
    imgui.set_next_window_size(room, imgui.Cond_.appearing)
    center = imgui.get_main_viewport().get_center()
    imgui.set_next_window_pos(center, imgui.Cond_.appearing, (0.5, 0.5))
    result: list[Path] = []
    opened, stays = imgui.begin_popup_modal(_TITLE, True)
    if opened:
        result = _draw_content(state, dialog)
        imgui.end_popup()
    if result or not stays:
        state.dialog = None
    return result


def _draw_content(state: AppState, dialog: FileDialog) -> list[Path]:
    imgui.set_next_item_width(-1.0)
    entered, text = imgui.input_text(
        "##folder", str(dialog.folder), imgui.InputTextFlags_.enter_returns_true
    )
    note_item(state, "Folder")
    if entered:
        path = dialog.typed(text)
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
    result = _draw_list(state, dialog)
    count = len(dialog.chosen)
    imgui.begin_disabled(count == 0)
    pressed = button(state, f"Open {count} files###Open" if count > 1 else "Open###Open")
    if pressed or (count and imgui.is_key_pressed(imgui.Key.enter, False)):
        result = sorted(dialog.chosen)
    imgui.end_disabled()
    imgui.same_line()
    if button(state, "Cancel"):
        state.dialog = None
    imgui.same_line()
    imgui.text_disabled("Ctrl+click chooses several: a .skel and its .skin")
    return result


def _draw_list(state: AppState, dialog: FileDialog) -> list[Path]:
    result: list[Path] = []
    if imgui.begin_child(
        "files", (0.0, -1.5 * imgui.get_frame_height()), imgui.ChildFlags_.borders
    ):
        for number, path in enumerate(dialog.listed()):
            is_folder = path.is_dir()
            name = printable(path.name, 90) + ("/" if is_folder else "")
            flags = imgui.SelectableFlags_.allow_double_click
            flags |= imgui.SelectableFlags_.no_auto_close_popups
            # The name is drawn as text: "##" in a label would hide what follows.
            pressed, _ = imgui.selectable(f"##file{number}", path in dialog.chosen, flags)
            note_item(state, f"file {path.name}")
            imgui.same_line(0.0, 0.0)
            imgui.text_unformatted(name)
            if not pressed:
                continue
            if is_folder:
                dialog.enter(path)
                break
            if imgui.is_mouse_double_clicked(imgui.MouseButton_.left):
                result = [path]
            elif imgui.get_io().key_ctrl:
                dialog.chosen ^= {path}
            else:
                dialog.chosen = {path}
    imgui.end_child()
    return result
