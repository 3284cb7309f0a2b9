"""Opening of files: the thread that reads them, their scene, and captures read while shown."""

from __future__ import annotations

import queue
import time
from collections.abc import Callable, Sequence
from dataclasses import field, replace
from pathlib import Path

from imgui_bundle import imgui

from viewer.app.core.jobs import ThreadJob
from viewer.app.core.saved_work import Animations, SavedPose, SavedWork, keep_edited
from viewer.app.core.state import AppState, shows_errors
from viewer.app.core.widgets import button
from viewer.app.files.file_choice import PICTURES, FileDialog, folder_of
from viewer.app.files.recent import remember
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.errors import RenderError, ViewerError
from viewer.formats import FORMATS
from viewer.loading import (
    Contents,
    MotionSettings,
    begin,
    bundled_body,
    bundled_files,
    read_files,
)
from viewer.loading.additions import add_to_actor
from viewer.loading.capturing import Builder
from viewer.phrases import printable
from viewer.progress import Cancelled, part_of_work, silent
from viewer.rendering.gpu.index_sets import prepare_scene
from viewer.rigs.captures.capture import CapturePart
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.vectors import StatedUp
from viewer.rigs.motion.sampled_clip import SampledClip, with_rate
from viewer.rigs.motion.timing import DEFAULT_RATE
from viewer.rigs.pose import pose_key
from viewer.rigs.retargeting.drive import Drive
from viewer.rigs.scene import Actor, Scene

_Motions = list[tuple[Actor, Drive, SampledClip, list[Diagnostic]]]
_ADDED = {*FORMATS["pose"].suffixes, *PICTURES}
"""Suffixes of poses and textures, which are applied to the open figure."""
_RIGS = (".glb", ".gltf", ".vrm", ".npz", ".skel", ".skin")  # of the files of a rigged mesh
_WAITING = 4  # maximum number of parts in the queue: limits memory


@dataclass(slots=True)
class Files:
    """State of opening files."""

    dialog: FileDialog | None = None
    """File dialog that is open."""
    loader: Loader | None = None
    """Loader of files that are being opened."""
    stream: Stream | None = None
    """Reader of captures that are not yet complete."""
    recent: list[tuple[str, ...]] = field(default_factory=list)
    """Groups of files that were opened together, latest first."""
    rig: str = ""
    """Rig of the body model that is opened next; empty for its default."""
    models: dict[str, Path] = field(default_factory=dict)
    """Body models that were found, by name; searched for when the menu opens."""
    model_folder: Path | None = None
    """Folder of body models; read when the window "Preferences" opens."""
    up: StatedUp = ""
    """Up axis of captures, BVH, OBJ and PLY files that are opened; empty to detect it."""
    wake: Callable[[], None] = lambda: None
    """Called from other threads when a frame must be drawn."""
    keeps_recent: bool = False
    """Whether opened files are stored in the list of recent files."""


