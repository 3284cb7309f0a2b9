"""Recording of the view as images, a contact sheet or a video: its window, preview and steps.

The steps draw one frame each; between them, the window stays responsive.
"""

from __future__ import annotations

import contextlib
from collections.abc import Generator, Sequence
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from imgui_bundle import imgui

from viewer.app.actors.following import Following
from viewer.app.core.fields import begin_field, in_row
from viewer.app.core.jobs import FrameJob
from viewer.app.core.reasons import no_job_room
from viewer.app.core.state import AppState
from viewer.app.core.text_fields import number_field, whole_field
from viewer.app.core.widgets import (
    begin_window,
    button,
    checkbox,
    choice,
    count_slider,
    draw_setting,
    explain,
    note_item,
)
from viewer.app.files.files import ask_where_to_write
from viewer.app.linting.lint_panel import Linting
from viewer.app.linting.marks import marks_of
from viewer.app.weights.vertex_panel import vertex_annotation
from viewer.app.weights.weights_panel import Weights
from viewer.data_classes import dataclass, setting
from viewer.errors import ViewerError
from viewer.exporters._motion_paths import numbered_paths
from viewer.formats import check_targets, file_stem
from viewer.linting import Finding, places_of
from viewer.media.video_kinds import MOST_GIF_RATE, QUALITY, TURN_SECONDS, VIDEOS
from viewer.phrases import capitalized, counted, printable
from viewer.rendering.framing import frames_looked_at
from viewer.rendering.gpu.program import Programs
from viewer.rendering.gpu.target import Target
from viewer.rendering.options import QUALITIES, SIZE, DisplayOptions, Quality
from viewer.rendering.overlay.annotation import Annotation, mark_annotation
from viewer.rendering.passes.ghost_pass import Ghost
from viewer.rendering.recorder import Follow, Recording, Sink, record
from viewer.rendering.renderer import Renderer
from viewer.rigs.arrays import Floats
from viewer.rigs.inspection.explanation import explain as explain_vertex
from viewer.rigs.motion.timing import frame_at, frame_times
from viewer.rigs.number_text import number_text
from viewer.rigs.scene import Scene

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
_LOOKS = {"": "as the view, but at most Normal for motions"} | QUALITIES
_SAMPLES = {"0": "as the view", "1": "1", "4": "4", "8": "8", "16": "16"}
_BACKGROUNDS = {
    "": "as the view",
    "gradient": "gradient",
    "white": "white",
    "environment": "studio",
    "transparent": "transparent",
}
_WINDOW = (30.0, 42.5)  # initial size of the window, in font sizes
_MOST_PIXELS = 16384
_MOST_CELLS = 400
KINDS = {
    **{suffix: capitalized(kind.title) for suffix, kind in VIDEOS.items()},
    "pictures": "Numbered pictures (PNG)",
    "sheet": "Contact sheet (PNG)",
}
"""Kinds of recordings, with their labels."""
_LEAST_PIXELS = 16
"""Minimum width and height of a recording."""
_WIDEST, _HIGHEST = 320, 200  # maximum size of the preview, pixels


@dataclass(slots=True)
class RecordSettings:
    """Settings of a recording."""

    kind: str = setting(".mp4", choices=KINDS)
    size: str = setting("view", choices=_SIZES)
    own_size: tuple[int, int] = SIZE
    """Width and height for the size ``"own"``."""
    rate: float = 0.0
    """Frames per second; 0 for the scene's own rate."""
    turntable: bool = False
    """Whether the camera orbits once around the scene."""
    seconds: float = TURN_SECONDS
    """Duration of the orbit if there is no motion."""
    n_cells: int = 12
    """Number of frames in a contact sheet."""
    quality: int = setting(int(QUALITY), limits=(0, 100))
    """Quality of the compression of videos."""
    look: Literal[""] | Quality = setting("", choices=_LOOKS)
    """Quality of the images."""
    samples: int = 0
    """Samples per pixel; 0 for those of the view."""
    background: str = ""
    """As in ``DisplayOptions``; empty for the background of the view."""
    follows: bool = True
    """Whether the camera follows the same actor or joint as in the view."""
    frames: tuple[int, int] | None = None
    """First and last frame, numbered as in the timeline; None for the playback range."""

    @property
    def is_transparent(self) -> bool:
        """Whether the background is transparent and the file format supports transparency."""
        return self.background == "transparent" and self.kind != ".mp4"

    def pixels(self, view: tuple[float, float]) -> tuple[int, int]:
        """Return the width and height of the recording for a given size of the view."""
        if self.size == "view":
            wide, high = (max(round(side), _LEAST_PIXELS) for side in view)
            # Videos need even sizes; losing a row of the view does not matter.
            return wide - wide % 2, high - high % 2
        if self.size == "own":
            return self.own_size
        width, _, height = self.size.partition("x")
        return int(width), int(height)


