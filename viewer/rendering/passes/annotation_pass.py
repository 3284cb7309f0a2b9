"""Pass that draws annotations: finding markers, X-ray joints, vertex callouts."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl

from viewer.rendering.gpu.program import Programs
from viewer.rendering.overlay.annotation import Annotation, leader_lines, letters_for, place_labels
from viewer.rendering.overlay.lettering import Lettering
from viewer.rendering.overlay.segments import SegmentPass, SegmentStyle
from viewer.rendering.passes.label_pass import LabelPass
from viewer.rendering.view import View

__all__ = ["AnnotationPass"]


class AnnotationPass:
    """Pass that draws annotations over the contents of the bound framebuffer.

    Parameters
    ----------
    context : moderngl.Context
        The context in use.
    programs : Programs
        Provides the shader programs.
    """

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self.segments = SegmentPass(context, programs)
        self.labels = LabelPass(context, programs)
        self._lettering: Lettering | None = None

    def draw(self, annotation: Annotation, view: View, size: tuple[int, int]) -> None:
        """Draw the segments of one annotation.

        Parameters
        ----------
        annotation : Annotation
            The annotation to draw.
        view : View
            The camera's matrices.
        size : (int, int)
            Width and height of the image, pixels.

        Raises
        ------
        RenderError
            If there is not enough graphics memory.
        """
        self.segments.draw(annotation.segments, view, size, annotation.style)

    def write(
        self, annotations: Sequence[Annotation], view: View, size: tuple[int, int]
    ) -> list[tuple[int, int]]:
        """Draw the labels of several annotations without overlap.

        Parameters
        ----------
        annotations : sequence of Annotation
            All annotations of the image.
        view : View
            The camera's matrices.
        size : (int, int)
            Width and height of the image, pixels.

        Returns
        -------
        list of (int, int)
            For each annotation, the number of labels omitted for lack of room next to their points,
            and the number of labels within the image.

        Raises
        ------
        RenderError
            If there is not enough graphics memory.
        """
        having = [row for row, one in enumerate(annotations) if one.labels is not None]
        labels = [one.labels for one in annotations if one.labels is not None]
        counts = [(0, 0)] * len(annotations)
        if not labels:
            return counts
        letters = letters_for(size)
        if self._lettering is None or self._lettering.letters != letters:
            self._lettering = Lettering(letters)
        placed = place_labels(labels, view, size, self._lettering)
        self.segments.draw(leader_lines(placed, view, size), view, size, SegmentStyle(on_top=True))
        self.labels.draw(placed.texts, placed.corners, placed.colors, self._lettering, size)
        for row, left_out, seen in zip(having, placed.n_left_out, placed.n_seen, strict=True):
            counts[row] = left_out, seen
        return counts

    def release(self) -> None:
        """Free everything."""
        self.segments.release()
        self.labels.release()
