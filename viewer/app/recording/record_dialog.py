"""The Record window: settings for images, a contact sheet or a video of the view."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import imgui

from viewer.app.actors.following import Following
from viewer.app.core.fields import begin_field, in_row
from viewer.app.core.reasons import no_job_room
from viewer.app.core.state import AppState
from viewer.app.core.text_fields import number_field, whole_field
from viewer.app.core.widgets import (
    begin_window,
    button,
    checkbox,
    choice,
    count_slider,
    explain,
    note_item,
)
from viewer.app.files.file_choice import FileDialog, folder_of
from viewer.app.files.state import Files
from viewer.app.recording.preview import preview_size
from viewer.app.recording.state import (
    KINDS,
    LEAST_PIXELS,
    VIDEO_KINDS,
    RecordingState,
    RecordSettings,
    playback_frames,
    recorded_times,
)
from viewer.formats import file_stem
from viewer.phrases import counted
from viewer.rendering.options import QUALITIES
from viewer.rig.number_text import number_text

__all__ = ["ask_where", "draw_record_dialog", "open_record_dialog"]

_SIZES = {
    "view": "size of the view",
    "1280x720": "720p: 1280 x 720",
    "1920x1080": "1080p: 1920 x 1080",
    "2560x1440": "1440p: 2560 x 1440",
    "3840x2160": "4K: 3840 x 2160",
    "1080x1080": "square: 1080 x 1080",
    "1080x1920": "upright: 1080 x 1920",
    "own": "custom",
}
_SAMPLES = {"0": "as the view", "1": "1", "4": "4", "8": "8", "16": "16"}
_BACKGROUNDS = {
    "": "as the view",
    "gradient": "gradient",
    "white": "white",
    "environment": "studio",
    "transparent": "transparent",
}
_TITLE = "Record"
_WINDOW = (30.0, 42.5)  # initial size of the window, in font sizes
_MOST_PIXELS = 16384
_MOST_CELLS = 400


def open_record_dialog(state: AppState) -> None:
    """Open the window."""
    state.of(RecordingState).settings = RecordSettings()


def draw_record_dialog(state: AppState) -> None:
    """Draw the window if it is open."""
    recording = state.of(RecordingState)
    settings = recording.settings
    if settings is None:
        return
    shown, stays = begin_window(_TITLE, _WINDOW)
    if shown:
        # The buttons stay visible even if the settings need a scroll bar.
        if imgui.begin_child("##settings", (0.0, -1.2 * imgui.get_frame_height_with_spacing())):
            _draw_preview(state, settings)
            _draw_file(state, settings)
            imgui.separator_text("Picture")
            _draw_picture(state, settings)
            imgui.separator_text("Frames")
            _draw_frames(state, settings)
        imgui.end_child()
        if button(state, "Save as…", no_job_room(state)):
            ask_where(state, settings)
        imgui.same_line()
        if button(state, "Close##record"):
            stays = False
    imgui.end()
    if not stays:
        recording.settings = None


def _draw_preview(state: AppState, settings: RecordSettings) -> None:
    """Draw the current view as a frame of the recording, centred."""
    texture = state.of(RecordingState).preview
    width, height = preview_size(settings.pixels((state.view_rect[2], state.view_rect[3])))
    scale = imgui.get_font_size() / 15.0
    size = (scale * width, scale * height)
    room = imgui.get_content_region_avail().x
    imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(0.5 * (room - size[0]), 0.0))
    if not texture:
        imgui.dummy(size)
        return
    # Textures have their first row at the bottom.
    imgui.image(imgui.ImTextureRef(texture), size, (0.0, 1.0), (1.0, 0.0))
    note_item(state, "preview")


def _draw_file(state: AppState, settings: RecordSettings) -> None:
    """Draw the choice of the format, and the settings of that format."""
    settings.kind = choice(state, "Kind", settings.kind, KINDS)
    if settings.kind in (".mp4", ".webm"):
        settings.quality = count_slider(
            state, "Compression quality###Quality", settings.quality, (0, 100)
        )
        settings.quality = min(max(settings.quality, 0), 100)
        explain("higher quality results in larger files")


def _draw_picture(state: AppState, settings: RecordSettings) -> None:
    settings.size = choice(state, "Size", settings.size, _SIZES)
    if settings.size == "own":
        size = _pair_field(state, "Pixels", settings.own_size)
        if size is not None:
            width, height = (min(max(side, LEAST_PIXELS), _MOST_PIXELS) for side in size)
            settings.own_size = width, height
    looks = {"": "as the view, but at most Normal for motions", **QUALITIES}
    settings.look = choice(state, "Quality##look", settings.look, looks)
    chosen = choice(state, "Samples##recorded", str(settings.samples), _SAMPLES)
    settings.samples = int(chosen)
    backgrounds = dict(_BACKGROUNDS)
    if settings.kind == ".mp4":
        del backgrounds["transparent"]
        if settings.background == "transparent":
            settings.background = ""
    settings.background = choice(state, "Background##recorded", settings.background, backgrounds)
    if settings.kind == ".mp4":
        explain("MP4 has no transparency: choose WebM or pictures")
    why = "" if state.options.shading == "scalar" else "no numbers are shown as colours"
    state.options.legend = checkbox(state, "Legend in pictures", state.options.legend, why)


def _draw_frames(state: AppState, settings: RecordSettings) -> None:
    clock = state.clock
    if settings.kind == "sheet":
        settings.n_cells = count_slider(state, "Frames##sheet", settings.n_cells, (2, 60))
        settings.n_cells = min(max(settings.n_cells, 1), _MOST_CELLS)
    else:
        shown = settings.rate or clock.frame_rate
        field = begin_field("Frames per second")
        rate = number_field(state, field, shown)
        note_item(state, "Frames per second")
        if rate is not None:
            settings.rate = _within(state, rate, 0.01, 1000.0)
    if clock.has_motion:
        _draw_range(state, settings)
    settings.turntable = checkbox(state, "Turntable", settings.turntable)
    explain("orbit once around the scene")
    if settings.turntable and not clock.has_motion:
        field = begin_field("Seconds")
        seconds = number_field(state, field, settings.seconds, "%.2f s")
        note_item(state, "Seconds")
        if seconds is not None:
            settings.seconds = _within(state, seconds, 0.05, 3600.0)
    why = "" if state.of(Following).target is not None else "start following in the Actors panel"
    follows = settings.follows and not why
    chosen = checkbox(state, "Follow the followed actor###follow", follows, why)
    if not why:
        settings.follows = chosen
    imgui.text_disabled(_span_text(state, settings))


def _draw_range(state: AppState, settings: RecordSettings) -> None:
    """Draw the first and last frame, by default the ends of the playback range."""
    clock = state.clock
    lowest, highest = (clock.first_frame + frame for frame in clock.frame_range)
    shown = settings.frames or playback_frames(state)
    found = _pair_field(state, "First and last frame", shown)
    explain("the playback range, unless other frames are entered")
    if found is not None:
        first, last = sorted(min(max(frame, lowest), highest) for frame in found)
        settings.frames = first, last


def _pair_field(state: AppState, label: str, values: tuple[int, int]) -> tuple[int, int] | None:
    """Draw two fields for whole numbers; return both when either has been entered."""
    found = list(values)
    entered = []

    def draw(hidden: str, column: int) -> None:
        number = whole_field(state, hidden, values[column])
        if number is not None:
            found[column] = number
            entered.append(column)

    in_row(begin_field(label), range(2), draw)
    note_item(state, label)
    return (found[0], found[1]) if entered else None


def _within(state: AppState, value: float, low: float, high: float) -> float:
    """Return a value limited to a range; show a message if it was outside."""
    limited = min(max(value, low), high)
    if limited != value:
        state.say_status(f"limited to {number_text(limited)}")
    return limited


def _span_text(state: AppState, settings: RecordSettings) -> str:
    """Return the number of frames that are recorded, and their times."""
    times, _, rate = recorded_times(state, settings)
    frames = counted(len(times), "frame")
    if state.clock.has_motion:
        low, high = (number_text(float(time), ".3f") for time in times[[0, -1]])
        return f"{frames}, {low} to {high} s"
    if settings.turntable:
        seconds = "" if settings.kind == "sheet" else f", {number_text(len(times) / rate)} s"
        return f"one revolution: {frames}{seconds}"
    return f"no motion: {frames}"


def ask_where(state: AppState, settings: RecordSettings) -> None:
    """Open the dialog for the name of a recording; the suggested name is the scene's title."""
    stem = file_stem(state.scene.title)
    names = {"pictures": f"{stem}_{{frame:05}}.png", "sheet": f"{stem}_sheet.png"}
    name = names.get(settings.kind, f"{stem}{settings.kind}")
    suffixes = (".png",) if settings.kind in names else VIDEO_KINDS
    state.of(Files).dialog = FileDialog(
        folder_of(state.paths), _start, "save", f"Record: {KINDS[settings.kind]}",
        suffixes, name,
    )  # fmt: skip


def _start(state: AppState, paths: list[Path]) -> None:
    recording, suffix = state.of(RecordingState), paths[0].suffix.lower()
    if recording.settings is not None and {suffix, recording.settings.kind} <= {*VIDEO_KINDS}:
        recording.settings.kind = suffix  # the user typed a different suffix
    recording.wanted = paths[0]