class Loader(ThreadJob):
    """Thread that reads the first of several attempts that loads; dropping it drops its result."""

    def __init__(
        self,
        paths: Sequence[Path],
        attempts: Sequence[Sequence[Path]],
        wake: Callable[[], None],
        settings: MotionSettings | None = None,
        opened: Sequence[Path] = (),
        rig: Figure | None = None,
    ) -> None:
        self.paths: tuple[Path, ...] = tuple(paths)
        self.scene: Scene | None = None
        self.builders: list[Builder] = []
        self.addition: Contents | None = None
        """Poses and images for the open figure, if the files contain nothing else."""
        self._attempts, self._settings = attempts, settings
        self._opened, self._rig = tuple(opened), rig
        title = f"Opening {printable(self.paths[-1].name, 60)}"
        super().__init__(title, self._try_all, wake=wake, names_steps=False, is_daemon=True)

    @property
    def rig(self) -> Figure | None:
        """The figure without a file that the motions drive in the new scene, None without one."""
        shown = [] if self.scene is None else self.scene.actors
        return next((actor.figure for actor in shown if actor.figure is self._rig), None)

    def _try_all(self) -> None:
        for paths in self._attempts:
            try:
                self._read_one(paths)
                if self.scene is not None:
                    prepare_scene(self.scene)
                self.error = ""
                break
            except ViewerError as problem:
                self.error = str(problem)
            except MemoryError:
                self.error = f"{paths[-1]}: not enough memory"

    def _read_one(self, paths: Sequence[Path]) -> None:
        contents = read_files(paths, settings=self._settings)
        if contents.used_options is not None:
            contents.used_options.add("up")  # a preference, which need not apply to every file
        self.paths = tuple(paths)
        if contents.is_addition:
            self.addition = contents
        elif contents.needs_figure and (self._opened or self._rig is not None):
            self._join(contents, paths)
        else:
            self.scene, self.builders = begin(contents, self._settings)

    def _join(self, contents: Contents, paths: Sequence[Path]) -> None:
        """Apply motions to the open figures; motions that match none are shown separately."""
        from viewer.loading.body_models import is_body

        if self._rig is None:
            opened = read_files(self._opened, settings=self._settings)
        else:
            place = self._opened[0] if self._opened else Path(self._rig.name)
            opened = Contents([(place, self._rig)], files=self._opened)
        figures = opened.figures
        kept = {path for path, _ in (*figures, *opened.morphs)}
        kept |= set(self._opened if self._rig is not None else ())
        morphs = [*opened.morphs, *contents.morphs]
        joined = replace(contents, figures=figures, groups=opened.groups, morphs=morphs)
        joined.used_options = (contents.used_options or set()) | (opened.used_options or set())
        count = len(begin(replace(joined, captures=[], skeleton_motions=[]))[0].actors)
        self.scene, self.builders = begin(joined, self._settings)
        has_bodies = any(is_body(figure) for _, figure in figures)
        drives = any(actor.drive and actor.clip for actor in self.scene.actors)
        if contents.only_bodies and not (has_bodies or drives):
            # People drawn with the bundled body replace the scene.
            kept = {path for path, _ in opened.morphs}
            self.scene, self.builders = begin(replace(joined, figures=[]), self._settings)
        if contents.skeleton_motions and len(self.scene.actors) > count:
            # A BVH that drives no open figure is shown separately.
            kept = set()
            self.scene, self.builders = begin(contents, self._settings)
        self.paths = (*(path for path in self._opened if path in kept), *paths)


class Stream(ThreadJob):
    """Thread that reads parts of captures, which the frame loop adds to the scene."""

    def __init__(self, builders: Sequence[Builder], wake: Callable[[], None]) -> None:
        self.builders = tuple(builder for builder in builders if not builder.is_done)
        self._parts: queue.Queue[tuple[Builder, CapturePart | _Motions]] = queue.Queue(_WAITING)
        for builder in self.builders:
            builder.defers = True
        self._is_waiting = False
        self._names = printable(", ".join(one.capture.name for one in self.builders), 60)
        super().__init__(f"Reading {self._names}", self._read_all, wake=wake, is_daemon=True)
        self._count()

    def _read_all(self) -> None:
        for builder in self.builders:
            with silent():  # the frames in the scene are counted instead
                for part in builder.parts():
                    if builder.is_cut:
                        break
                    self._hand_over(builder, part)
            self._complete(builder)

    def _complete(self, builder: Builder) -> None:
        """Compute the final motions after all parts were added."""
        self._is_waiting = True
        while self._parts.unfinished_tasks:
            if self.is_cancelled:
                raise Cancelled
            time.sleep(0.02)
        self._is_waiting = False
        with part_of_work(f"Retargeting {self._names}", (0.0, 1.0)):
            motions = builder.final_motions()
        if motions:
            self._hand_over(builder, motions)

    def _hand_over(self, builder: Builder, part: CapturePart | _Motions) -> None:
        """Put a part into the queue when it has room."""
        while not self.is_cancelled:
            try:
                self._parts.put((builder, part), timeout=0.1)
            except queue.Full:
                continue
            self._wake()
            return
        raise Cancelled

    def receive(self, done: int, total: int, unit: str, what: str) -> None:
        """Receive the progress of retargeting."""
        super().receive(done, total, unit, what)
        self._wake()

    def take(self) -> tuple[list[Actor], list[Diagnostic], bool]:
        """Add what was read since the last call; return new actors, messages, whether it grew.

        Raises ``RigError`` if bodies do not match the model; the stream then ends.
        """
        new: list[Actor] = []
        notes: list[Diagnostic] = []
        grew = False
        while True:
            try:
                builder, part = self._parts.get_nowait()
            except queue.Empty:
                break
            try:
                if builder.is_cut:
                    continue
                grew = True
                if isinstance(part, list):
                    notes += builder.finish(part)
                    continue
                known = builder.actors
                more, said = builder.add(part)
                # The user may have changed the frame rate since the first person appeared.
                keep_rate(known[:1], more)
                new += more
                notes += said
            finally:
                self._parts.task_done()
        if grew:
            self._count()
        return new, notes, grew

    def _count(self) -> None:
        """Show the number of frames in the scene, and their total."""
        read = sum(builder.n_read for builder in self.builders)
        total = sum(builder.capture.n_frames for builder in self.builders)
        self.progress = (read, total, "frames")

    @property
    def is_done(self) -> bool:
        """Whether everything has been read and added."""
        return not self._thread.is_alive() and self._parts.empty()

    def cancel(self) -> None:
        """Stop reading; frames already in the scene remain."""
        super().cancel()
        for builder in self.builders:
            builder.is_cut = True

    def wait(self, seconds: float | None = None) -> bool:
        """Wait until the thread has ended or waits for parts to be added; used by tests."""
        while not super().wait(0.01):
            if self._parts.full() or self._is_waiting:
                return False
        return True


