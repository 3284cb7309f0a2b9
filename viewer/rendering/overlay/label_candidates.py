"""Candidate positions of labels around their points, and their clearance from other points."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.rendering.overlay.label_cells import Dots
from viewer.rig.arrays import Bools, Floats, Ints

__all__ = [
    "Places",
    "clear_places",
    "crowded",
    "crowded_lines",
    "line_pixels",
    "places_of",
]

_SIDE = math.sqrt(0.5)
_WAYS = np.array(
    [[1, 0], [-1, 0], [_SIDE, -_SIDE], [_SIDE, _SIDE], [-_SIDE, -_SIDE], [-_SIDE, _SIDE],
     [0, -1], [0, 1]],
    dtype=np.float64,
)  # fmt: skip
"""Directions from a point to its label, in order of preference; y points down."""

_REACHES = (1.0, 3.0, 5.0)
"""Distances of labels from their points, in gaps; all but the first have a leader line."""

_ALIKE = 1.0  # labels of points closer than this, in pixels, may have the same position
# Minimum distance of a label from other points, as a multiple of its distance from its own point,
# or in gaps for a label with a leader line.
_CLEARER = 1.5
_FREE = 3.0  # the same minimum distance for a position with plenty of room
_BESIDE_LINE = 0.75  # minimum distance of a leader line from other points, in gaps


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Candidate positions of labels.

    Attributes
    ----------
    labels : (M,)
        Index of the label to which each position belongs.
    ranks : (M,)
        Preference of the position, lower is better.
    anchors : (M, 2)
        The labels' points, pixels.
    low, high : (M, 2)
        Top left and bottom right corners, integer pixels.
    ends : (M, 2)
        Point of each rectangle that is nearest to the labelled point, pixels.
    own : (M,)
        Distance between these two points, pixels.
    has_line : (M,) bool
        Whether the position requires a leader line.
    """

    labels: Ints
    ranks: Ints
    anchors: Floats
    low: Ints
    high: Ints
    ends: Floats
    own: Floats
    has_line: Bools

    def take(self, rows: NDArray[np.integer[Any]]) -> Places:
        """Return a selection of the positions."""
        return Places(
            self.labels[rows],
            self.ranks[rows],
            self.anchors[rows],
            self.low[rows],
            self.high[rows],
            self.ends[rows],
            self.own[rows],
            self.has_line[rows],
        )


def places_of(anchors: Floats, sizes: Ints, picture: tuple[int, int], gap: float) -> Places:
    """Return all candidate positions of labels that lie within an image.

    Parameters
    ----------
    anchors : (N, 2)
        The points, pixels from the image's left and upper edge.
    sizes : (N, 2)
        Width and height of the labels, pixels.
    picture : (int, int)
        Width and height of the image.
    gap : float
        Pixels between a point and its label.
    """
    ways = np.tile(_WAYS, (len(_REACHES), 1))
    nearest = anchors[:, None] + gap * np.repeat(_REACHES, len(_WAYS))[:, None] * ways
    low = np.rint(nearest - 0.5 * (1.0 - np.sign(ways)) * sizes[:, None])
    # Labels straight above, below or next to their point may be shifted to stay in the image.
    room = np.maximum(np.array(picture) - sizes, 0)[:, None]
    low = np.where(ways == 0.0, np.clip(low, 0.0, room), low)
    is_inside = (low >= 0.0) & (low + np.maximum(sizes, 1)[:, None] <= picture)
    inside = np.nonzero(is_inside[..., 0] & is_inside[..., 1])
    labels, ranks = (indices.astype(np.int32) for indices in inside)
    low, anchors = low[labels, ranks].astype(np.int32), anchors[labels]
    high = low + sizes[labels]
    ends = np.clip(anchors, low, high)
    own = np.hypot(*(ends - anchors).T)
    return Places(labels, ranks, anchors, low, high, ends, own, ranks >= len(_WAYS))


def crowded(places: Places, anchors: Floats, dots: Dots, gap: float) -> Bools:
    """Return a mask of positions certainly too close to other points, or over their own: (M,).

    Parameters
    ----------
    places : Places
        Candidate positions within the image.
    anchors : (N, 2)
        The labels' points, pixels.
    dots : Dots
        All points.
    gap : float
        Pixels between a point and its label.
    """
    # 0.7 < 1 / sqrt(2): all points of the enlarged rectangle are within the minimum distance.
    more = 0.7 * _least(places, gap)[:, None]
    around = dots.most_within(anchors - _ALIKE, anchors + _ALIKE)
    found = dots.fewest_within(places.low - more, places.high + more)
    # With gaps of less than a pixel, a label may also be over its own point.
    return np.asarray((found > around[places.labels]) | (places.own == 0.0))


