"""AppState: all that panels read and write. Passes and the window act on it."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from viewer.app.curve_view import CurveView
from viewer.app.edits import History
from viewer.app.framing import Framing, restart_framing
from viewer.app.lint_view import LintView
from viewer.app.messages import MessageLog
from viewer.app.playback import Playback
from viewer.app.posing import Posing
from viewer.app.rig_view import RigView
from viewer.app.weights_view import WeightsView
from viewer.diagnostics import Diagnostic
from viewer.rendering.camera import Camera, front_azimuth, orbit
from viewer.rendering.options import DisplayOptions
from viewer.rendering.overlay.legend import Legend
from viewer.rig.arrays import Floats
from viewer.rig.inspection.front import Front, guess_front
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.scene import Actor, Scene, scene_points

if TYPE_CHECKING:
    from viewer.app.file_dialog import FileDialog
    from viewer.app.jobs import Job
    from viewer.app.loader import Loader
    from viewer.app.record_dialog import RecordSettings
    from viewer.app.stream import Stream

__all__ = ["AppState", "HeldVector", "Note", "Stats"]

_NOTE_SECONDS = 4.0
_FARTHEST = 1e4  # sizes of the scene


@dataclass(slots=True)
class Note:
    """A message that goes away by itself, or when the next one of its kind comes."""

    text: str
    until: float
    is_status: bool = False


@dataclass(slots=True)
class HeldVector:
    """A joint's rotation vector as it was typed: beyond half a turn its rotation has another."""

    joint: int
    vector: Floats
    rotation: Floats


@dataclass(slots=True)
class Stats:
    """What the last frame took and who drew it."""

    frame_ms: float = 0.0
    renderer: str = ""
    version: str = ""
    samples: int = 0
    skin_updates: int = 0
    scalar_range: tuple[float, float] = (0.0, 0.0)
    scalar_ends: tuple[float, float] = (0.0, 0.0)
    legend: Legend | None = None


