"""Recording of the view in steps of one frame, between which the window stays responsive."""

from __future__ import annotations

import contextlib
from collections.abc import Generator, Sequence
from copy import deepcopy
from dataclasses import replace
from pathlib import Path

from viewer.app.core.jobs import FrameJob
from viewer.app.core.state import AppState
from viewer.app.linting.lint_panel import Linting
from viewer.app.linting.marks import marks_of
from viewer.app.recording.record_dialog import (
    RecordingState,
    RecordSettings,
    recorded_follow,
    recorded_options,
    recorded_times,
)
from viewer.app.weights.vertex_panel import vertex_annotation
from viewer.app.weights.weights_panel import Weights
from viewer.errors import OutputError, ViewerError
from viewer.formats import check_targets
from viewer.lint import Finding, places_of
from viewer.phrases import printable
from viewer.rendering.gpu.program import Programs
from viewer.rendering.overlay.annotation import Annotation, mark_annotation
from viewer.rendering.passes.ghost_pass import Ghost
from viewer.rendering.recorder import Recording, Sink, record
from viewer.rendering.renderer import Renderer
from viewer.rig.inspection.explanation import explain
from viewer.rig.scene import Scene

_FULL = 360.0  # full revolution, degrees


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
            if actor.pose is not None and actor.is_drawn:
                why = explain(actor.figure, actor.pose, self._skinning, pinned.vertex)
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
        recorded_options(state, settings, len(times)),
        numbers=numbers,
        rate=rate,
        box=state.box.copy(),
        moves=state.clock.has_motion,
        interpolate=state.clock.interpolate_gaps,
        turntable=_FULL if settings.turntable else 0.0,
        follow=recorded_follow(state, settings),
        selected=(state.chosen_actor, state.selected_joint),
        annotations=RecordedMarks(state).at,
    )
    files = [path]
    if settings.kind == "pictures":
        files = _numbered(path, recording.numbers)
    # The dialog asks before replacing a single file, but not for numbered files.
    is_asked = settings.kind != "pictures"
    check_targets(files, state.inputs, is_asked, hint="choose another name")
    sink = _sink(settings, files, recording)
    recording.size = getattr(sink, "cell", recording.size)
    renderer = Renderer(programs)
    renderer.ghost = ghost
    try:
        # The recording must be closed before its renderer, even if this generator is closed.
        with contextlib.closing(record(recording, renderer, sink)) as steps:
            yield from steps
    except (ViewerError, GeneratorExit):
        kept = getattr(sink, "n_written", 0)
        if kept:
            state.say(f"{kept} of {len(files)} pictures were written, and are kept")
        raise
    finally:
        renderer.release()
    name = printable(files[0], 200) + (f" to {printable(files[-1].name)}" if files[1:] else "")
    notes = [*getattr(sink, "notes", []), *renderer.notes]
    width, height = recording.size
    return [f"Saved {name}: {recording.n_frames} frames, {width} x {height}", *notes]


def _numbered(path: Path, numbers: Sequence[int]) -> list[Path]:
    try:
        files = [path.with_name(path.name.format(frame=number)) for number in numbers]
    except (ValueError, KeyError, IndexError, AttributeError):
        files = []
    if len(set(files)) < len(numbers):
        raise OutputError(
            f"{printable(path, 300)}: expected a name with {{frame}}, as in "
            f"{printable(path.stem)}_{{frame:05}}.png"
        )
    return files


def _sink(settings: RecordSettings, files: list[Path], recording: Recording) -> Sink:
    """Return the sink of the frames; that of a contact sheet has the size of its cells."""
    from viewer.media.picture_sinks import PictureSink, SheetSink

    if settings.kind == "pictures":
        return PictureSink(files)
    if settings.kind == "sheet":
        return SheetSink(files[0], recording.size, recording.numbers)
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
