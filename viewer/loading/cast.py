"""The actors of a scene that is being put together."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

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
    notes : list of str
        One line each.
    """

    actors: list[Actor]
    ups: list[str] = field(default_factory=list)
    placed: list[bool] = field(default_factory=list)
    builders: list[Builder] = field(default_factory=list)
    views: list[CameraView] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def free_title(self, title: str) -> str:
        """Return a title for one more actor, or all people of one more capture."""
        return free_title(self.actors, title)

    def add(self, actor: Actor, up: str, placed: bool) -> None:
        """Add one actor at the end."""
        self.actors.append(actor)
        self.ups.append(up)
        self.placed.append(placed)
