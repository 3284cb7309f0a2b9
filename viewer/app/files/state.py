"""State of opening files: dialog, loader, stream, and recent files."""

from __future__ import annotations

from dataclasses import field
from pathlib import Path

from viewer.app.files.file_choice import FileDialog
from viewer.app.files.loader import Loader
from viewer.app.files.stream import Stream
from viewer.data_classes import dataclass

__all__ = ["Files"]


@dataclass(slots=True)
class Files:
    """State of opening files.

    Attributes
    ----------
    dialog : FileDialog or None
        File dialog that is open.
    wants_open : list of Path
        Files to open after the frame.
    loader : Loader or None
        Loader of files that are being opened.
    stream : Stream or None
        Reader of captures that are not yet complete.
    recent : list of tuple of str
        Groups of files that were opened together, latest first.
    rig : str
        Rig of the body model that is opened next; empty for its default.
    models : dict
        Body models that were found, by name; searched for when the menu opens.
    model_folder : Path or None
        Folder of body models; read when the window "Preferences" opens.
    """

    dialog: FileDialog | None = None
    wants_open: list[Path] = field(default_factory=list)
    loader: Loader | None = None
    stream: Stream | None = None
    recent: list[tuple[str, ...]] = field(default_factory=list)
    rig: str = ""
    models: dict[str, Path] = field(default_factory=dict)
    model_folder: Path | None = None