def keep_rate(known: Sequence[Actor], new: Sequence[Actor]) -> None:
    """Set the frame rate of new people to that of the people in the scene."""
    for first in known:
        for actor in new:
            if actor.captured is not None:
                rate = DEFAULT_RATE if first.clip is None else first.clip.frame_rate
                actor.clip = with_rate(actor.captured, rate)


def ask_for_files(
    state: AppState,
    act: Callable[[AppState, list[Path]], object] | None = None,
    title: str = "Open files",
    suffixes: tuple[str, ...] = (),
    is_single: bool = False,
    more: Callable[[AppState, FileDialog], None] | None = None,
    more_rows: float = 0.0,
) -> None:
    """Ask for files, which are opened unless another action is given; see ``FileDialog``."""
    start = folder_of(state.paths)
    dialog = FileDialog(start, act or open_files, "open", title, suffixes, is_single=is_single)
    dialog.more, dialog.more_rows = more, more_rows
    state.of(Files).dialog = dialog


def ask_where_to_write(
    state: AppState,
    write: Callable[[AppState, Path], object],
    title: str,
    suffixes: tuple[str, ...],
    name: str,
    more: Callable[[AppState, FileDialog], None] | None = None,
    more_rows: float = 0.0,
    written: Callable[[Path], list[Path]] | None = None,
) -> None:
    """Ask for the file to write; the parameters are those of ``FileDialog``."""

    def done(state: AppState, paths: list[Path]) -> None:
        write(state, paths[0])

    start, last = folder_of(state.paths), (more, more_rows, written)
    state.of(Files).dialog = FileDialog(start, done, "save", title, suffixes, name, *last)


def offer_files(state: AppState, text: str) -> None:
    """Draw the reason why a panel is empty, and a button that opens files to fill it."""
    imgui.text_wrapped(text)
    if button(state, "Open files…"):
        ask_for_files(state)


def open_bundled_figure(state: AppState) -> None:
    """Open the bundled figure."""
    open_files(state, bundled_files())


def open_bundled_body(state: AppState) -> None:
    """Open the bundled body."""
    open_files(state, [bundled_body()])


