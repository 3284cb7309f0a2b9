"""The actors of a scene that is being put together."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from viewer.diagnostics import Diagnostic
from viewer.rig.scene import Actor, free_title

if TYPE_CHECKING:
    from viewer.loading.capturing import Builder
    from viewer.rig.captures.camera_view import CameraView

__all__ = ["Cast"]


@dataclass(slots=True)
class Cast:
    """The actors of a scene that is being put together.

    Attributes
    ----------
    actors : list of Actor
        Those of figures that were opened first.
    ups : list of "y" or "z"
        The axis that points up where each of them stands.
    placed : list of bool
        Whether its motion says where it is.
    builders : list of Builder
        Captures that are still being read.
    views : list of CameraView
        Calibrated cameras, in the scene.
    diagnostics : list of Diagnostic
        What was noticed while it was put together.
    """

    actors: list[Actor]
    ups: list[str] = field(default_factory=list)
    placed: list[bool] = field(default_factory=list)
    builders: list[Builder] = field(default_factory=list)
    views: list[CameraView] = field(default_factory=list)
    diagnostics: list[Diagnostic] = field(default_factory=list)

    def note(self, key: str, path: Path | None = None, **values: Any) -> None:
        """Record a remark about a file, or about none; ``values`` are what its message shows."""
        self.diagnostics.append(Diagnostic(key, path, values=values))

    def free_title(self, title: str) -> str:
        """Return a title for one more actor, or all people of one more capture."""
        return free_title(self.actors, title)

    def add(self, actor: Actor, up: str, placed: bool) -> None:
        """Add one actor at the end."""
        self.actors.append(actor)
        self.ups.append(up)
        self.placed.append(placed)
