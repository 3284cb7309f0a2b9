"""List of the formats of an export, with the data that each of them keeps and omits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.core.widgets import disabled, explain, note_item
from viewer.app.files.file_choice import FileDialog
from viewer.export import EXPORTERS, Exporter

__all__ = ["FOLDER", "N_ROWS", "draw_formats", "draw_pose_formats", "pose_formats"]

FOLDER = "/"
"""Placeholder, among suffixes, for a folder that contains all people of a capture."""

N_ROWS = 6.5
"""Height of the list in lines: half a line shows that the list continues."""

_COLUMNS = (("Format", 0.3), ("Keeps", 0.4), ("Omits", 0.3))


def pose_formats() -> dict[str, Exporter]:
    """Return the exporters of poses by suffix; none of them keeps a motion then."""
    kinds = [_of_pose(kind) for kind in EXPORTERS.values() if kind.writes_pose]
    return {suffix: kind for kind in kinds for suffix in kind.suffixes}


def _of_pose(kind: Exporter) -> Exporter:
    """Return an exporter with the data that it keeps and omits when it writes a single pose."""
    kept = kind.keeps.split(", ")
    if "motion" not in kept:
        return kind
    kept.remove("motion")
    title = kind.title.partition(":")[0]
    return replace(kind, title=title, keeps=", ".join(kept), omits=f"motion, {kind.omits}")


def draw_pose_formats(state: AppState, dialog: FileDialog) -> None:
    """Draw the list of formats of poses."""
    record = state.actor.figure.record
    is_vrm = record is not None and record.vrm is not None
    why = "other figures need an author and a licence, which viewer convert takes"
    draw_formats(state, dialog, pose_formats(), {} if is_vrm else {".vrm": why})


def draw_formats(
    state: AppState,
    dialog: FileDialog,
    formats: Mapping[str, Exporter],
    missing: Mapping[str, str],
) -> None:
    """Draw a list of formats; a choice changes the suffix of the name.

    Parameters
    ----------
    state : AppState
        Records where the rows are drawn.
    dialog : FileDialog
        Dialog whose name is changed.
    formats : mapping
        Exporters by suffix; ``FOLDER`` for a folder.
    missing : mapping
        Reasons why formats cannot be written, by suffix.
    """
    typed = Path(dialog.typed_name()).suffix.lower()
    now = typed if typed in formats else dialog.suffix or FOLDER
    flags = imgui.TableFlags_.row_bg | imgui.TableFlags_.scroll_y | imgui.TableFlags_.borders_outer
    height = N_ROWS * imgui.get_text_line_height_with_spacing()
    if not imgui.begin_table("##formats", len(_COLUMNS), flags, (0.0, height)):
        return
    imgui.table_setup_scroll_freeze(0, 1)
    for title, part in _COLUMNS:
        imgui.table_setup_column(title, imgui.TableColumnFlags_.width_stretch, part)
    imgui.table_headers_row()
    for suffix, kind in formats.items():
        why = missing.get(suffix, "")
        if _draw_row(state, suffix, kind, suffix == now, why) and not why:
            _choose(dialog, suffix, typed if typed in formats else "")
    imgui.end_table()
    note_item(state, "formats")


def _draw_row(state: AppState, suffix: str, kind: Exporter, is_chosen: bool, why: str) -> bool:
    """Draw the row of a format; return whether it was chosen."""
    imgui.table_next_row()
    imgui.table_next_column()
    flags = imgui.SelectableFlags_.span_all_columns | imgui.SelectableFlags_.no_auto_close_popups
    shown = "folder" if suffix == FOLDER else suffix
    name = kind.title.partition(":")[0]
    with disabled(state, why):
        pressed = imgui.selectable(f"{shown}  {name}###format {suffix}", is_chosen, flags)[0]
        note_item(state, f"format {suffix}")
        explain(f"{kind.title}\nkeeps: {kind.keeps}\nomits: {kind.omits}", why)
        if is_chosen and imgui.is_window_appearing():
            imgui.set_scroll_here_y(0.5)
        for text in (kind.keeps, kind.omits):
            imgui.table_next_column()
            imgui.text_unformatted(text)
    return pressed


def _choose(dialog: FileDialog, suffix: str, old: str) -> None:
    """Replace the suffix of the name by a format's suffix."""
    name = dialog.typed_name()
    dialog.suffix = "" if suffix == FOLDER else suffix
    dialog.name = name[: len(name) - len(old)] + dialog.suffix
