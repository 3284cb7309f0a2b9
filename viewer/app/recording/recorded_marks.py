"""Annotations of the view for each frame of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy

from viewer.app.core.state import AppState
from viewer.app.linting.marks import marks_of
from viewer.app.linting.state import Linting
from viewer.app.weights.explanation_lines import vertex_annotation
from viewer.app.weights.state import Weights
from viewer.lint import Finding, places_of
from viewer.rendering.overlay.annotation import Annotation, mark_annotation
from viewer.rig.inspection.explanation import explain
from viewer.rig.scene import Scene

__all__ = ["RecordedMarks"]


class RecordedMarks:
    """Annotations of a moving scene: those of the pinned vertex and of the chosen finding.

    Parameters
    ----------
    state : AppState
        State with the marks and the explanation; they are copied, so later changes have no effect.
    """

    def __init__(self, state: AppState) -> None:
        weights = state.of(Weights)
        linting = state.of(Linting)
        self._pinned, self._draws_lines = weights.pinned, weights.draws_lines
        self._finding: Finding | None = linting.finding if linting.marks else None
        self._skinning = deepcopy(state.options.skinning)
        self._binding = state.options.show == "binding"

    def at(self, scene: Scene, size: tuple[int, int]) -> Sequence[Annotation]:
        """Return the annotations of one frame.

        Parameters
        ----------
        scene : Scene
            Posed scene with the actors of the state, or copies of them.
        size : (int, int)
            Width and height of the image, pixels.

        Raises
        ------
        ViewerError
            If a figure's shapes cannot be read.
        """
        found = []
        if self._finding is not None:
            places = places_of(self._finding, scene, self._skinning, self._binding)
            found.append(mark_annotation(marks_of(places)[0]))
        pinned = self._pinned
        if pinned is not None and not self._binding:
            actor = scene.actors[pinned.actor]
            if actor.pose is not None and actor.is_drawn:
                why = explain(actor.figure, actor.pose, self._skinning, pinned.vertex)
                found.append(vertex_annotation(why, actor, self._draws_lines, size))
        return found
