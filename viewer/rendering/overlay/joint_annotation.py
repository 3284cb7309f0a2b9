"""Annotations of joints: bones visible through the skin, axes, names."""

from __future__ import annotations

from collections.abc import Sequence

from viewer.rendering.options import DisplayOptions
from viewer.rendering.overlay.annotation import Annotation
from viewer.rendering.overlay.joint_marks import (
    JointMarks,
    axis_segments,
    bone_segments,
    joint_dots,
    marks_of,
)
from viewer.rendering.overlay.joint_names import name_labels
from viewer.rendering.overlay.segments import Segments, SegmentStyle, joined
from viewer.rendering.projection import picture_scale
from viewer.rig.scene import Actor

__all__ = ["joint_annotation"]


def joint_annotation(
    actors: Sequence[Actor],
    options: DisplayOptions,
    size: tuple[int, int],
    selected: tuple[int, int],
) -> Annotation | None:
    """Return the marks at the joints of all actors; None if there are no joints.

    Parameters
    ----------
    actors : sequence of Actor
        The actors of a scene.
    options : DisplayOptions
        Display options that select the marks.
    size : (int, int)
        Width and height of the image, pixels.
    selected : (int, int)
        Index of an actor and of its highlighted joint; -1 for none.
    """
    marks = marks_of(actors)
    parts = [part for one in marks for part in _parts(one, options, size, selected)]
    if not parts:
        return None
    labels = name_labels(marks, selected) if options.joint_names else None
    return Annotation(joined(parts), SegmentStyle(on_top=options.xray), labels)


def _parts(
    marks: JointMarks, options: DisplayOptions, size: tuple[int, int], selected: tuple[int, int]
) -> list[Segments]:
    """Return the lines and dots of one actor, the topmost last."""
    scale, joint = picture_scale(size), selected[1] if marks.actor == selected[0] else -1
    parts = [bone_segments(marks, joint, scale)] if options.xray else []
    if options.joint_axes:
        parts.append(axis_segments(marks, scale))
    return parts + joint_dots(marks, joint, scale)
