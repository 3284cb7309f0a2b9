"""Draws what is seen of joints beside their boxes: bones through the skin, axes, names."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl

from viewer.rendering.joint_marks import (
    JointMarks,
    axis_segments,
    bone_segments,
    joint_dots,
    marks_of,
)
from viewer.rendering.joint_names import letters_for, place_names
from viewer.rendering.label_pass import LabelPass
from viewer.rendering.lettering import Lettering
from viewer.rendering.options import DisplayOptions
from viewer.rendering.program import Programs
from viewer.rendering.projection import picture_scale
from viewer.rendering.segments import SegmentPass, Segments, joined
from viewer.rendering.view import View
from viewer.rig.scene import Actor

__all__ = ["JointMarkPass"]


class JointMarkPass:
    """Draws marks at joints.

    Parameters
    ----------
    context : moderngl.Context
        The context in use.
    programs : Programs
        Gives the programs.

    Attributes
    ----------
    names_left_out : (int, int)
        How many joints of the last picture have no name because it would cover another one, and of
        how many.
    """

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self.segments = SegmentPass(context, programs)
        self.labels = LabelPass(context, programs)
        self.names_left_out = 0, 0
        self._lettering: Lettering | None = None

    def draw(
        self,
        actors: Sequence[Actor],
        view: View,
        options: DisplayOptions,
        size: tuple[int, int],
        selected: tuple[int, int],
    ) -> None:
        """Draw the marks of all actors over what is bound.

        Parameters
        ----------
        actors : sequence of Actor
            Of a scene.
        view : View
            The camera's matrices.
        options : DisplayOptions
            Which marks there are.
        size : (int, int)
            Width and height of the picture, pixels.
        selected : (int, int)
            An actor's index and the joint of it that is highlighted; -1 for none.
        """
        marks = marks_of(actors)
        parts = [part for one in marks for part in _parts(one, options, size, selected)]
        if parts:
            self.segments.draw(joined(parts), view, size, on_top=options.xray)
        self.names_left_out = 0, 0
        if options.joint_names:
            letters = letters_for(size)
            if self._lettering is None or self._lettering.letters != letters:
                self._lettering = Lettering(letters)
            names = place_names(marks, view, size, selected, self._lettering)
            self.labels.draw(names.words, names.corners, names.colors, self._lettering, size)
            self.names_left_out = names.n_left_out, names.n_seen

    def release(self) -> None:
        """Free everything."""
        self.segments.release()
        self.labels.release()


def _parts(
    marks: JointMarks, options: DisplayOptions, size: tuple[int, int], selected: tuple[int, int]
) -> list[Segments]:
    """Return the lines and dots of one actor, those on top last."""
    scale, joint = picture_scale(size), selected[1] if marks.actor == selected[0] else -1
    parts = [bone_segments(marks, joint, scale)] if options.xray else []
    if options.joint_axes:
        parts.append(axis_segments(marks, scale))
    return parts + joint_dots(marks, joint, scale)