def open_files(state: AppState, paths: Sequence[Path]) -> None:
    """Begin to read files; a skin or skeleton joins a scene of its matching counterpart alone."""
    if not paths:
        return
    files = state.of(Files)
    attempts = [[*paths]]
    figures = [actor.figure for actor in state.scene.actors]
    is_part = len(figures) == 1 and (figures[0].mesh is None or figures[0].skeleton is None)
    suffixes = {path.suffix.lower() for path in (*paths, *state.paths)}
    is_part &= len(paths) == 1 and len(state.paths) == 1 and len(suffixes) == 2
    if is_part and paths[0].suffix.lower() not in _ADDED:
        attempts.insert(0, [*state.paths, *paths])
    opened = state.of(SavedWork).rig or state.paths or bundled_files()
    # Motions drive the rig that is shown, also before a file contains it.
    shown, own = [actor.figure for actor in state.scene.actors if actor.visible], None
    if len(shown) == 1 and state.of(SavedWork).lacks_rig(shown[0]):
        moved = {actor.clip_origin[0] for actor in state.scene.actors if actor.clip_origin}
        own, opened = shown[0], tuple(path for path in state.paths if path not in moved)
    rig, files.rig = files.rig, ""
    settings = MotionSettings(up=files.up, rig=rig, springs=True)
    files.loader = Loader(paths, attempts, files.wake, settings, opened, own)


def drive_saved_rig(state: AppState, written: Sequence[Path]) -> None:
    """Let motions that are opened drive a rig that was saved, if it is all that is shown."""
    shown = [actor for actor in state.scene.actors if actor.visible]
    rig = [path for path in written if path.suffix.lower() in _RIGS]
    if len(shown) > 1 or not rig:
        return
    state.of(SavedWork).rig = tuple(rig)


def take_loaded(
    state: AppState, may_replace: Callable[[AppState], bool], prepare: Callable[[Scene], None]
) -> bool:
    """Show the files that were read, or the error; return whether they have replaced the scene.

    ``may_replace``: returns whether nothing would be lost; until then, they wait. ``prepare``:
    uploads a scene, and raises ``RenderError`` if that is impossible.
    """
    files = state.of(Files)
    loader = files.loader
    if loader is None or not loader.is_done:
        return False
    if loader.scene is not None and not may_replace(state):
        return False
    files.loader = None
    if loader.addition is not None:
        _add(state, loader.addition)
    elif loader.scene is None:
        state.error = loader.error
    else:
        try:
            prepare(loader.scene)
        except RenderError as problem:
            state.error = str(problem)
            return False
        if files.stream is not None:
            files.stream.cancel()
        rig = loader.rig
        state.show_scene(loader.scene, loader.paths)
        if rig is not None:
            state.of(SavedWork).edited.add(rig)
        stream_captures(state, loader.builders)
        if files.keeps_recent:
            state.say(*filter(None, [remember(files.recent, loader.paths)]))
        return True
    return False


@shows_errors
def _add(state: AppState, contents: Contents) -> None:
    """Apply poses and textures to the chosen actor."""
    saved = state.of(SavedWork)
    state.observe()
    actor, notes = add_to_actor(contents, state.actor)
    if actor is not state.actor:
        keep_edited(state.of(Animations), state.actor, actor)
        state.history.exchange_actor(state.actor, actor)
        saved.exchange_actor(state.actor, actor)
        state.scene.actors[state.chosen_actor] = actor
    if contents.poses and actor.own_pose is not None:
        saved.add(SavedPose(actor, pose_key(actor.own_pose)))
    state.scene.files += contents.files
    added = [*contents.poses, *contents.pictures]
    state.say(*contents.diagnostics, *notes)
    state.say_status(f"Applied {', '.join(printable(path.name, 60) for path, _ in added)}")


def stream_captures(state: AppState, builders: Sequence[Builder]) -> None:
    """Begin to read the remaining parts of captures."""
    files, left = state.of(Files), [builder for builder in builders if not builder.is_done]
    files.stream = Stream(left, files.wake) if left else None


def take_streamed(state: AppState) -> None:
    """Add the people and longer clips read from captures since the last frame."""
    files = state.of(Files)
    stream = files.stream
    if stream is None:
        return
    try:
        new, notes, grew = stream.take()
    except ViewerError as problem:
        state.error, files.stream = str(problem), None
        stream.cancel()
        return
    if grew:
        state.scene.actors += new
        state.of(SavedWork).add_actors(new)
        state.clock.pose(state.actor, again=True)
        state.history.add_actors(state.update_version())
        state.history.follow(state.version, state.clock.time)
    state.say(*notes)
    if stream.is_done:
        files.stream = None
        state.error = stream.error or state.error
