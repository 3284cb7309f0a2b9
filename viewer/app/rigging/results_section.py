"""Section of the Rig panel with the results of rigging."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import imgui

from viewer.app.core.ink import WARNING, ink
from viewer.app.core.key_names import key_name, with_key
from viewer.app.core.reasons import no_job_room
from viewer.app.core.state import AppState
from viewer.app.core.widgets import button, checkbox, explain, note_item, same_line_if_room
from viewer.app.files.file_choice import FileDialog, folder_of
from viewer.app.files.state import Files
from viewer.app.rigging.results import (
    RESULT_COLORS,
    TARGET,
    no_motion_of,
    no_trial_of,
    plays_motion,
    plays_trial,
    save_rigged,
    set_motion,
    set_trial,
    show_colors,
    show_version,
    shown_result,
    shown_version,
    versions,
)
from viewer.app.rigging.sources import no_results
from viewer.app.rigging.state import Result, Rigging
from viewer.export._rigged_files import RIGGED_SUFFIXES, files_of
from viewer.formats import file_stem
from viewer.phrases import printable

__all__ = ["ask_where_to_save_rig", "draw_results"]

_LINES_HEIGHT = 9.0  # number of visible lines of the report


def draw_results(state: AppState) -> None:
    """Draw the choice of version and colours, the statistics of each method, and the report."""
    why, result = no_results(state), shown_result(state)
    if why or result is None:
        imgui.text_wrapped(f"The rig was undone; {key_name(state, 'Ctrl+Shift+Z')} restores it.")
        return
    _draw_versions(state)
    _draw_colors(state)
    moves = plays_motion(result)
    still = no_motion_of(result)
    plays = checkbox(state, "Move like the template", moves, still)
    if not still:
        explain("play the template's motion at the target's position")
    if plays != moves:
        set_motion(state, result, plays)
    tries, still = plays_trial(result), no_trial_of(result)
    chosen = checkbox(state, "Trial motion", tries, still)
    if not still:
        explain("bend each joint in both directions, to see how the weights deform the mesh")
    if chosen != tries:
        set_trial(state, result, chosen)
    _draw_table(state)
    if button(state, "Save rigged…", no_job_room(state)):
        ask_where_to_save_rig(state, result)
    same_line_if_room("Copy report")
    if button(state, "Copy report"):
        imgui.set_clipboard_text("\n".join(line.labelled for line in result.rigged.lines))
        state.say_status("Report copied")
    _draw_lines(state, result)


def _draw_versions(state: AppState) -> None:
    """Draw the target and its results as radio buttons; the key A cycles through them."""
    shown = shown_version(state)
    for number, name in enumerate(versions(state)):
        text = "original" if name == TARGET else name
        if number:
            same_line_if_room(text)
        if imgui.radio_button(f"{text}###version {name}", name == shown) and name != shown:
            show_version(state, name)
        note_item(state, f"version {name}")
        explain(with_key(state, "cycle through the versions", "A"))


def _draw_colors(state: AppState) -> None:
    options = state.options
    now = options.scalar if options.shading == "scalar" else ""
    for number, (view, text) in enumerate({"": "plain", **RESULT_COLORS}.items()):
        if number:
            same_line_if_room(text)
        is_on = now == view if view else now not in RESULT_COLORS
        if imgui.radio_button(f"{text}###color {view}", is_on):
            show_colors(state, view)
        note_item(state, f"color {view}")


def _draw_table(state: AppState) -> None:
    """Draw the statistics of the methods side by side."""
    view, known = state.of(Rigging), versions(state)
    found = [one for name, one in view.results.items() if name in known]
    if not imgui.begin_table("methods", 1 + len(found), imgui.TableFlags_.sizing_stretch_same):
        return
    rigged = [one.rigged for one in found]
    _row("", "", [one.method for one in found])
    _row(
        "matched",
        "vertices whose weights come from the closest points of the template",
        [f"{100.0 * one.weights.matched.mean():.1f} %" for one in rigged],
    )
    _row(
        "largest error",
        "largest distance of the posed result from the target, relative to its size",
        [f"{one.residual:.1e}" for one in rigged],
    )
    _row(
        "estimated",
        "vertices with a pose too extreme to invert exactly: their rest position is an estimate",
        [f"{int(one.guarded.sum()):,}" for one in rigged],
    )
    _row(
        "joints outside",
        "joints outside the mesh that are inside the template",
        [f"{len(one.outside):,}" for one in rigged],
    )
    imgui.end_table()
    if view.comparison is not None and len(found) > 1:
        text = (
            f"weights differ by {view.comparison.weights:.3f} (mean L1), same dominant joint at "
            f"{100.0 * view.comparison.dominant:.1f} % of the vertices"
        )
        imgui.text_wrapped(text)


def _row(title: str, meaning: str, cells: list[str]) -> None:
    imgui.table_next_row()
    for text in (title, *cells):
        imgui.table_next_column()
        imgui.text_unformatted(text)
        explain(meaning)


def _draw_lines(state: AppState, result: Result) -> None:
    """Draw the report, with warnings highlighted."""
    height = _LINES_HEIGHT * imgui.get_text_line_height_with_spacing()
    if imgui.begin_child("report", (0.0, height), imgui.ChildFlags_.borders):
        for line in result.rigged.lines:
            warns = line.severity == "warning"
            if warns:
                imgui.push_style_color(imgui.Col_.text, ink(WARNING))
            imgui.text_wrapped(printable(line.labelled, 400))
            if warns:
                imgui.pop_style_color()
    imgui.end_child()
    note_item(state, "report")


def ask_where_to_save_rig(state: AppState, result: Result) -> None:
    """Ask where to save a rigged mesh."""
    name = f"{file_stem(result.target.name)}_rigged.npz"
    state.of(Files).dialog = FileDialog(
        folder_of(state.paths),
        lambda state, paths: save_rigged(state, result, paths[0]),
        "save",
        "Save rigged mesh: .npz, .glb, or .skel with .skin, .obj and .json",
        RIGGED_SUFFIXES,
        name,
        written=_written,
    )


def _written(path: Path) -> list[Path]:
    """Return all files written for a name; other suffixes are rejected on saving."""
    return files_of(path) if path.suffix.lower() in RIGGED_SUFFIXES else [path]
