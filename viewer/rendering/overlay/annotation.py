"""Annotations drawn over an image: lines and dots in the scene, labels next to points.

Marks are annotations at positions in the scene, of constant size on the screen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field

import numpy as np

from viewer.data_classes import dataclass
from viewer.rendering.overlay.labels import lay_out
from viewer.rendering.overlay.segments import Segments, SegmentStyle
from viewer.rendering.overlay.typeface import Lettering
from viewer.rendering.projection import picture_scale, project, unproject
from viewer.rendering.view import View
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.geometry.vectors import unit

LABEL_COLOR = (0.97, 0.97, 0.98)
"""Default label colour, sRGB."""

_LETTERS = 17.0  # text height in an image of standard height, pixels
_GAP = 7.0  # pixels between a point and its label
_LEADER, _BENEATH = 1.3, 2.6  # widths of a leader line and of its dark outline, pixels
_RIM = 5.0  # pixels between a point and the start of its leader line
_DARK = (0.05, 0.06, 0.08, 0.7)

MARK_COLOR = (1.0, 0.16, 0.56)
"""Colour of marks, sRGB, distinct from the colour maps and the lights."""

_MARK_LINE = 1.0  # radius of lines, pixels
_MARK_STYLE = SegmentStyle(hidden=0.5, lift=0.004, border=1.5, border_color=(0.08, 0.02, 0.05))


@dataclass(frozen=True, slots=True, eq=False)
class Annotation:
    """Segments, and labels drawn over them."""

    segments: Segments
    """Segments in drawing order."""
    style: SegmentStyle
    labels: Labels | None = None
    """Labels, which are never hidden."""


@dataclass(frozen=True, slots=True, eq=False)
class Labels:
    """Labels next to points."""

    texts: tuple[str, ...]
    """Their texts."""
    points: Floats
    """(N, 3). Labelled points, scene space."""
    ranks: Ints
    """(N,) int. If there is no room for all labels, lower ranks take precedence, even across
    annotations; among equal ranks, nearer points take precedence."""
    colors: Floats
    """(N, 3). Colours of the text, sRGB, 0 to 1."""


@dataclass(frozen=True, slots=True, eq=False)
class Marks:
    """Positions of marks."""

    points: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    """(N, 3). Scene space."""
    radii: Floats = field(default_factory=lambda: np.zeros(0))
    """(N,). Radii of the points, pixels."""
    lines: Floats = field(default_factory=lambda: np.zeros((0, 2, 3)))
    """(M, 2, 3). Both ends of each line, scene space."""


def mark_annotation(marks: Marks) -> Annotation:
    """Return marks as an annotation: lines first, so that points are drawn over them."""
    radii = np.concatenate([np.full(len(marks.lines), _MARK_LINE), marks.radii])
    colors = np.broadcast_to((*MARK_COLOR, 1.0), (len(radii), 4))
    starts = np.concatenate([marks.lines[:, 0], marks.points])
    ends = np.concatenate([marks.lines[:, 1], marks.points])
    return Annotation(Segments(starts, ends, colors, 2.0 * radii), _MARK_STYLE)


def letters_for(size: tuple[int, int]) -> int:
    """Return the height of text in an image, pixels."""
    return round(_LETTERS * picture_scale(size))


def place_labels(
    labels: Sequence[Labels], view: View, size: tuple[int, int], lettering: Lettering
) -> PlacedLabels:
    """Place labels next to their points without overlap: low ranks first, then nearer points."""
    texts = [text for one in labels for text in one.texts]
    points = np.concatenate([np.zeros((0, 3)), *(one.points for one in labels)])
    colors = np.concatenate([np.zeros((0, 3)), *(one.colors for one in labels)])
    ranks = np.concatenate([np.zeros(0, np.int32), *(one.ranks for one in labels)])
    owners = np.repeat(np.arange(len(labels)), [len(one.texts) for one in labels])
    found = project(view, size, points)
    nearest = np.lexsort((found.depths, ranks))
    order = nearest[found.seen[nearest]].astype(np.int32)
    sizes = lettering.sizes(texts)
    layout = lay_out(found.pixels, order, sizes, size, _GAP * picture_scale(size))
    chosen = layout.chosen
    return PlacedLabels(
        tuple(texts[index] for index in chosen.tolist()),
        layout.corners,
        colors[chosen],
        points[chosen],
        layout.ends,
        layout.has_line,
        owners[chosen].astype(np.int32),
        tuple(np.bincount(owners[order], minlength=len(labels)).tolist()),
    )


@dataclass(frozen=True, slots=True, eq=False)
class PlacedLabels:
    """Labels with their positions in the image."""

    texts: tuple[str, ...]
    """Their texts."""
    corners: Ints
    """(M, 2). Top left corners, pixels from the image's left and upper edge."""
    colors: Floats
    """(M, 3). sRGB, 0 to 1."""
    points: Floats
    """(M, 3). Labelled points, scene space."""
    ends: Floats
    """(M, 2). Point of each label that is nearest to the labelled point, pixels."""
    has_line: Bools
    """(M,) bool. Whether a leader line is needed."""
    owners: Ints
    """(M,). Index of the ``Labels`` to which each label belongs."""
    n_seen: tuple[int, ...]
    """Number of points within the image for each ``Labels``."""

    @property
    def n_left_out(self) -> tuple[int, ...]:
        """Number of labels omitted for lack of room for each ``Labels``."""
        drawn = np.bincount(self.owners, minlength=len(self.n_seen)).tolist()
        return tuple(seen - count for seen, count in zip(self.n_seen, drawn, strict=True))


def leader_lines(placed: PlacedLabels, view: View, size: tuple[int, int]) -> Segments:
    """Return the leader lines of placed labels that are not next to their points."""
    led, scale = placed.has_line, picture_scale(size)
    points, to = placed.points[led], placed.ends[led]
    pixels = project(view, size, points).pixels
    # The dot of the point must not be covered.
    pixels = pixels + scale * _RIM * unit(to - pixels)
    starts, ends = (unproject(view, size, points, places) for places in (pixels, to))
    colors = np.hstack([placed.colors[led], np.ones((len(starts), 1))])
    dark = np.broadcast_to(_DARK, colors.shape)
    widths = scale * np.repeat([_BENEATH, _LEADER], len(starts))
    return Segments(
        np.concatenate([starts, starts]),
        np.concatenate([ends, ends]),
        np.concatenate([dark, colors]),
        widths,
    )
