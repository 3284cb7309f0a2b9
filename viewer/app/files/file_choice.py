"""State of a file dialog: its folder, the listed and chosen files, and the action that follows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field
from pathlib import Path, PurePath
from typing import Literal
from urllib.parse import unquote, urlsplit

from viewer.app.core.state import AppState
from viewer.data_classes import dataclass
from viewer.errors import reason_of
from viewer.formats import all_suffixes
from viewer.phrases import printable

PICTURES = (".png", ".jpg", ".jpeg")
"""File suffixes of texture images."""


@dataclass(slots=True, eq=False)
class FileDialog:
    """An open folder and the files chosen in it."""

    folder: Path
    """Folder that is listed."""
    done: Callable[[AppState, list[Path]], object] | None = None
    """Called with the state and the choice: files, one folder, or one file to write."""
    purpose: Literal["open", "folder", "save"] = "open"
    """What is chosen."""
    title: str = "Open files"
    """Title of the dialog."""
    suffixes: tuple[str, ...] = ()
    """Suffixes of the listed files, and of those that can be written in place of the suggested one;
    if empty, those of all formats that can be opened."""
    name: str = ""
    """Suggested or typed name of the file to write."""
    more: Callable[[AppState, FileDialog], None] | None = None
    """Draws further widgets below the list."""
    more_rows: float = 0.0
    """Height of those widgets, in lines of text."""
    written: Callable[[Path], list[Path]] | None = None
    """Returns all files that are written for a name; if omitted, only the named file is written."""
    is_single: bool = False
    """Whether only one file can be chosen."""
    suffix: str = field(default="", init=False)
    """Suffix that is added to a name without one."""
    suggested: str = field(default="", init=False)
    """Name that was suggested first."""
    chosen: set[Path] = field(default_factory=set)
    current: Path | None = None
    """Chosen files, and the highlighted one."""
    shows_all: bool = False
    """Whether files with other suffixes are listed too."""
    problem: str = ""
    """Message above the list; empty if there is none."""
    entries: list[Path] = field(default_factory=list)
    folders: set[Path] = field(default_factory=set)
    """Everything in the folder, and what of it is a folder."""
    is_new: bool = True
    """Whether it has not been drawn yet."""
    is_path_active: bool = False
    """Whether the field of the path has the focus."""

    def __post_init__(self) -> None:
        self.suffixes = self.suffixes or tuple(opened_suffixes())
        self.suffix, self.suggested = Path(self.name).suffix, self.name
        self.enter(self.folder)

    def enter(self, folder: Path) -> None:
        """Open a folder; if it cannot be read, the dialog stays in the current one."""
        try:
            paths = list(folder.iterdir())
            folders = {path for path in paths if path.is_dir()}
        except OSError as problem:
            self.problem = f"{printable(folder)}: {reason_of(problem)}"
            return
        self.entries = sorted(paths, key=lambda path: (path not in folders, path.name.lower()))
        self.folder, self.folders, self.problem = folder, folders, ""
        self.current = None
        self.chosen.clear()

    def typed(self, text: str) -> Path | None:
        """Return the file at a typed or pasted path, or open the folder at that path."""
        text = plain_path(text)
        try:
            path = Path(text).expanduser()
            if path.is_file():
                return path
        except (OSError, RuntimeError) as problem:  # the name is too long, or there is no such user
            self.problem = f"{printable(text)}: {reason_of(problem)}"
            return None
        self.enter(path)
        return None

    def follow_name(self) -> bool:
        """Open the folder whose name was entered in place of a file's; return whether it is one."""
        name = plain_path(self.name)
        folder = self.folder / name
        try:
            # A capture is written to a folder, which may exist.
            is_folder = bool(name and self.suffix) and folder.is_dir()
        except OSError:  # the name is too long
            return False
        if is_folder:
            self.enter(folder.resolve())
            self.name = self.suggested
        return is_folder

    def target(self) -> Path | None:
        """Return the file to write, with a suffix; None if it has no name."""
        name = Path(self.typed_name())
        if not name.name.strip("."):
            return None
        path = self.folder / name
        return path if path.suffix else path.with_name(path.name + self.suffix)

    def typed_name(self) -> str:
        """Return the name without the suggested suffix after a typed one: ``ada.gif.mp4``."""
        name = single_suffix(self.name.strip())
        suffix = PurePath(name).suffix
        stem = name.removesuffix(suffix)  # with the folder
        # Names that were not typed are kept: the suggested one, and those of existing files.
        if name == self.suggested or self.folder / name in self.entries:
            return name
        is_typed = PurePath(stem).suffix.lower() in self.suffixes
        return stem if is_typed and suffix == self.suffix else name

    def move(self, step: int) -> None:
        """Move the highlight in the list, and choose the file that it reaches."""
        listed = self.listed()
        if not listed:
            return
        row = listed.index(self.current) + step if self.current in listed else min(step, 0)
        self.current = listed[min(max(row, 0), len(listed) - 1)]
        self.chosen.clear()
        if self.purpose == "save" and self.current not in self.folders:
            self.name = self.current.name
        elif self.purpose == "open" and self.current not in self.folders:
            self.chosen = {self.current}

    def listed(self) -> list[Path]:
        """Return the folders and the files to list: those that can be opened, or all."""
        return [
            path
            for path in self.entries
            if not path.name.startswith(".")
            and (path in self.folders or self.shows_all or path.suffix.lower() in self.suffixes)
        ]


def single_suffix(name: str) -> str:
    """Return a file name without a repeated suffix, as results from typing before the suffix.

    >>> single_suffix("ada.mp4.mp4"), single_suffix("ada.v2.mp4"), single_suffix(".obj")
    ('ada.mp4', 'ada.v2.mp4', '.obj')
    """
    suffix = PurePath(name).suffix
    while suffix and PurePath(name[: -len(suffix)]).suffix.lower() == suffix.lower():
        name = name[: -len(suffix)]
    return name


def plain_path(text: str) -> str:
    """Return a pasted path without the quotes or the scheme that other programs add.

    >>> plain_path('"/tmp/a b.skel" '), plain_path("file:///tmp/a%20b.skel")
    ('/tmp/a b.skel', '/tmp/a b.skel')
    """
    text = text.strip()
    if len(text) > 1 and text[0] == text[-1] and text[0] in "'\"":
        text = text[1:-1]
    return unquote(urlsplit(text).path) if text.startswith("file://") else text


def opened_suffixes() -> set[str]:
    """Return the suffixes of files that can be opened, including textures."""
    suffixes = {*all_suffixes()}
    # Most .txt files are not poses; the check box "All files" lists them.
    return suffixes - {".txt"} | set(PICTURES)


def folder_of(paths: Sequence[Path]) -> Path:
    """Return a dialog's initial folder: the first file's folder, the current folder, or home."""
    try:
        return paths[0].resolve().parent if paths else Path.cwd()
    except (OSError, RuntimeError):  # the current folder no longer exists
        return Path.home()
