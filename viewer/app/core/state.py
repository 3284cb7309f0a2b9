"""State shared by all features of the window: scene, camera, clock, history and messages."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import field
from functools import wraps
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np

from viewer.app.core.clock import Clock
from viewer.app.core.framing import Framing
from viewer.app.core.jobs import Job
from viewer.app.core.messages import Messages
from viewer.app.core.saved_work import Animations, SavedWork
from viewer.app.core.scene_version import SceneVersion, version_of
from viewer.app.core.undo_history import History
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.errors import ViewerError
from viewer.loading import MotionSettings
from viewer.rendering.camera import SMALLEST, Camera, front_azimuth, orbit
from viewer.rendering.options import DisplayOptions
from viewer.rendering.overlay.legend import Legend
from viewer.rigs.arrays import Floats
from viewer.rigs.inspection.front import WantedFront, guess_front
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.scene import Actor, Scene, scene_points

_FARTHEST = 1e4  # maximum distance of the camera, relative to the scene's size
Part = TypeVar("Part")
_Rest = ParamSpec("_Rest")


def shows_errors(
    act: Callable[Concatenate[AppState, _Rest], None],
) -> Callable[Concatenate[AppState, _Rest], None]:
    """Return an action that shows the message of a ``ViewerError`` and does nothing more."""

    @wraps(act)
    def run(state: AppState, /, *rest: _Rest.args, **named: _Rest.kwargs) -> None:
        try:
            act(state, *rest, **named)
        except ViewerError as problem:
            state.error = str(problem)

    return run


@dataclass(slots=True)
class Stats:
    """Facts of the last frame."""

    frame_ms: float = 0.0
    renderer: str = ""
    version: str = ""
    samples: int = 0
    scalar_range: tuple[float, float] = (0.0, 0.0)
    scalar_ends: tuple[float, float] = (0.0, 0.0)
    legend: Legend | None = None
    live: list[tuple[str, str]] = field(default_factory=list)
    """What other programs have sent: headings and texts."""


@dataclass(slots=True)
class AppState:
    """State that all features share; ``of`` gives the state of a single feature."""

    scene: Scene
    camera: Camera
    options: DisplayOptions
    """The scene, its point of view and its display settings."""
    box: Floats
    """(2, 3): bounding box of the scene in its current shape, in its initial pose or over its whole
    motion. The grid is at its bottom."""
    paths: tuple[Path, ...] = ()
    """The files of the scene; empty for the bundled figure."""
    opened_at: float = field(default_factory=time.time)
    """Time at which the scene was opened, seconds since the epoch."""
    motion_settings: MotionSettings | None = None
    """Settings with which its motions were read, if any were given."""
    chosen_actor: int = 0
    """Index of the actor to which panels apply."""
    is_actor_selected: bool = False
    """Whether the user selected that actor: it then has an outline if there are several actors."""
    n_choices: int = 0
    """Number of times an actor was chosen; features compare it to detect outdated state."""
    selected_joint: int = -1
    """Selected joint of the chosen actor; -1 for none."""
    in_degrees: bool = True
    """Whether rotations are shown in degrees instead of radians."""
    panels_visible: bool = True
    """Whether panels and menus are drawn."""
    view_rect: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)
    """The part of the window that panels leave free, in window coordinates: (x, y, width,
    height)."""
    item_rects: dict[str, tuple[float, float, float, float]] = field(default_factory=dict)
    """Last rectangle of each labelled widget: (x0, y0, x1, y1), which tests click."""
    wants_screenshot: bool = False
    """Whether a picture of the scene is saved after the frame."""
    error: str = ""
    """Error message shown above everything else; empty if there is none."""
    messages: Messages = field(default_factory=Messages)
    """All messages, and those currently shown."""
    stats: Stats = field(default_factory=Stats)
    """Statistics of the last frame."""
    version: SceneVersion = SceneVersion((), DisplayOptions())
    """The scene as it was last compared: after the edits of a frame, and again once the clock has
    posed it."""
    history: History = field(default_factory=History)
    """Undo history."""
    framing: Framing = field(default_factory=Framing)
    """State of the camera's fitting."""
    clock: Clock = field(default_factory=Clock)
    """Advances the scene's time, and poses the actors for it."""
    job: Job | None = None
    """Job that runs in the background or between frames."""
    _parts: dict[type[object], Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._begin()

    def of(self, kind: type[Part]) -> Part:
        """Return a feature's own state, created on first use from the defaults of its dataclass."""
        try:  # two hundred times per frame
            return self._parts[kind]
        except KeyError:
            part = self._parts[kind] = kind()
            return part

    def put(self, part: Part) -> Part:
        """Replace a feature's own state, and return the new one."""
        self._parts[type(part)] = part
        return part

    @property
    def actor(self) -> Actor:
        """The actor to which panels apply."""
        return self.scene.actors[self.chosen_actor]

    def choose_actor(self, index: int) -> None:
        """Choose the actor to which panels apply."""
        self.chosen_actor, self.is_actor_selected = index, False
        self.n_choices += 1
        self.clock.follow(self.actor)  # stepping uses the frames of this actor
        self.selected_joint = -1

    def select_actor(self, index: int) -> None:
        """Choose an actor as the user's selection, which is outlined if there are several."""
        self.choose_actor(index)
        self.is_actor_selected = True

    def deselect(self) -> None:
        """Deselect the joint and the actor; the actor remains the chosen one."""
        self.selected_joint, self.is_actor_selected = -1, False

    @property
    def aspect(self) -> float:
        """Width / height of the view."""
        _, _, width, height = self.view_rect
        return max(width, 1.0) / max(height, 1.0)

    @property
    def inputs(self) -> tuple[Path, ...]:
        """Files that were read for the scene, which no output may overwrite."""
        return (*self.paths, *self.scene.files)

    def show_scene(self, scene: Scene, paths: Sequence[Path]) -> None:
        """Replace the scene; the camera keeps its direction relative to the front."""
        points = scene_points(scene, self.options.show)
        self.scene, self.paths = scene, tuple(paths)
        self.opened_at, self.motion_settings = time.time(), None
        self.box = bounding_box(points)
        self.camera.up, self.camera.fixed = scene.up, None
        self.set_front("auto")
        self.framing.restart()
        # Body parts and levels of detail differ between models.
        self.options.hidden_parts, self.options.reduced = (), False
        self.options.path_joints = ()
        self.choose_actor(0)
        self._begin()

    def _begin(self) -> None:
        """Go to the start of the scene's motion, with an empty history."""
        self.clock.show(self.scene)
        self.history.start(self.update_version(), self.clock.time)
        self.put(Animations())  # those of the previous scene would keep its actors in memory
        self.put(SavedWork()).add_actors(self.scene.actors)
        self.say(*self.scene.diagnostics)

    def update_version(self) -> SceneVersion:
        """Return the current version of the scene, the same object if nothing has changed."""
        self.version = version_of(self.scene, self.options, self.version)
        return self.version

    def observe(self, busy: bool = False) -> None:
        """Record an edit of the scene; while a widget is held, the edit is in progress."""
        self.history.observe(self.update_version(), busy)

    def set_front(self, front: WantedFront) -> None:
        """Set the axis that figures face, or estimate it (``"auto"``); the camera rotates along."""
        ahead = front_azimuth(guess_front(self.scene) if front == "auto" else front, self.scene.up)
        orbit(self.camera, ahead - self.camera.front, 0.0)
        self.camera.front = ahead

    def limit_camera(self) -> None:
        """Keep the camera close enough to the scene for the precision of float32."""
        size = box_size(self.box) or 1.0
        camera, center = self.camera, self.box.mean(axis=0)
        farthest = max(_FARTHEST * size, SMALLEST)
        camera.distance = min(max(camera.distance, 1e-5 * size), farthest)
        away = camera.target - center
        length = float(np.linalg.norm(away))
        if length > _FARTHEST * size:
            camera.target = center + away * (_FARTHEST * size / length)

    def say(self, *messages: str | Diagnostic) -> None:
        """Show messages that time out; longer ones are shown longer."""
        for message in messages:
            self.messages.show(str(message))

    def say_status(self, text: str) -> None:
        """Show the result of a key or button in place of the previous one."""
        self.messages.show(text, is_status=True)

    def advance_job(self) -> bool:
        """Step the running job and report how it ended; return whether it failed in this frame."""
        job = self.job
        if job is None:
            return False
        job.step()
        if not job.is_done:
            return False
        self.job = None
        # A cancelled export may have been finished all the same.
        if job.is_cancelled and not job.output:
            return False
        self.say(*job.lines)
        self.error = job.error or self.error
        return bool(job.error)