@dataclass(slots=True)
class RecordingState:
    """State of the Record window."""

    settings: RecordSettings | None = None
    """Settings shown in the window; None while it is closed."""
    wanted: Path | None = None
    """Target file of a recording that starts after the frame."""
    preview: int = 0
    """ID of the preview's texture; 0 if there is none."""


class Preview:
    """Draws the preview into a texture whenever the preview changes."""

    def __init__(self, programs: Programs) -> None:
        self._programs, self.context = programs, programs.context
        self.target: Target | None = None
        self._renderer: Renderer | None = None
        self._drawn: object = None
        self._old: list[Target] = []

    def draw(self, state: AppState, key: object) -> None:
        """Draw the preview if the Record window is open and the image has changed."""
        recording = state.of(RecordingState)
        settings = recording.settings
        self._release_old()
        if settings is None:
            self._drawn, recording.preview = None, 0
            self._retire()
            self._release_renderer()
            return
        size = _preview_size(settings.pixels((state.view_rect[2], state.view_rect[3])))
        wanted = (key, size, settings.look, settings.background, settings.kind, settings.samples)
        if wanted == self._drawn:
            return
        self._drawn = wanted
        options = _recorded_options(state, settings, 2)
        target = self.target
        if target is None or (target.size, target.asked_samples) != (size, options.samples):
            self._retire()
            self.target = target = Target(self.context, size, options.samples)
        selected = (state.chosen_actor, state.selected_joint)
        # The view's renderer may still be averaging its own image.
        renderer = self._renderer = self._renderer or Renderer(self._programs)
        renderer.draw(state.scene, state.camera.copy(), options, target, state.box, selected)
        target.resolve()
        recording.preview = int(target.texture.glo)

    def _retire(self) -> None:
        """Release the target in the next frame: panels of this frame may show its texture."""
        if self.target is not None:
            self._old.append(self.target)
            self.target = None

    def _release_old(self) -> None:
        for target in self._old:
            target.release()
        self._old.clear()

    def release(self) -> None:
        """Release everything, as when the window is closed."""
        self._retire()
        self._release_old()
        self._release_renderer()

    def _release_renderer(self) -> None:
        if self._renderer is not None:
            self._renderer.release()
            self._renderer = None


def open_record_dialog(state: AppState) -> None:
    """Open the window."""
    state.of(RecordingState).settings = RecordSettings()


def draw_record_dialog(state: AppState) -> None:
    """Draw the window if it is open."""
    recording = state.of(RecordingState)
    settings = recording.settings
    if settings is None:
        return
    shown, stays = begin_window("Record", _WINDOW)
    if shown:
        # The buttons stay visible even if the settings need a scroll bar.
        if imgui.begin_child("##settings", (0.0, -1.2 * imgui.get_frame_height_with_spacing())):
            _draw_preview(state, settings)
            draw_setting(state, "Kind", settings, "kind")
            if settings.kind in (".mp4", ".webm"):
                text = "higher quality results in larger files"
                draw_setting(state, "Compression quality###Quality", settings, "quality", text)
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
    width, height = _preview_size(settings.pixels((state.view_rect[2], state.view_rect[3])))
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


