"""Choice of the format of an exported pose, and the data that each format keeps."""

from __future__ import annotations

from pathlib import Path

from viewer.app.core.state import AppState
from viewer.app.core.widgets import choice
from viewer.app.files.file_choice import FileDialog
from viewer.export import EXPORTERS

__all__ = ["draw_formats"]


def draw_formats(state: AppState, dialog: FileDialog) -> None:
    """Draw the list of formats; a choice changes the suffix of the name."""
    kinds = {
        suffix: f"{suffix}  {kind.title}"
        for kind in EXPORTERS.values()
        if kind.writes_pose
        for suffix in kind.suffixes
    }
    name = dialog.name.strip()
    typed = Path(name).suffix.lower()
    now = typed if typed in kinds else dialog.suffix
    chosen = choice(state, "Format##export", now, kinds)
    if chosen != now:
        stem = name[: -len(typed)] if typed in kinds else name
        dialog.suffix, dialog.name = chosen, stem + chosen