def line_pixels(places: Places, gap: float) -> tuple[Ints, Bools]:
    """Return the pixels of leader lines from next to the points to just before their labels.

    Parameters
    ----------
    places : Places
        Candidate positions within the image.
    gap : float
        Pixels between a point and its label.

    Returns
    -------
    pixels : (M, S, 2)
        Column and row of the pixels, starting from the point.
    are_part : (M, S) bool
        Whether each pixel belongs to the line; positions without a line have none.
    """
    start, length = places.anchors[:, None], places.own[:, None]
    steps = np.arange(0.5 * gap, places.own.max(initial=0.0))
    are_part = places.has_line[:, None] & (steps < length - 1.0)
    fractions = np.where(are_part, steps, 0.0)[..., None] / length[..., None]
    pixels = np.floor(start + fractions * (places.ends[:, None] - start)).astype(np.int32)
    return np.where(are_part[..., None], pixels, 0), are_part


def crowded_lines(places: Places, pixels: Ints, are_part: Bools, dots: Dots, gap: float) -> Bools:
    """Return a mask of lines that certainly pass too close to other points: (M,).

    Parameters
    ----------
    places : Places
        Positions to which the lines lead.
    pixels, are_part : (M, S, 2), (M, S) bool
        Result of ``line_pixels``.
    dots : Dots
        All points.
    gap : float
        Pixels between a point and its label.
    """
    diagonal = math.sqrt(2.0) * dots.cells.side
    if diagonal > _BESIDE_LINE * gap:
        return np.zeros(len(pixels), dtype=np.bool_)
    # A dot in a cell that the line crosses is closer to the line than the cell's diagonal. The
    # start of the line is skipped, where the cells may contain its own point or coincident points.
    across, down = np.moveaxis(np.abs(pixels + 0.5 - places.anchors[:, None]), 2, 0)
    is_away = are_part & (np.maximum(across, down) > _ALIKE + dots.cells.side + 0.5)
    return np.asarray((is_away & (dots.count_at(pixels) > 0)).any(axis=1))


def clear_places(places: Places, dots: Dots, gap: float) -> Places:
    """Return the positions that are far enough from other points, best first for each label.

    Parameters
    ----------
    places : Places
        Candidate positions within the image.
    dots : Dots
        All points.
    gap : float
        Pixels between a point and its label.
    """
    clear = np.full(len(places.labels), np.inf)
    for layer in range(dots.n_layers):
        nearest, beside_line = _clearances(places, dots, layer, gap)
        clear = np.minimum(clear, nearest)
        rows = np.flatnonzero((clear >= _least(places, gap)) & (beside_line >= _BESIDE_LINE * gap))
        places, clear = places.take(rows), clear[rows]
    # Positions with plenty of room come first, then crowded ones, then those with leader lines.
    is_free = ~places.has_line & (clear >= _FREE * places.own)
    order = np.lexsort((places.ranks, places.has_line, ~is_free, places.labels))
    return places.take(order)


def _least(places: Places, gap: float) -> Floats:
    """Return the minimum distance of positions from other points, pixels: (M,)."""
    return _CLEARER * np.where(places.has_line, gap, places.own)


def _clearances(places: Places, dots: Dots, layer: int, gap: float) -> tuple[Floats, Floats]:
    """Return distances of the nearest other points from positions and lines: (M,), inf if far."""
    reach = np.where(places.has_line, _CLEARER * gap, _FREE * places.own)[:, None]
    low = np.minimum(places.low - reach, places.anchors - _BESIDE_LINE * gap)
    high = np.maximum(places.high + reach, places.anchors + _BESIDE_LINE * gap)
    clear, beside_line = np.full((2, len(reach)), np.inf)
    for owners, points in dots.pairs(low, high, layer):
        away = points - places.anchors[owners]
        others = np.flatnonzero(np.maximum(*np.abs(away).T) >= _ALIKE)
        owners, points, away = owners[others], points[others], away[others]
        outside = np.maximum(places.low[owners] - points, points - places.high[owners])
        np.minimum.at(clear, owners, np.hypot(*np.maximum(outside, 0.0).T))
        led = np.flatnonzero(places.has_line[owners])
        owners, away = owners[led], away[led]
        along = places.ends[owners] - places.anchors[owners]
        fractions = np.clip((away * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
        np.minimum.at(beside_line, owners, np.hypot(*(away - fractions[:, None] * along).T))
    return clear, beside_line
