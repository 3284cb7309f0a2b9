"""State of the Rig panel: target and template, the template's placement, and the results."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from viewer.app.core.jobs import CountedJob
from viewer.app.core.state import AppState
from viewer.autorig.alignment.similarity import Similarity
from viewer.autorig.alignment.surface_alignment import Alignment, AlignmentSettings
from viewer.autorig.rigged import Rigged
from viewer.diagnostics import Diagnostic
from viewer.rendering.passes.ghost_pass import Ghost
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.geometry.ray_hit import RayHit
from viewer.rig.pose import Pose
from viewer.rig.scene import Actor, Motion, Scene

__all__ = [
    "GHOSTS",
    "TOOLS",
    "Comparison",
    "Landmark",
    "Placing",
    "Result",
    "RigChoices",
    "Rigging",
    "Running",
    "Template",
]

TOOLS = {
    "": ("None", "the mouse orbits and selects as usual"),
    "move": ("Move", "drag the template by its arrows and squares"),
    "rotate": ("Rotate", "rotate the template with its rings"),
    "scale": ("Scale", "drag the ring out or in to scale the template uniformly"),
    "landmarks": ("Landmarks", "click a point of the template, then the same point of the target"),
}
"""Ways to lay the template onto the target by hand: name and what the mouse does."""

GHOSTS = {"": "hidden", "translucent": "translucent", "wireframe": "wireframe", "solid": "solid"}
"""Ways to show the template where it lies."""


@dataclass(frozen=True, slots=True, eq=False)
class Template:
    """A rigged figure whose rig is carried over.

    Attributes
    ----------
    key : str
        Of the list of templates.
    figure : Figure
        With mesh, skeleton and skin.
    pose : Pose
        Its own; of an actor of the scene the actor's present one counts.
    clip : Motion or None
        Its motion.
    actor : Actor or None
        That of the scene; None if it was read from files for this.
    paths : tuple of Path
        Those files; empty for an actor.
    """

    key: str
    figure: Figure
    pose: Pose
    clip: Motion | None = None
    actor: Actor | None = None
    paths: tuple[Path, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Placing:
    """Where the posed template lies in the target's frame.

    Attributes
    ----------
    similarity : Similarity
        Template to target.
    alignment : Alignment or None
        With its errors; None until those are measured.
    settings : AlignmentSettings
        How to come there again.
    fitted : Template or None
        The template with its joints turned and its limbs resized; None where it fits as it is.
    lines : tuple of Diagnostic
        What was done to it.
    meshes : tuple of object
        The target's mesh and the template's figure: for others it means nothing.
    pose : tuple
        Key of the template's pose that it was found for.
    """

    similarity: Similarity
    alignment: Alignment | None
    settings: AlignmentSettings
    fitted: Template | None
    lines: tuple[Diagnostic, ...]
    meshes: tuple[object, object]
    pose: tuple[object, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Landmark:
    """The same point on both surfaces."""

    template: RayHit
    target: RayHit


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """A target that was rigged.

    Attributes
    ----------
    method : str
        A key of ``METHODS``.
    rigged : Rigged
        What the transfer made.
    actor : Actor
        The one that shows it.
    target : Actor
        The one that was rigged.
    template : Template
        Whose rig it has.
    """

    method: str
    rigged: Rigged
    actor: Actor
    target: Actor
    template: Template


@dataclass(frozen=True, slots=True)
class Comparison:
    """How far two results for one target are apart.

    Attributes
    ----------
    weights : float
        Mean over vertices of sum_j |w - w'|; 2 if all weight is elsewhere.
    dominant : float
        Share of vertices with the same strongest joint.
    """

    weights: float
    dominant: float


@dataclass(slots=True, eq=False)
class Running:
    """Work in a thread, which leaves here what is to be done with what it found."""

    source: Scene
    job: CountedJob | None = None
    finish: Callable[[AppState], None] | None = None


@dataclass(slots=True)
class RigChoices:
    """What is asked for, as the panel's controls say it.

    Attributes
    ----------
    up, facing : str
        The target's axes; empty to search for them.
    scale : str
        One of ``SCALES``.
    refines : bool
        Whether closest points improve on landmarks.
    fits : bool
        Whether the template's joints are turned and its limbs resized where that is needed.
    method, joints : str
        As in ``TransferSettings``.
    max_distance : float
        Of the target's size.
    max_angle : float
        Degrees.
    smoothing : int
        Rounds.
    max_influences : int
        0 for all.
    correctives : bool
        Whether pose correctives are carried.
    """

    up: str = ""
    facing: str = ""
    scale: str = "uniform"
    refines: bool = True
    fits: bool = True
    method: str = "robust"
    joints: str = "surface"
    max_distance: float = 0.05
    max_angle: float = 30.0
    smoothing: int = 0
    max_influences: int = 0
    correctives: bool = True


@dataclass(slots=True)
class Rigging:
    """The Rig panel's own state.

    Attributes
    ----------
    scene : Scene or None
        The one that all of this is about.
    target : Actor or None
        The mesh that is to be rigged.
    template_key : str
        The entry of the list of templates that is chosen.
    template : Template or None
        What was read for it; of actors it is made anew each time.
    choices : RigChoices
        What the controls say.
    placing : Placing or None
        Where the template lies, once it was aligned or moved.
    ghost : str
        A key of ``GHOSTS``.
    tool : str
        A key of ``TOOLS``.
    holds_mouse : bool
        Whether the pointer is on a handle of the gizmo, or holds one.
    scaling : (float, float) or None
        While the ring that scales is held: how far from the middle it was taken, and the
        template's scale then.
    was_dragged : bool
        Whether the gizmo has moved the template since its error was measured.
    landmarks : list of Landmark
        Pairs that were clicked.
    pending : RayHit or None
        The template's point of the pair that lacks the target's.
    aside : (3,)
        By how much the template is shown beside the target while landmarks are clicked.
    match_share : float or None
        Share of matched vertices that the target's colours show.
    running : Running or None
        The work that goes on.
    results : dict of str to Result
        The last one of each method, all for one target.
    comparison : Comparison or None
        Of both methods' results.
    scrolls : int
        Frames for which the panel still brings the result into view.
    ghost_key, ghost_figure : object, Figure or None
        The posed template as a mesh, and what it was posed for.
    shown : Ghost or None
        What is drawn over the scene; the same object as long as it looks the same.
    """

    scene: Scene | None = None
    target: Actor | None = None
    template_key: str = ""
    template: Template | None = None
    choices: RigChoices = field(default_factory=RigChoices)
    placing: Placing | None = None
    ghost: str = "translucent"
    tool: str = ""
    holds_mouse: bool = False
    scaling: tuple[float, float] | None = None
    was_dragged: bool = False
    landmarks: list[Landmark] = field(default_factory=list)
    pending: RayHit | None = None
    aside: Floats = field(default_factory=lambda: np.zeros(3))
    match_share: float | None = None
    running: Running | None = None
    results: dict[str, Result] = field(default_factory=dict)
    comparison: Comparison | None = None
    scrolls: int = 0
    ghost_key: object = None
    ghost_figure: Figure | None = None
    shown: Ghost | None = None

    def kept(self) -> object | None:
        """Return the template's placement, which is undone with the scene."""
        return self.placing

    def restore(self, kept: object | None) -> None:
        """Put the template where it was."""
        self.placing = kept if isinstance(kept, Placing) else None
