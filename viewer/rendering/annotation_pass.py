"""Draws annotations: marks of findings, joints seen through the skin, a vertex explained."""

from __future__ import annotations

import moderngl

from viewer.rendering.annotation import Annotation, letters_for, place_labels
from viewer.rendering.label_pass import LabelPass
from viewer.rendering.lettering import Lettering
from viewer.rendering.program import Programs
from viewer.rendering.segments import SegmentPass
from viewer.rendering.view import View

__all__ = ["AnnotationPass"]


class AnnotationPass:
    """Draws annotations over what is bound.

    Parameters
    ----------
    context : moderngl.Context
        The context in use.
    programs : Programs
        Gives the programs.
    """

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self.segments = SegmentPass(context, programs)
        self.labels = LabelPass(context, programs)
        self._lettering: Lettering | None = None

    def draw(self, annotation: Annotation, view: View, size: tuple[int, int]) -> tuple[int, int]:
        """Draw one annotation.

        Parameters
        ----------
        annotation : Annotation
            What is drawn.
        view : View
            The camera's matrices.
        size : (int, int)
            Width and height of the picture, pixels.

        Returns
        -------
        (int, int)
            How many of the words that belong to this picture are not drawn because they would
            cover another one, and of how many.

        Raises
        ------
        RenderError
            If the driver has no room for it.
        """
        self.segments.draw(annotation.segments, view, size, annotation.manner)
        if annotation.labels is None:
            return 0, 0
        letters = letters_for(size)
        if self._lettering is None or self._lettering.letters != letters:
            self._lettering = Lettering(letters)
        placed = place_labels(annotation.labels, view, size, self._lettering)
        self.labels.draw(placed.words, placed.corners, placed.colors, self._lettering, size)
        return placed.n_left_out, placed.n_seen

    def release(self) -> None:
        """Free everything."""
        self.segments.release()
        self.labels.release()
