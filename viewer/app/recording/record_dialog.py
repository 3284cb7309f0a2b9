"""The Record window: settings for images, a contact sheet or a video of the view."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.core.widgets import button, checkbox, choice, note_item
from viewer.app.files.file_choice import FileDialog, folder_of
from viewer.app.files.state import Files
from viewer.app.recording.state import KINDS, LEAST_PIXELS, Recording, RecordSettings
from viewer.formats import file_stem
from viewer.rig.number_text import number_text

__all__ = ["draw_record_dialog", "open_record_dialog"]

_SIZES = {
    "view": "view size",
    "1280x720": "1280 x 720",
    "1920x1080": "1920 x 1080",
    "1080x1080": "1080 x 1080",
    "3840x2160": "3840 x 2160",
    "own": "custom size",
}
_TITLE = "Record"
_MOST_PIXELS = 16384


def open_record_dialog(state: AppState) -> None:
    """Open the window."""
    state.of(Recording).settings = RecordSettings()


def draw_record_dialog(state: AppState) -> None:
    """Draw the window if it is open."""
    recording = state.of(Recording)
    settings = recording.settings
    if settings is None:
        return
    center = imgui.get_main_viewport().get_center()
    imgui.set_next_window_pos(center, imgui.Cond_.appearing, (0.5, 0.5))
    flags = imgui.WindowFlags_.always_auto_resize | imgui.WindowFlags_.no_docking
    flags |= imgui.WindowFlags_.no_saved_settings | imgui.WindowFlags_.no_collapse
    shown, stays = imgui.begin(_TITLE, True, flags)
    if shown:
        imgui.push_item_width(14 * imgui.get_font_size())
        _draw_settings(state, settings)
        imgui.pop_item_width()
        if button(state, "Save as…"):
            _ask_where(state, settings)
        imgui.same_line()
        if button(state, "Close##record"):
            stays = False
    imgui.end()
    if not stays:
        recording.settings = None


def _draw_settings(state: AppState, settings: RecordSettings) -> None:
    settings.kind = choice(state, "Kind", settings.kind, KINDS)
    settings.size = choice(state, "Size", settings.size, _SIZES)
    if settings.size == "own":
        changed, size = imgui.input_int2("Pixels", list(settings.own_size))
        note_item(state, "Pixels")
        if changed:
            width, height = (min(max(side, LEAST_PIXELS), _MOST_PIXELS) for side in size)
            settings.own_size = width, height
    if settings.kind == "sheet":
        changed, count = imgui.slider_int("Frames##sheet", settings.n_cells, 2, 60)
        note_item(state, "Frames##sheet")
        settings.n_cells = min(max(count, 1), 400) if changed else settings.n_cells
    else:
        shown = settings.rate or state.clock.frame_rate
        changed, rate = imgui.input_float("Frames per second", shown, 0.0, 0.0, "%.3f")
        note_item(state, "Frames per second")
        if changed and 0.01 <= rate <= 1000.0:
            settings.rate = rate
    if settings.kind in (".mp4", ".webm"):
        changed, quality = imgui.slider_int("Quality", settings.quality, 0, 100)
        note_item(state, "Quality")
        settings.quality = min(max(quality, 0), 100) if changed else settings.quality
    settings.turntable = checkbox(state, "Turntable", settings.turntable)
    if settings.turntable and not state.clock.has_motion:
        changed, seconds = imgui.input_float("Seconds", settings.seconds, 0.0, 0.0, "%.2f s")
        note_item(state, "Seconds")
        if changed and 0.05 <= seconds <= 3600.0:
            settings.seconds = seconds
    if settings.kind != ".mp4":
        settings.transparent = checkbox(state, "Transparent background", settings.transparent)
    if state.selected_joint >= 0 or len(state.scene.actors) > 1:
        state.options.outline = checkbox(state, "Selection outline", state.options.outline)
    if state.options.shading == "scalar":
        state.options.legend = checkbox(state, "Legend in pictures", state.options.legend)
    imgui.text_disabled(_span_text(state, settings))


def _span_text(state: AppState, settings: RecordSettings) -> str:
    clock = state.clock
    if not clock.has_motion:
        return "one revolution" if settings.turntable else "no motion: one frame"
    low, high = clock.start, clock.end
    return f"the playback range: {number_text(low, '.3f')} to {number_text(high, '.3f')} s"


def _ask_where(state: AppState, settings: RecordSettings) -> None:
    stem = file_stem(state.scene.title)
    names = {"pictures": f"{stem}_{{frame:05}}.png", "sheet": f"{stem}_sheet.png"}
    name = names.get(settings.kind, f"{stem}{settings.kind}")
    state.of(Files).dialog = FileDialog(
        folder_of(state.paths), _start, "save", f"Record: {KINDS[settings.kind]}",
        (Path(name).suffix,), name,
    )  # fmt: skip


def _start(state: AppState, paths: list[Path]) -> None:
    state.of(Recording).wanted = paths[0]
