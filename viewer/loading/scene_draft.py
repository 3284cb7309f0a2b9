"""Draft of a scene: its actors and their properties while files are assembled."""

from __future__ import annotations

from dataclasses import field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, note
from viewer.rigs.scene import Actor, free_title

if TYPE_CHECKING:
    from viewer.loading.capturing import Builder
    from viewer.rigs.captures.cameras import CameraImages, CameraView
    from viewer.rigs.figure import FigureGroup


@dataclass(slots=True)
class SceneDraft:
    """The actors of a scene under construction."""

    actors: list[Actor]
    """Actors of opened figures come first."""
    ups: list[str] = field(default_factory=list)
    """List of "y" or "z": the up axis of each actor."""
    placed: list[bool] = field(default_factory=list)
    """Whether each actor's motion determines its position."""
    groups: list[FigureGroup | None] = field(default_factory=list)
    """Group of each actor's figure; its actors keep their positions relative to each other."""
    builders: list[Builder] = field(default_factory=list)
    """Captures that are still being read."""
    views: list[CameraView] = field(default_factory=list)
    """Calibrated cameras, in scene space."""
    images: CameraImages | None = None
    """Images of the cameras: those of the first capture that has any."""
    diagnostics: list[Diagnostic] = field(default_factory=list)
    """Messages from assembling the scene."""
    used_options: set[str] = field(default_factory=set)
    """Options that had an effect; ``begin`` reports the others."""
    files: list[Path] = field(default_factory=list)
    """Files of body models, which are not among the opened files; the scene's list, once there is a
    scene."""

    def note(self, key: str, path: Path | None = None, **values: Any) -> None:
        """Record a message, with the values of its template, about a file if ``path`` is given."""
        self.diagnostics.append(note(key, path, **values))

    def note_motions(self, path: Path) -> None:
        """Record the file of the motions that actors have received since the last call."""
        for actor in self.actors:
            if actor.clip is not None and actor.clip_origin is None:
                actor.clip_origin = path, actor.clip

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
