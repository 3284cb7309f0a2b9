"""Layout of labels: choice and placement without overlap or ambiguity.

A label has candidate positions around its point. Those over other labels, over their lines or too
close to other points are rejected; a grid of cells over the image finds the points within many
rectangles quickly.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Bools, Floats, Ints

_BATCH = 512  # number of labels whose positions are compared with the placed labels at once
_CELL_SIDE = 0.5  # side length of a cell in gaps, unless this gives too many cells
# Maximum numbers of cells, above which a grid costs more than it saves.
_CELLS_PER_LABEL, _MANY_CELLS = 40, 300_000
_SAMPLES = 5  # number of columns of a label that are tested first, which detects most overlaps

# Candidate positions.
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

# Cells. Each subdivision of a pixel contains at most one dot.
_SUBDIVISIONS = 4  # number of subdivisions of a pixel per axis
_PAIRS = 1 << 18  # number of pairs of a rectangle and a dot per batch


@dataclass(frozen=True, slots=True, eq=False)
class LabelLayout:
    """The placed labels."""

    chosen: Ints
    """(M,). Indices of the placed labels, in the order of placement."""
    corners: Ints
    """(M, 2). Top left corners of the labels, integer pixels."""
    ends: Floats
    """(M, 2). Point on each label that is nearest to the labelled point, pixels."""
    has_line: Bools
    """(M,) bool. Whether the label needs a leader line because there was no room next to its
    point."""


def lay_out(
    anchors: Floats,
    order: Ints,
    sizes: Ints,
    picture: tuple[int, int],
    gap: float,
) -> LabelLayout:
    """Place labels next to their points in order, and omit those without room.

    A label is placed right or left of its point, diagonally, above or below, whichever position has
    the most room; otherwise at a distance, with a leader line. It is never closer to another point
    than to its own; distances are accurate to a quarter of a pixel. ``anchors``: (N, 2), the
    points, pixels from the image's left and upper edge. ``order``: (N,), indices of the labels in
    the order of placement. ``sizes``: (N, 2), width and height of the labels, pixels, 1 or more.
    """
    n_cells = min(_CELLS_PER_LABEL * max(len(order), 1), _MANY_CELLS)
    side = max(int(_CELL_SIDE * gap), math.ceil(math.sqrt(math.prod(picture) / n_cells)))
    dots, taken = Dots(Cells(picture, side), anchors[order]), _Taken(picture, gap)
    nothing = np.zeros(0, np.int32), np.zeros((0, 2), np.int32), np.zeros((0, 2)), np.zeros(0, bool)
    placed: list[tuple[NDArray[np.generic], ...]] = [nothing]
    for start in range(0, len(order), _BATCH):
        some = order[start : start + _BATCH]
        places = label_places(anchors[some], sizes[some], picture, gap)
        # Vectorized rejection of most positions that overlap others.
        may = np.flatnonzero(~crowded(places, anchors[some], dots, gap))
        places = places.take(may[taken.may_be_open(places.low[may], places.high[may])])
        places = clear_places(places, dots, gap)
        found = places.take(_settle(places, taken, gap))
        placed.append((some[found.labels], found.low, found.ends, found.has_line))
    return LabelLayout(*map(np.concatenate, zip(*placed, strict=True)))


def _settle(places: LabelPlaces, taken: _Taken, gap: float) -> Ints:
    """Choose the first free position of each label; return indices of positions: (M,)."""
    found: list[int] = []
    settled = -1  # the most recently placed label
    # Occupied positions, shared by labels of coincident points.
    closed: set[tuple[int, ...]] = set()
    pixels, are_part = line_pixels(places, gap)
    corners = list(map(tuple, np.hstack([places.low, places.high]).tolist()))
    for row, label in enumerate(places.labels.tolist()):
        if label == settled or corners[row] in closed:
            continue
        if not taken.is_open(corners[row]):
            closed.add(corners[row])
            continue
        path = pixels[row, are_part[row]]
        if not taken.at(path).any():
            taken.take(corners[row], path)
            found.append(row)
            settled = label
    return np.array(found, dtype=np.int32)


class _Taken:
    """Mask of the pixels occupied by labels and lines; points are ``gap`` pixels from labels."""

    def __init__(self, picture: tuple[int, int], gap: float) -> None:
        self._pixels = np.zeros(picture[::-1], dtype=np.bool_)
        # Half a gap stays free on both sides, so that adjacent labels are not read as one.
        self._apart = round(0.5 * gap)

    def may_be_open(self, low: Ints, high: Ints) -> Bools:
        """Return a mask of rectangles that may be free: (M,); all others are certainly occupied."""
        # Labels have the same height, so an overlap always covers a pixel of the upper or lower
        # edge.
        left = np.maximum(low[:, :1] - self._apart, 0)
        right = np.minimum(high[:, :1] + self._apart, self._pixels.shape[1]) - 1
        columns = left + (right - left) * np.arange(_SAMPLES) // (_SAMPLES - 1)
        edges = self._pixels[low[:, 1:], columns] | self._pixels[high[:, 1:] - 1, columns]
        return ~edges.any(axis=1)

    def at(self, pixels: Ints) -> Bools:
        """Return whether pixels, given as column and row, are occupied: (...,)."""
        return self._pixels[pixels[..., 1], pixels[..., 0]]

    def is_open(self, corners: tuple[int, ...]) -> bool:
        """Return whether the rectangle of a label is free; corners are left, top, right, bottom."""
        left, top, right, bottom = corners
        around = slice(max(left - self._apart, 0), right + self._apart)
        return not self._pixels[top:bottom, around].any()

    def take(self, corners: tuple[int, ...], path: Ints) -> None:
        """Mark the rectangle of a label and the pixels (S, 2) of its line as occupied."""
        left, top, right, bottom = corners
        self._pixels[path[:, 1], path[:, 0]] = True
        self._pixels[top:bottom, left:right] = True


@dataclass(frozen=True, slots=True, eq=False)
class LabelPlaces:
    """Candidate positions of labels."""

    labels: Ints
    """(M,). Index of the label to which each position belongs."""
    ranks: Ints
    """(M,). Preference of the position, lower is better."""
    anchors: Floats
    """(M, 2). The labels' points, pixels."""
    low: Ints
    high: Ints
    """(M, 2). Top left and bottom right corners, integer pixels."""
    ends: Floats
    """(M, 2). Point of each rectangle that is nearest to the labelled point, pixels."""
    own: Floats
    """(M,). Distance between these two points, pixels."""
    has_line: Bools
    """(M,) bool. Whether the position requires a leader line."""

    def take(self, rows: NDArray[np.integer]) -> LabelPlaces:
        """Return a selection of the positions."""
        return LabelPlaces(*(getattr(self, field.name)[rows] for field in fields(self)))


