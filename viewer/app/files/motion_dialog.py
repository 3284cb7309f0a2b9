"""Dialog to export motions: choice of actors, format and file."""

from __future__ import annotations

from pathlib import Path

from viewer.app.core.state import AppState
from viewer.app.core.widgets import checkbox, choice, explain
from viewer.app.files.export_formats import N_ROWS, draw_formats
from viewer.app.files.file_choice import FileDialog, folder_of
from viewer.app.files.motion_export import (
    is_one_file,
    motion_files,
    motion_formats,
    motion_suffixes,
    moving_actors,
    save_motion,
    unsuited_formats,
)
from viewer.app.files.state import Files
from viewer.data_classes import dataclass
from viewer.export._options import SAFE_NAMES
from viewer.formats import file_stem
from viewer.phrases import printable
from viewer.rig.scene import Actor

__all__ = ["ask_for_motion"]


@dataclass(slots=True)
class _Selection:
    """Whether to export all actors' motions or only the selected actor's, and how."""

    everyone: bool
    safe_names: bool = False


def ask_for_motion(state: AppState, suffix: str = "") -> None:
    """Open the dialog; all actors are preselected if there are several.

    Parameters
    ----------
    state : AppState
        Receives the dialog.
    suffix : str
        Suffix of the suggested name of a file with edited keys; that of the first format if empty.
    """
    moving = moving_actors(state)
    asks = len(moving) > 1 or state.actor not in moving
    selection = _Selection(asks)
    first = _first(state, selection)
    # The number of each person is appended to the name if there are several files.
    stem = file_stem(first.title if len(moving) > 1 else first.name)
    suffixes = motion_suffixes()
    state.of(Files).dialog = FileDialog(
        folder_of(state.paths),
        lambda state, paths: save_motion(state, paths[0], selection.everyone, selection.safe_names),
        "save",
        "Export motion",
        suffixes,
        f"{stem}_edited{suffix}" if suffix else f"{stem}{suffixes[0]}",
        more=lambda state, dialog: _draw_more(state, dialog, selection),
        more_rows=N_ROWS + (3.0 if asks else 1.5),
        written=lambda path: motion_files(state, path, selection.everyone),
    )


def _first(state: AppState, selection: _Selection) -> Actor:
    """Return the first actor whose motion is exported."""
    return moving_actors(state)[0] if selection.everyone else state.actor


def _draw_more(state: AppState, dialog: FileDialog, selection: _Selection) -> None:
    """Draw the choice of actors and format."""
    moving = moving_actors(state)
    if len(moving) > 1 or state.actor not in moving:
        whose = {"all": f"all {len(moving)} actors"}
        if state.actor in moving:
            whose["one"] = f"only {printable(state.actor.name, 60)}"
        selection.everyone = (
            choice(state, "Actors##exported", "all" if selection.everyone else "one", whose, 12.0)
            == "all"
        )
        is_one = dialog.suffix == "" or is_one_file(Path(f"motion{dialog.suffix}"))
        explain("one file for all" if is_one else "one file per actor, numbered by actor")
    actor = _first(state, selection)
    draw_formats(state, dialog, motion_formats(actor), unsuited_formats(actor))
    suffix = Path(dialog.typed_name()).suffix.lower() or dialog.suffix
    why = "" if suffix == ".bvh" else "for .bvh only"
    selection.safe_names = checkbox(state, "Safe names", selection.safe_names, why)
    explain(SAFE_NAMES, why)