def _draw_picture(state: AppState, settings: RecordSettings) -> None:
    draw_setting(state, "Size", settings, "size")
    if settings.size == "own":
        size = _pair_field(state, "Pixels", settings.own_size)
        if size is not None:
            width, height = (min(max(side, _LEAST_PIXELS), _MOST_PIXELS) for side in size)
            settings.own_size = width, height
    draw_setting(state, "Quality##look", settings, "look")
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
    draw_setting(state, "Turntable", settings, "turntable", "orbit once around the scene")
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
    suffixes = (".png",) if settings.kind in names else tuple(VIDEOS)
    ask_where_to_write(state, _start, f"Record: {KINDS[settings.kind]}", suffixes, name)


def _start(state: AppState, path: Path) -> None:
    recording, suffix = state.of(RecordingState), path.suffix.lower()
    if recording.settings is not None and {suffix, recording.settings.kind} <= {*VIDEOS}:
        recording.settings.kind = suffix  # the user typed a different suffix
    recording.wanted = path


def _recorded_options(state: AppState, settings: RecordSettings, n_frames: int) -> DisplayOptions:
    """Return a copy of the view's options for some frames; more than one is not drawn finally."""
    options = deepcopy(state.options)
    if settings.look:
        options.quality = settings.look
    elif options.quality == "final" and n_frames > 1:
        options.quality = "normal"
    options.samples = settings.samples or options.samples
    if settings.background:
        options.background = settings.background
    if options.background == "transparent" and settings.kind == ".mp4":
        options.background = "gradient"
    return options


def _recorded_follow(state: AppState, settings: RecordSettings) -> Follow | None:
    """Return the actor or joint that a recording's camera follows; None if it does not move."""
    following = state.of(Following)
    if not settings.follows or following.target is None or following.place is None:
        return None
    return Follow(*following.target, following.place)


def playback_frames(state: AppState) -> tuple[int, int]:
    """Return the first and the last frame that are recorded, numbered as in the timeline."""
    clock = state.clock
    first = clock.first_frame + frame_at(clock.start - clock.origin, clock.frame_rate)
    return first, first + frame_at(clock.end - clock.start, clock.frame_rate)


def recorded_times(state: AppState, settings: RecordSettings) -> tuple[Floats, list[int], float]:
    """Return the times of all frames in seconds, their numbers, and the frame rate."""
    clock = state.clock
    rate = settings.rate or clock.frame_rate
    if settings.kind == ".gif":
        rate = min(rate, MOST_GIF_RATE)
    if not clock.has_motion:
        count = max(round(settings.seconds * rate), 1) if settings.turntable else 1
        if settings.kind == "sheet":
            count = settings.n_cells if settings.turntable else 1
        return np.zeros(count), list(range(count)), rate
    start, end = clock.start, clock.end
    if settings.frames is not None:
        start, end = (clock.frame_time(n - clock.first_frame) for n in settings.frames)
    times = frame_times(start, end, rate)
    first = clock.first_frame if rate == clock.frame_rate else 0
    first += frame_at(start - clock.origin, rate)
    if settings.kind == "sheet":
        chosen = np.array(frames_looked_at(len(times), settings.n_cells))
        return times[chosen], (first + chosen).tolist(), rate
    return times, list(range(first, first + len(times))), rate


def _preview_size(size: tuple[int, int]) -> tuple[int, int]:
    """Return the size of the preview of an image, pixels.

    >>> _preview_size((1920, 1080)), _preview_size((1000, 2000)), _preview_size((16, 4000))
    ((320, 180), (100, 200), (1, 200))
    """
    factor = min(_WIDEST / size[0], _HIGHEST / size[1], 1.0)
    return max(round(factor * size[0]), 1), max(round(factor * size[1]), 1)


