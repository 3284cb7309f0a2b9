"""Dialog to export motions: choice of actors, format and file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.core.widgets import choice, explain
from viewer.app.files.file_choice import FileDialog, folder_of
from viewer.app.files.motion_export import (
    FOLDER,
    motion_files,
    motion_suffixes,
    moving_actors,
    save_motion,
)
from viewer.app.files.state import Files
from viewer.export import EXPORTERS
from viewer.formats import file_stem
from viewer.phrases import printable

__all__ = ["ask_for_motion"]


@dataclass(slots=True)
class _Selection:
    """Whether to export all actors' motions or only the selected actor's."""

    everyone: bool


def ask_for_motion(state: AppState) -> None:
    """Open the dialog; all actors are preselected if there are several."""
    moving = moving_actors(state)
    selection = _Selection(len(moving) > 1 or state.actor not in moving)
    first = moving[0] if selection.everyone else state.actor
    # The number of each person is appended to the name if there are several files.
    stem = file_stem(first.title if len(moving) > 1 else first.name)
    suffixes = motion_suffixes()
    state.of(Files).dialog = FileDialog(
        folder_of(state.paths),
        lambda state, paths: save_motion(state, paths[0], selection.everyone),
        "save",
        "Export motion",
        suffixes,
        f"{stem}{suffixes[0]}",
        more=lambda state, dialog: _draw_more(state, dialog, selection),
        written=lambda path: motion_files(state, path, selection.everyone),
    )


def _draw_more(state: AppState, dialog: FileDialog, selection: _Selection) -> None:
    """Draw the choice of actors and format."""
    moving = moving_actors(state)
    imgui.set_next_item_width(16.0 * imgui.get_font_size())
    if len(moving) > 1 or state.actor not in moving:
        whose = {"all": f"all {len(moving)} actors"}
        if state.actor in moving:
            whose["one"] = f"only {printable(state.actor.name, 60)}"
        selection.everyone = (
            choice(state, "Actors##exported", "all" if selection.everyone else "one", whose)
            == "all"
        )
        explain("" if dialog.suffix == "" else "one file per actor, numbered by actor")
        imgui.same_line()
        imgui.set_next_item_width(16.0 * imgui.get_font_size())
    kinds = {suffix: _title(suffix) for suffix in motion_suffixes()}
    kinds[FOLDER] = _title(FOLDER)
    typed = Path(dialog.name.strip()).suffix.lower()
    now = typed if typed in kinds else dialog.suffix or FOLDER
    kind = choice(state, "Format", now, kinds)
    if kind != now:
        stem = dialog.name.strip()[: -len(typed)] if typed in kinds else dialog.name.strip()
        dialog.suffix = "" if kind == FOLDER else kind
        dialog.name = stem + dialog.suffix


def _title(suffix: str) -> str:
    """Return a suffix's description, from its exporters."""
    titles = [
        kind.title for kind in EXPORTERS.values() if kind.writes_motion and suffix in kind.suffixes
    ]
    start = "folder  " if suffix == FOLDER else f"{suffix}  "
    return start + " or ".join(title.partition(":")[0] for title in titles)
