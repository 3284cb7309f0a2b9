"""State of the tools that show weights: hovering, picking, explaining."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from imgui_bundle import imgui

from viewer.rendering.overlay.annotation import Annotation
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.inspection.explanation import Explanation

__all__ = ["Hover", "Pinned", "Weights", "wants_vertex"]


@dataclass(frozen=True, slots=True, eq=False)
class Pinned:
    """A vertex that is explained.

    Attributes
    ----------
    actor : int
        Index in the scene.
    figure : Figure
        That actor's: of another figure the vertex means nothing.
    vertex : int
        Index.
    """

    actor: int
    figure: Figure
    vertex: int


@dataclass(slots=True)
class Hover:
    """What lies under a mouse that rests.

    Attributes
    ----------
    since : float
        Seconds of ImGui's clock at which mouse and picture came to rest.
    place : (float, float)
        Where the mouse is, window coordinates.
    picture : object
        What the picture depends on; compared to know whether it changed.
    is_known : bool
        Whether it was looked what is there since then.
    lines : tuple of str
        What is said of the vertex; empty for none.
    point : (3,)
        Where the vertex is, scene space.
    """

    since: float = 0.0
    place: tuple[float, float] = (-1.0, -1.0)
    picture: object = None
    is_known: bool = False
    lines: tuple[str, ...] = ()
    point: Floats = field(default_factory=lambda: np.zeros(3))


@dataclass(slots=True)
class Weights:
    """The state of the Weights panel and of what shows vertices.

    Attributes
    ----------
    panel_frame : int
        The frame of ImGui in which the Weights panel was drawn last.
    tells_always : bool
        Whether vertices under the mouse are described though the panel is not shown.
    picks_vertices : bool
        Whether clicks pin vertices in place of choosing actors and joints.
    hover : Hover
        What lies under the mouse.
    is_waiting : bool
        Whether the mouse rests, but not yet long enough.
    pinned : Pinned or None
        The vertex that is explained.
    draws_lines : bool
        Whether lines lead from it to where each joint alone would carry it.
    explanation : Explanation or None
        Of it, as it was computed last.
    explanation_key : object
        What that depends on.
    annotations : tuple of Annotation
        What is drawn of it; at most one.
    annotation_key : object
        What that depends on.
    """

    panel_frame: int = -1
    tells_always: bool = False
    picks_vertices: bool = False
    hover: Hover = field(default_factory=Hover)
    is_waiting: bool = False
    pinned: Pinned | None = None
    draws_lines: bool = True
    explanation: Explanation | None = None
    explanation_key: object = None
    annotations: tuple[Annotation, ...] = ()
    annotation_key: object = None


def wants_vertex(view: Weights) -> bool:
    """Return whether a click is meant for a vertex: with Alt, or while vertices are picked."""
    return view.picks_vertices or imgui.get_io().key_alt
