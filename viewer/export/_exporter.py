"""Properties of an exporter, and a check that several share."""

from __future__ import annotations

from typing import Literal

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rig.scene import Actor


@dataclass(frozen=True, slots=True)
class Exporter:
    """Properties of an exporter that menus need before its module is imported."""

    title: str
    """Label in menus."""
    suffixes: tuple[str, ...]
    """With leading dots; ``"/"`` represents a folder."""
    keeps: str
    omits: str
    """Data that its files contain, and data that they cannot store."""
    writes_pose: bool = True
    """Whether its module has ``export(actor, path, skinning)``."""
    writes_motion: bool = False
    """Whether its module has ``export_animation(animation, path, options)``."""
    keeps_world: bool = False
    """Whether it keeps the up axis of the motion's own world, even if that world is upside down."""
    writes_keys: bool = False
    """Whether its module has ``export_clips(actor, path, skinning, clips)``, which writes all
    animations of a figure with their own keys."""
    writes_several: bool = False
    """Whether its module has ``export_figures``, which writes several figures to one file."""
    is_particular: bool = False
    """Whether its module has ``require(figure)``, which raises RigError for figures whose joints
    the format cannot hold."""
    needs: Literal["mesh", "skeleton", ""] = ""
    """The part without which nothing of a figure can be written."""

    def holds(self, actor: Actor) -> bool:
        """Return whether the actor's figure has the part that the format needs."""
        return not self.needs or getattr(actor.figure, self.needs) is not None


def require_mesh(actor: Actor, what: str) -> None:
    """Raise RigError for a figure without a mesh; the message names the format."""
    if actor.figure.mesh is None:
        raise RigError(f"figure {actor.figure.name} has no mesh to write as {what}")
