"""Parts of a scene that are outlined because they are selected or lie under the pointer."""

from __future__ import annotations

from dataclasses import field

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats

__all__ = ["Outlined"]


@dataclass(frozen=True, slots=True, eq=False)
class Outlined:
    """An outlined part of the scene.

    Attributes
    ----------
    actor : int
        Index in the scene.
    joint : int
        Joint of the actor, outlined if the skeleton is drawn; -1 for the whole actor.
    points : (N, 3)
        Points in scene space, outlined instead of the actor and joint if there are any.
    is_hovered : bool
        Whether it lies under the pointer, rather than being selected.
    """

    actor: int
    joint: int = -1
    points: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    is_hovered: bool = False

    def key(self) -> tuple[object, ...]:
        """Return a key that identifies the outline in an unchanged scene."""
        return self.actor, self.joint, self.points.tobytes(), self.is_hovered