@dataclass(slots=True)
class AppState:
    """Everything that the interface shows and changes.

    Attributes
    ----------
    scene, camera, options : Scene, Camera, DisplayOptions
        What is shown, from where, and how.
    box : (2, 3)
        Around the scene in its present shape, as it was opened or over its whole motion: the grid
        lies under it.
    paths : tuple of Path
        The files of the scene; empty for the bundled figure.
    chosen_actor : int
        Index of the actor that panels act on.
    selected_joint : int
        Of the chosen actor; -1 for none.
    in_degrees : bool
        Whether rotations are shown in degrees or radians.
    as_vectors : bool
        Whether ball joints are edited as rotation vectors instead of angles about x, y, z.
    held_vector : HeldVector or None
        The rotation vector being edited.
    shape_seed : int
        Of the random shape drawn last.
    n_hand_components : int
        How many principal components of the hands have sliders.
    models : dict
        Body models in the model folder, by name; looked for when the menu opens.
    held_modifiers : int
        Ctrl, Shift and so on in the frame before, as ImGui's bits.
    view_rect : (x, y, width, height)
        The part of the window that panels leave free, in window coordinates.
    item_rects : dict
        Where each labelled widget was drawn last: (x0, y0, x1, y1). Tests aim by it.
    wants : set of str
        What the window has to do after the frame: "screenshot", "quit", "open dialog".
    wants_open : list of Path
        Files to open after the frame.
    framing : Framing
        Whether the camera keeps fitting what is shown.
    playback : Playback
        The scene's clock.
    curves : CurveView
        What the Curves panel shows.
    weights : WeightsView
        What the Weights panel and the tools for vertices keep.
    lint : LintView
        What the Lint panel shows.
    closed_panels, opened_panels : set of str
        Those that were closed, and of those that wait to be asked for, the ones that were.
    posing : Posing
        What the tools that pose by hand keep.
    rig : RigView
        What the Rig panel keeps.
    job : Job or None
        Work that goes on beside the frame loop.
    record : RecordSettings or None
        What the window "Record" asks for, while it is open.
    log : MessageLog
        Everything that was said.
    messages_visible : bool
        Whether the window "Messages" is open.
    logs_status : bool
        Whether it lists what keys and buttons did as well.
    logged_error : str
        The error that the log has already, while it is shown.
    wants_pick : (x, y, aims) or None
        Where the view was clicked, from its corner; whether the camera aims there.
    wants_recording : Path or None
        Where to record to, after the frame.
    stream : Stream or None
        Captures that are still being read.
    followed : (int, int) or None
        The actor, and the joint of it (-1 for its middle), that the camera follows.
    followed_from : (3,) or None
        Where that was when the camera was moved last.
    """

    scene: Scene
    camera: Camera
    options: DisplayOptions
    box: Floats
    paths: tuple[Path, ...] = ()
    chosen_actor: int = 0
    selected_joint: int = -1
    in_degrees: bool = True
    as_vectors: bool = False
    held_vector: HeldVector | None = None
    shape_seed: int = 0
    n_hand_components: int = 6
    models: dict[str, Path] = field(default_factory=dict)
    panels_visible: bool = True
    keys_visible: bool = False
    messages_visible: bool = False
    logs_status: bool = False
    held_modifiers: int = 0
    wants_layout_reset: bool = False
    joint_filter: str = ""
    opened_joints: set[int] = field(default_factory=set)
    closed_panels: set[str] = field(default_factory=set)
    opened_panels: set[str] = field(default_factory=set)
    view_rect: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)
    item_rects: dict[str, tuple[float, float, float, float]] = field(default_factory=dict)
    wants: set[str] = field(default_factory=set)
    wants_open: list[Path] = field(default_factory=list)
    error: str = ""
    logged_error: str = ""
    notes: list[Note] = field(default_factory=list)
    log: MessageLog = field(default_factory=MessageLog)
    stats: Stats = field(default_factory=Stats)
    history: History = field(default_factory=History)
    framing: Framing = field(default_factory=Framing)
    playback: Playback = field(default_factory=Playback)
    curves: CurveView = field(default_factory=CurveView)
    lint: LintView = field(default_factory=LintView)
    weights: WeightsView = field(default_factory=WeightsView)
    posing: Posing = field(default_factory=Posing)
    rig: RigView = field(default_factory=RigView)
    job: Job | None = None
    record: RecordSettings | None = None
    wants_pick: tuple[float, float, bool] | None = None
    wants_recording: Path | None = None
    stream: Stream | None = None
    followed: tuple[int, int] | None = None
    followed_from: Floats | None = None
    recent: list[tuple[str, ...]] = field(default_factory=list)
    dialog: FileDialog | None = None
    loader: Loader | None = None

    def __post_init__(self) -> None:
        self.lint.note_opened()
        self.playback.show(self.scene)
        self.history.time = self.playback.time
        self.history.start(self.scene, self.options)
        self.opened_joints = _first_opened(self.actor)
        self.say(*self.scene.diagnostics)

    @property
    def actor(self) -> Actor:
        """The actor that panels act on."""
        return self.scene.actors[self.chosen_actor]

    def choose_actor(self, index: int) -> None:
        """Let panels act on another actor."""
        self.chosen_actor = index
        self.playback.follow(self.scene.actors, self.actor)  # one steps by its frames
        self.selected_joint = -1
        self.held_vector = None
        self.joint_filter = ""
        self.opened_joints = _first_opened(self.actor)

    @property
    def aspect(self) -> float:
        """Width / height of the view."""
        _, _, width, height = self.view_rect
        return max(width, 1.0) / max(height, 1.0)

    @property
    def inputs(self) -> tuple[Path, ...]:
        """All that was read for the scene, which no result replaces."""
        return (*self.paths, *self.scene.files)

    def show_scene(self, scene: Scene, paths: Sequence[Path]) -> None:
        """Replace the scene; the camera sees its front from where it saw the last one's."""
        points = scene_points(scene, self.options.show)
        self.scene, self.paths = scene, tuple(paths)
        self.lint.note_opened()
        self.box = bounding_box(points)
        self.camera.up, self.camera.fixed = scene.up, None
        self.set_front("auto")
        restart_framing(self)
        # Body parts and levels of detail mean something else on another model.
        self.options.hidden_parts, self.options.reduced = (), False
        self.options.trail_joints = ()
        self.followed = self.followed_from = None
        self.choose_actor(0)
        self.playback.show(scene)
        self.history.time = self.playback.time
        self.history.start(scene, self.options)
        self.say(*scene.diagnostics)

    def set_front(self, front: Front) -> None:
        """Say which axis the figures face, or let it be guessed; the camera turns as far.

        Parameters
        ----------
        front : str
            ``"auto"``, or an axis as ``"+z"``, not the one that points up.
        """
        ahead = front_azimuth(guess_front(self.scene) if front == "auto" else front, self.scene.up)
        orbit(self.camera, ahead - self.camera.front, 0.0)
        self.camera.front = ahead

    def limit_camera(self) -> None:
        """Keep the camera where float32 still draws the scene: near it, by its size."""
        size = box_size(self.box) or 1.0
        camera, center = self.camera, self.box.mean(axis=0)
        camera.distance = min(max(camera.distance, 1e-5 * size), _FARTHEST * size)
        away = camera.target - center
        length = float(np.linalg.norm(away))
        if length > _FARTHEST * size:
            camera.target = center + away * (_FARTHEST * size / length)

    def say(self, *messages: str | Diagnostic) -> None:
        """Show messages that go away by themselves; longer ones stay longer."""
        for message in messages:
            self._note(str(message))

    def say_status(self, text: str) -> None:
        """Show what a key did, in place of what the key before did."""
        self.notes[:] = [note for note in self.notes if not note.is_status]
        self._note(text, is_status=True)

    def _note(self, text: str, is_status: bool = False) -> None:
        until = time.monotonic() + _NOTE_SECONDS + len(text) / 30.0
        # What is said again stays longer, and does not push others out of the view.
        self.notes[:] = [note for note in self.notes if note.text != text]
        self.notes.append(Note(text, until, is_status))
        self.log.add(text, "status" if is_status else "note")

    def log_error(self) -> None:
        """Keep the error that is shown in the log, once while it is shown."""
        if self.error and self.error != self.logged_error:
            self.log.add(self.error, "error")
        self.logged_error = self.error

    def drop_old_notes(self) -> None:
        """Forget messages whose time is over."""
        now = time.monotonic()
        self.notes[:] = [note for note in self.notes if note.until > now]


def _first_opened(actor: Actor) -> set[int]:
    """Return the joints whose rows are open at first: all of a small rig, else the roots."""
    skeleton = actor.figure.skeleton
    if skeleton is None:
        return set()
    if skeleton.n_joints <= 128:
        return set(range(skeleton.n_joints))
    return {joint for joint, parent in enumerate(skeleton.parents) if parent < 0}