def label_places(anchors: Floats, sizes: Ints, picture: tuple[int, int], gap: float) -> LabelPlaces:
    """Return candidates for labels, sizes (N, 2), of points, (N, 2), within an image; pixels."""
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
    return LabelPlaces(labels, ranks, anchors, low, high, ends, own, ranks >= len(_WAYS))


def crowded(places: LabelPlaces, anchors: Floats, dots: Dots, gap: float) -> Bools:
    """Return a mask, (M,), of positions certainly too close to other points, or over their own."""
    # 0.7 < 1 / sqrt(2): all points of the enlarged rectangle are within the minimum distance.
    more = 0.7 * _least(places, gap)[:, None]
    around = dots.most_within(anchors - _ALIKE, anchors + _ALIKE)
    found = dots.fewest_within(places.low - more, places.high + more)
    # With gaps of less than a pixel, a label may also be over its own point.
    return np.asarray((found > around[places.labels]) | (places.own == 0.0))


def line_pixels(places: LabelPlaces, gap: float) -> tuple[Ints, Bools]:
    """Return the pixels of leader lines, from next to the points to just before their labels.

    They are columns and rows, (M, S, 2), starting from the point. The mask, (M, S), says which
    belong to the line; positions without a line have none.
    """
    start, length = places.anchors[:, None], places.own[:, None]
    steps = np.arange(0.5 * gap, places.own.max(initial=0.0))
    are_part = places.has_line[:, None] & (steps < length - 1.0)
    fractions = np.where(are_part, steps, 0.0)[..., None] / length[..., None]
    pixels = np.floor(start + fractions * (places.ends[:, None] - start)).astype(np.int32)
    return np.where(are_part[..., None], pixels, 0), are_part


def clear_places(places: LabelPlaces, dots: Dots, gap: float) -> LabelPlaces:
    """Return the positions that are far enough from other points, best first for each label."""
    clear, beside_line = _clearances(places, dots, gap)
    rows = np.flatnonzero((clear >= _least(places, gap)) & (beside_line >= _BESIDE_LINE * gap))
    places, clear = places.take(rows), clear[rows]
    # Positions with plenty of room come first, then crowded ones, then those with leader lines.
    is_free = ~places.has_line & (clear >= _FREE * places.own)
    order = np.lexsort((places.ranks, places.has_line, ~is_free, places.labels))
    return places.take(order)


def _least(places: LabelPlaces, gap: float) -> Floats:
    """Return the minimum distance of positions from other points, pixels: (M,)."""
    return _CLEARER * np.where(places.has_line, gap, places.own)


def _clearances(places: LabelPlaces, dots: Dots, gap: float) -> tuple[Floats, Floats]:
    """Return distances of the nearest other points from positions and lines: (M,), inf if far."""
    reach = np.where(places.has_line, _CLEARER * gap, _FREE * places.own)[:, None]
    low = np.minimum(places.low - reach, places.anchors - _BESIDE_LINE * gap)
    high = np.maximum(places.high + reach, places.anchors + _BESIDE_LINE * gap)
    clear, beside_line = np.full((2, len(reach)), np.inf)
    for owners, points in dots.pairs(low, high):
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


