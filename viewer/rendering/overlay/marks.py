"""Marks at positions in the scene: points and lines of constant size on the screen."""

from __future__ import annotations

from dataclasses import field

import numpy as np

from viewer.data_classes import dataclass
from viewer.rendering.overlay.annotation import Annotation
from viewer.rendering.overlay.segments import Segments, SegmentStyle
from viewer.rig.arrays import Floats

__all__ = ["MARK_COLOR", "Marks", "mark_annotation"]

MARK_COLOR = (1.0, 0.16, 0.56)
"""Colour of marks, sRGB, distinct from the colour maps and the lights."""

_LINE = 1.0  # radius of lines, pixels
_STYLE = SegmentStyle(hidden=0.5, lift=0.004, border=1.5, border_color=(0.08, 0.02, 0.05))


@dataclass(frozen=True, slots=True, eq=False)
class Marks:
    """Positions of marks.

    Attributes
    ----------
    points : (N, 3)
        Scene space.
    radii : (N,)
        Radii of the points, pixels.
    lines : (M, 2, 3)
        Both ends of each line, scene space.
    """

    points: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    radii: Floats = field(default_factory=lambda: np.zeros(0))
    lines: Floats = field(default_factory=lambda: np.zeros((0, 2, 3)))


def mark_annotation(marks: Marks) -> Annotation:
    """Return marks as an annotation: lines first, so that points are drawn over them."""
    radii = np.concatenate([np.full(len(marks.lines), _LINE), marks.radii])
    colors = np.broadcast_to((*MARK_COLOR, 1.0), (len(radii), 4))
    starts = np.concatenate([marks.lines[:, 0], marks.points])
    ends = np.concatenate([marks.lines[:, 1], marks.points])
    return Annotation(Segments(starts, ends, colors, 2.0 * radii), _STYLE)