class RecordedMarks:
    """Annotations of the pinned vertex and the chosen finding, copied from the state."""

    def __init__(self, state: AppState) -> None:
        weights = state.of(Weights)
        linting = state.of(Linting)
        self._pinned, self._draws_lines = weights.pinned, weights.draws_lines
        self._finding: Finding | None = linting.finding if linting.marks else None
        self._skinning = deepcopy(state.options.skinning)
        self._binding = state.options.show == "binding"

    def at(self, scene: Scene, size: tuple[int, int]) -> Sequence[Annotation]:
        """Return the annotations of one frame for an image's size in pixels."""
        found = []
        if self._finding is not None:
            places = places_of(self._finding, scene, self._skinning, self._binding)
            found.append(mark_annotation(marks_of(places)[0]))
        pinned = self._pinned
        if pinned is not None and not self._binding:
            actor = scene.actors[pinned.actor]
            if actor.own_pose is not None and actor.is_drawn:
                why = explain_vertex(actor.figure, actor.own_pose, self._skinning, pinned.vertex)
                found.append(vertex_annotation(why, actor, self._draws_lines, size))
        return found


def _recording_steps(
    state: AppState,
    programs: Programs,
    settings: RecordSettings,
    path: Path,
    ghost: Ghost | None = None,
) -> Generator[object, None, list[str]]:
    """Record the playback range; ``{frame}`` in the path stands for the number of an image."""
    times, numbers, rate = recorded_times(state, settings)
    recording = Recording(
        replace(state.scene, actors=[replace(actor) for actor in state.scene.actors]),
        times,
        state.camera.copy(),
        settings.pixels((state.view_rect[2], state.view_rect[3])),
        _recorded_options(state, settings, len(times)),
        numbers=numbers,
        rate=rate,
        box=state.box.copy(),
        moves=state.clock.has_motion,
        interpolate=state.clock.interpolate_gaps,
        turntable=360.0 if settings.turntable else 0.0,
        follow=_recorded_follow(state, settings),
        selected=(state.chosen_actor, state.selected_joint),
        annotations=RecordedMarks(state).at,
    )
    files = [path]
    if settings.kind == "pictures":
        files = numbered_paths(path, recording.numbers)
    # The dialog asks before replacing a single file, but not for numbered files.
    is_asked = settings.kind != "pictures"
    check_targets(files, state.inputs, is_asked, hint="choose another name")
    sink = _sink(settings, files, recording)
    renderer = Renderer(programs)
    renderer.ghost = ghost
    try:
        # The recording must be closed before its renderer, even if this generator is closed.
        with contextlib.closing(record(recording, renderer, sink)) as steps:
            yield from steps
    except (ViewerError, GeneratorExit):
        if sink.n_kept:
            state.say(f"{sink.n_kept} of {len(files)} pictures were written, and are kept")
        raise
    finally:
        renderer.release()
    name = printable(files[0], 200) + (f" to {printable(files[-1].name)}" if files[1:] else "")
    notes = [*sink.notes, *renderer.notes]
    width, height = recording.size
    return [f"Saved {name}: {recording.n_frames} frames, {width} x {height}", *notes]


def _sink(settings: RecordSettings, files: list[Path], recording: Recording) -> Sink:
    """Return the sink of the frames, which have the size of the cells in a contact sheet."""
    from viewer.media.picture_sinks import PictureSink, SheetSink

    if settings.kind == "pictures":
        return PictureSink(files)
    if settings.kind == "sheet":
        sheet = SheetSink(files[0], recording.size, recording.numbers)
        recording.size = sheet.cell
        return sheet
    from viewer.media.video import VideoSink

    quality, is_transparent = settings.quality, settings.is_transparent
    return VideoSink(files[0], recording.size, recording.rate, quality, is_transparent)


def start_recording(state: AppState, renderer: Renderer) -> None:
    """Start a requested recording unless another job is running."""
    recording = state.of(RecordingState)
    path, settings, recording.wanted = recording.wanted, recording.settings, None
    if path is None or settings is None or state.job is not None:
        return
    steps = _recording_steps(state, renderer.programs, replace(settings), path, renderer.ghost)
    state.job = FrameJob(f"Recording {printable(path.name, 60)}", steps, "recording")
    state.clock.playing, recording.settings = False, None