class Dots:
    """Points, (N, 2) pixels from the image's left and upper edge, sorted into grid cells."""

    # Points within the same quarter of a pixel are merged: otherwise all joints of a distant figure
    # would be compared with each other.

    def __init__(self, cells: Cells, points: Floats) -> None:
        self.cells = cells
        # Complex numbers are sorted faster than rows.
        quarters = np.floor(points * _SUBDIVISIONS).view(np.complex128)[:, 0]
        points = points[np.unique(quarters, return_index=True)[1]]
        places = cells.of(points)
        numbers = places[:, 1] * np.int64(cells.shape[1]) + places[:, 0]
        counts = np.bincount(numbers, minlength=math.prod(cells.shape)).astype(np.int32)
        self._sums = summed(counts.reshape(cells.shape))
        # The dots of each cell are consecutive; after the starts of all cells follows their number.
        self._points = points[np.argsort(numbers, kind="stable")]
        self._starts = np.concatenate([[0], counts.cumsum()]).astype(np.int32)

    def fewest_within(self, low: Floats, high: Floats) -> Ints:
        """Return lower bounds of the number of dots within rectangles: (M,)."""
        return sums_within(self._sums, *self.cells.within(low, high))

    def most_within(self, low: Floats, high: Floats) -> Ints:
        """Return upper bounds of the number of dots within rectangles: (M,)."""
        return sums_within(self._sums, *self.cells.touching(low, high))

    def pairs(self, low: Floats, high: Floats) -> Iterator[tuple[Ints, Floats]]:
        """Yield batches of pairs of a rectangle, corners (M, 2), and a dot in a cell it touches."""
        # Each batch has the indices of rectangles, (P,), and a point in or near each of these,
        # (P, 2), pixels.
        first, after = self.cells.touching(low, high)
        owners, rows = spread(first[:, 1], after[:, 1] - first[:, 1])
        rows = rows * self.cells.shape[1]
        starts = self._starts[rows + first[owners, 0]]
        counts = self._starts[rows + after[owners, 0]] - starts
        some = np.flatnonzero(counts)
        part = (counts[some].cumsum() - 1) // _PAIRS
        for ranges in np.split(some, np.flatnonzero(np.diff(part)) + 1):
            ranks, places = spread(starts[ranges], counts[ranges])
            yield owners[ranges[ranks]], self._points[places]


class Cells:
    """The cells: 1 to ``n`` per axis within the image; 0 and ``n + 1`` are outside it."""

    def __init__(self, picture: tuple[int, int], side: int) -> None:
        self.side = side
        # Numbers of columns and rows.
        self._counts = np.array([-(-length // side) for length in picture])
        self.shape = int(self._counts[1]) + 2, int(self._counts[0]) + 2

    def of(self, points: Floats) -> Ints:
        """Return the cells that contain points: (..., 2), column and row."""
        found = np.clip(np.floor(points / self.side) + 1.0, 0, self._counts + 1)
        return np.asarray(found.astype(np.int32))

    def within(self, low: Floats, high: Floats) -> tuple[Ints, Ints]:
        """Return the half-open ranges of cells within rectangles, first and end: (..., 2)."""
        first = np.clip(np.ceil(low / self.side) + 1.0, 1, self._counts + 1)
        after = np.clip(np.floor(high / self.side) + 1.0, first, self._counts + 1)
        return first.astype(np.int32), after.astype(np.int32)

    def touching(self, low: Floats, high: Floats) -> tuple[Ints, Ints]:
        """Return the half-open ranges of cells that rectangles touch, first and end: (..., 2)."""
        return self.of(low), self.of(high) + np.int32(1)


def summed(table: Ints) -> Ints:
    """Return the summed-area table of an array, one row and column larger."""
    # Four of its elements give the sum over a rectangle (Crow 1984, Summed-area tables for texture
    # mapping).
    sums = np.zeros((table.shape[0] + 1, table.shape[1] + 1), dtype=np.int32)
    table.cumsum(axis=0, out=sums[1:, 1:], dtype=np.int32)
    sums[1:, 1:].cumsum(axis=1, out=sums[1:, 1:])
    return sums


def sums_within(sums: Ints, first: Ints, after: Ints) -> Ints:
    """Return sums, (...,), over rectangles of cells from a result of ``summed``."""
    # The first cell and the cell after the last are column and row, (..., 2); equal ones are empty.
    flat, width = sums.ravel(), sums.shape[1]
    low, high = first[..., 1] * width, after[..., 1] * width
    left, right = first[..., 0], after[..., 0]
    return flat[high + right] - flat[high + left] - flat[low + right] + flat[low + left]


def spread(starts: Ints, counts: Ints) -> tuple[Ints, Ints]:
    """Return the owners and the integers of ranges, concatenated: (P,) each."""
    owners = np.repeat(np.arange(len(counts)), counts)
    before = starts - (counts.cumsum() - counts)
    numbers = np.arange(len(owners)) + before[owners]
    return owners.astype(np.int32), numbers.astype(np.int32)
