"""State of the Weights and Vertex panels: hovering, picking, and the pinned vertex."""

from __future__ import annotations

from dataclasses import field

import numpy as np
from imgui_bundle import imgui

from viewer.data_classes import dataclass
from viewer.rendering.overlay.annotation import Annotation
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.inspection.explanation import Explanation

__all__ = ["Hover", "Pinned", "Weights", "wants_vertex"]


@dataclass(frozen=True, slots=True, eq=False)
class Pinned:
    """The vertex that the Vertex panel explains.

    Attributes
    ----------
    actor : int
        Index of its actor in the scene.
    figure : Figure
        Figure of that actor, for which the index is valid.
    vertex : int
        Index of the vertex.
    """

    actor: int
    figure: Figure
    vertex: int


@dataclass(slots=True)
class Hover:
    """The vertex under a mouse that does not move.

    Attributes
    ----------
    since : float
        Time since which neither mouse nor image has changed, seconds of ImGui's clock.
    place : (float, float)
        Position of the mouse, window coordinates.
    picture : object
        Key of the image, compared to detect a change.
    is_known : bool
        Whether the vertex has been determined since then.
    lines : tuple of str
        Hover text; empty if there is no vertex.
    point : (3,)
        Position of the vertex, scene space.
    """

    since: float = 0.0
    place: tuple[float, float] = (-1.0, -1.0)
    picture: object = None
    is_known: bool = False
    lines: tuple[str, ...] = ()
    point: Floats = field(default_factory=lambda: np.zeros(3))


@dataclass(slots=True)
class Weights:
    """State of the Weights and Vertex panels.

    Attributes
    ----------
    panel_frame : int
        ImGui's number of the last frame in which the Weights panel was drawn.
    always_shows_info : bool
        Whether hover text is shown even if the Weights panel is not visible.
    picks_vertices : bool
        Whether clicks pin vertices instead of selecting actors and joints.
    hover : Hover
        The vertex under the mouse.
    is_waiting : bool
        Whether the mouse is still, but not yet for long enough.
    pinned : Pinned or None
        The vertex that is explained.
    draws_lines : bool
        Whether lines are drawn from the vertex to its images under each joint alone.
    explanation : Explanation or None
        Latest explanation of the vertex.
    explanation_key : object
        Key of the state for which the explanation was computed.
    annotations : tuple of Annotation
        Annotation of the vertex in the view; at most one.
    annotation_key : object
        Key of the state for which the annotation was created.
    """

    panel_frame: int = -1
    always_shows_info: bool = False
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
    """Return whether a click pins a vertex: with Alt, or while vertices are picked."""
    return view.picks_vertices or imgui.get_io().key_alt
