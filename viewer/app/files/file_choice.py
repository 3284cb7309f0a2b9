"""Files being chosen in a dialog: its folder, what is listed and chosen there, and what follows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from viewer.app.core.state import AppState
from viewer.errors import printable
from viewer.formats import FORMATS

__all__ = ["PICTURES", "FileDialog", "folder_of"]

PICTURES = (".png", ".jpg", ".jpeg")
"""Suffixes of textures."""


class FileDialog:
    """A folder being looked at and the files chosen in it.

    Parameters
    ----------
    folder : Path
        Where to start.
    done : callable
        Called with the state and what was chosen: files, one folder, or one file to write.
        Opens them if omitted.
    purpose : str
        ``"open"``, ``"folder"`` or ``"save"``.
    title : str
        Of the dialog.
    suffixes : tuple of str
        Files that are listed; all that can be opened if empty.
    name : str
        Suggested name of the file to write; its suffix is added to names that have none.
    more : callable, optional
        Draws what else is asked for, given the state and the dialog.
    written : callable, optional
        Returns all files that are written for a name; that file alone if omitted.
    """

    def __init__(
        self,
        folder: Path,
        done: Callable[[AppState, list[Path]], None] | None = None,
        purpose: str = "open",
        title: str = "Open files",
        suffixes: tuple[str, ...] = (),
        name: str = "",
        more: Callable[[AppState, FileDialog], None] | None = None,
        written: Callable[[Path], list[Path]] | None = None,
    ) -> None:
        self.more, self.written = more, written
        self.done, self.purpose, self.title, self.name = done, purpose, title, name
        self.suffixes = set(suffixes or opened_suffixes())
        self.suffix = Path(name).suffix
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

    def target(self) -> Path | None:
        """Return the file to write, by its name with a suffix; None if it has no name."""
        name = Path(self.name.strip())
        if not name.name.strip("."):
            return None
        path = self.folder / name
        return path if path.suffix else path.with_name(path.name + self.suffix)

    def listed(self) -> list[Path]:
        """Return folders, and the files that can be opened or all files."""
        return [
            path
            for path in self.entries
            if not path.name.startswith(".")
            and (path.is_dir() or self.shows_all or path.suffix.lower() in self.suffixes)
        ]


def opened_suffixes() -> set[str]:
    """Return the suffixes of files that can be opened, textures among them."""
    suffixes = {suffix for kind in FORMATS.values() for suffix in kind.suffixes}
    # Most .txt files are no poses; the check box lists them too.
    return suffixes - {".txt"} | set(PICTURES)


def folder_of(paths: Sequence[Path]) -> Path:
    """Return where a dialog begins: beside the first file, else the current folder, else home."""
    try:
        return paths[0].resolve().parent if paths else Path.cwd()
    except (OSError, RuntimeError):  # the folder is gone
        return Path.home()
