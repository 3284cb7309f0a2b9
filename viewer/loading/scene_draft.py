"""Draft of a scene: its actors and their properties while files are assembled."""

from __future__ import annotations

from dataclasses import field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.rig.scene import Actor, free_title

if TYPE_CHECKING:
    from viewer.loading.capturing import Builder
    from viewer.rig.captures.cameras import CameraImages, CameraView
    from viewer.rig.figure import FigureGroup


@dataclass(slots=True)
class SceneDraft:
    """The actors of a scene under construction.

    Attributes
    ----------
    actors : list of Actor
        Actors of opened figures come first.
    ups : list of "y" or "z"
        The up axis of each actor.
    placed : list of bool
        Whether each actor's motion determines its position.
    groups : list of FigureGroup or None
        Group of each actor's figure; its actors keep their positions relative to each other.
    builders : list of Builder
        Captures that are still being read.
    views : list of CameraView
        Calibrated cameras, in scene space.
    images : CameraImages or None
        Images of the cameras: those of the first capture that has any.
    diagnostics : list of Diagnostic
        Messages from assembling the scene.
    used_options : set of str
        Options that had an effect; ``begin`` reports the others.
    files : list of Path
        Files of body models, which are not among the opened files; the scene's list, once there
        is a scene.
    """

    actors: list[Actor]
    ups: list[str] = field(default_factory=list)
    placed: list[bool] = field(default_factory=list)
    groups: list[FigureGroup | None] = field(default_factory=list)
    builders: list[Builder] = field(default_factory=list)
    views: list[CameraView] = field(default_factory=list)
    images: CameraImages | None = None
    diagnostics: list[Diagnostic] = field(default_factory=list)
    used_options: set[str] = field(default_factory=set)
    files: list[Path] = field(default_factory=list)

    def note(self, key: str, path: Path | None = None, **values: Any) -> None:
        """Record a message, with the values of its template, about a file if ``path`` is given."""
        self.diagnostics.append(Diagnostic(key, path, values=values))

    def free_title(self, title: str) -> str:
        """Return an unused title for a new actor, or for all people of a new capture."""
        return free_title(self.actors, title)

    def add(self, actor: Actor, up: str, placed: bool, group: FigureGroup | None = None) -> None:
        """Append one actor, with its file if that may contain several figures."""
        self.actors.append(actor)
        self.ups.append(up)
        self.placed.append(placed)
        self.groups.append(group)

    def take(self, index: int) -> Actor:
        """Remove one actor and return it."""
        del self.ups[index], self.placed[index], self.groups[index]
        return self.actors.pop(index)
