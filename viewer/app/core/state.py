"""AppState: the scene that is open, and what the core of the window keeps about it."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import numpy as np

from viewer.app.core.framing import Framing
from viewer.app.core.history import History
from viewer.app.core.jobs import Job
from viewer.app.core.messages import Messages
from viewer.app.core.playback import Playback
from viewer.app.core.stats import Stats
from viewer.loading import MotionSettings
from viewer.rendering.camera import Camera, front_azimuth, orbit
from viewer.rendering.options import DisplayOptions
from viewer.rig.arrays import Floats
from viewer.rig.inspection.front import Front, guess_front
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.scene import Actor, Scene, scene_points

__all__ = ["AppState"]

_FARTHEST = 1e4  # sizes of the scene

Part = TypeVar("Part")


@dataclass(slots=True)
class AppState:
    """What every feature of the window reads and changes; what only one needs is its own ``of``.

    Attributes
    ----------
    scene, camera, options : Scene, Camera, DisplayOptions
        What is shown, from where, and how.
    box : (2, 3)
        Around the scene in its present shape, as it was opened or over its whole motion: the grid
        lies under it.
    paths : tuple of Path
        The files of the scene; empty for the bundled figure.
    opened_at : float
        When the scene was opened, seconds since the epoch.
    motion_settings : MotionSettings or None
        How its motions were read, if that was asked for.
    chosen_actor : int
        Index of the actor that panels act on.
    n_choices : int
        How often an actor was chosen: what is kept about the one before is void.
    selected_joint : int
        Of the chosen actor; -1 for none.
    in_degrees : bool
        Whether rotations are shown in degrees or radians.
    panels_visible : bool
        Whether panels and menus are drawn.
    view_rect : (x, y, width, height)
        The part of the window that panels leave free, in window coordinates.
    item_rects : dict
        Where each labelled widget was drawn last: (x0, y0, x1, y1). Tests aim by it.
    wants : set of str
        What the window has to do after the frame: "screenshot", "quit", "open dialog".
    error : str
        What failed, shown over everything; empty for nothing.
    messages : Messages
        What was said, and what is still shown of it.
    stats : Stats
        What the last frame took.
    history : History
        Steps to undo.
    framing : Framing
        Whether the camera keeps fitting what is shown.
    playback : Playback
        The scene's clock.
    job : Job or None
        Work that goes on beside the frame loop.
    """

    scene: Scene
    camera: Camera
    options: DisplayOptions
    box: Floats
    paths: tuple[Path, ...] = ()
    opened_at: float = field(default_factory=time.time)
    motion_settings: MotionSettings | None = None
    chosen_actor: int = 0
    n_choices: int = 0
    selected_joint: int = -1
    in_degrees: bool = True
    panels_visible: bool = True
    view_rect: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)
    item_rects: dict[str, tuple[float, float, float, float]] = field(default_factory=dict)
    wants: set[str] = field(default_factory=set)
    error: str = ""
    messages: Messages = field(default_factory=Messages)
    stats: Stats = field(default_factory=Stats)
    history: History = field(default_factory=History)
    framing: Framing = field(default_factory=Framing)
    playback: Playback = field(default_factory=Playback)
    job: Job | None = None
    _parts: dict[type[object], object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._begin()

    def of(self, kind: type[Part]) -> Part:
        """Return a feature's own state, made when it is first asked for.

        Parameters
        ----------
        kind : type
            A dataclass of the feature that can be made without arguments.
        """
        part = self._parts.get(kind)
        if not isinstance(part, kind):
            part = self._parts[kind] = kind()
        return part

    def put(self, part: Part) -> Part:
        """Replace a feature's own state, and return the new one."""
        self._parts[type(part)] = part
        return part

    @property
    def actor(self) -> Actor:
        """The actor that panels act on."""
        return self.scene.actors[self.chosen_actor]

    def choose_actor(self, index: int) -> None:
        """Let panels act on another actor."""
        self.chosen_actor = index
        self.n_choices += 1
        self.playback.follow(self.scene.actors, self.actor)  # one steps by its frames
        self.selected_joint = -1

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
        self.opened_at, self.motion_settings = time.time(), None
        self.box = bounding_box(points)
        self.camera.up, self.camera.fixed = scene.up, None
        self.set_front("auto")
        self.framing.restart()
        # Body parts and levels of detail mean something else on another model.
        self.options.hidden_parts, self.options.reduced = (), False
        self.options.path_joints = ()
        self.choose_actor(0)
        self._begin()

    def _begin(self) -> None:
        """Go to the start of the scene's motion; nothing of it has been changed yet."""
        self.playback.show(self.scene)
        self.history.time = self.playback.time
        self.history.start(self.scene, self.options)
        self.say(*self.scene.warnings)

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

    def say(self, *texts: str) -> None:
        """Show messages that go away by themselves; longer ones stay longer."""
        for text in texts:
            self.messages.show(text)

    def say_status(self, text: str) -> None:
        """Show what a key did, in place of what the key before did."""
        self.messages.show(text, is_status=True)
